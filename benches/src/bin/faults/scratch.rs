//! The copy of the workspace that the faults are compiled into: never the workspace itself.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::any_error::AnyError;
use crate::fault::Fault;
use crate::memory::Memory;
use crate::outcome::Outcome;
use crate::switch::{self, Edit, Switched};
use crate::test_program::Program;

/// Says which fault is on, or notes which are reached.
const RUNTIME: &str = include_str!("runtime.txt");

/// A copy of the workspace and its target folder.
pub(crate) struct Scratch {
    folder: PathBuf,
}

/// Which faults are in the copy.
pub(crate) struct Compiled {
    why_not: BTreeMap<usize, Outcome>,
}

impl Compiled {
    pub(crate) fn contains(&self, fault: usize) -> bool {
        !self.why_not.contains_key(&fault)
    }

    pub(crate) fn why_not(&self, fault: usize) -> Outcome {
        self.why_not[&fault].clone()
    }
}

impl Scratch {
    /// Brings the copy up to date with the working tree at `root`; sources follow with their faults.
    pub(crate) fn copy(root: &Path, folder: &Path) -> Result<Self, AnyError> {
        let scratch = Self { folder: folder.to_owned() };
        let listed = Command::new("git")
            .args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"])
            .current_dir(root)
            .output()?;
        let files: BTreeSet<PathBuf> =
            String::from_utf8(listed.stdout)?.split('\0').filter(|f| !f.is_empty()).map(PathBuf::from).collect();
        for file in files.iter().filter(|file| root.join(file).is_file()) {
            let mut bytes = std::fs::read(root.join(file))?;
            if let Some(krate) = file.to_str().and_then(|f| f.strip_suffix("/src/lib.rs")).filter(|k| *k != "benches") {
                bytes.extend_from_slice(RUNTIME.as_bytes());
                std::fs::create_dir_all(scratch.code().join(krate))?;
            }
            // Sources may have faults in the copy: `compile` writes them.
            let base = if is_source(file) { scratch.plain() } else { scratch.code() };
            write_if_new(&base.join(file), &bytes)?;
        }
        for (base, file) in scratch.present()? {
            if !files.contains(&file) {
                std::fs::remove_file(base.join(file))?;
            }
        }
        Ok(scratch)
    }

    /// The copy.
    fn code(&self) -> PathBuf {
        self.folder.join("code")
    }

    /// Sources without faults.
    fn plain(&self) -> PathBuf {
        self.folder.join("plain")
    }

    /// Where tests note what they reach.
    pub(crate) fn reached_file(&self) -> PathBuf {
        self.folder.join("reached")
    }

    /// What a run leaves for the next one.
    pub(crate) fn memory_file(&self) -> PathBuf {
        self.folder.join("memory.json")
    }

    /// All files of the copy.
    fn present(&self) -> Result<Vec<(PathBuf, PathBuf)>, AnyError> {
        let mut files = Vec::new();
        for base in [self.code(), self.plain()] {
            let mut folders = vec![base.clone()];
            while let Some(folder) = folders.pop() {
                for entry in std::fs::read_dir(folder).into_iter().flatten() {
                    let path = entry?.path();
                    if path.is_dir() {
                        folders.push(path);
                    } else {
                        files.push((base.clone(), path.strip_prefix(&base)?.into()));
                    }
                }
            }
        }
        Ok(files)
    }

    /// Writes the sources with all faults, and takes out what does not compile until the tests of all crates do.
    pub(crate) fn compile(&self, faults: &[Fault], memory: &mut Memory) -> Result<(Compiled, Vec<Program>), AnyError> {
        let mut why_not = BTreeMap::new();
        loop {
            let sources = self.write_sources(faults, memory, &mut why_not)?;
            // A build finds what a check does not: arithmetic on constants that overflows.
            let (mut errors, _) = self.run(&["check", "--lib", "--bins", "--keep-going"])?;
            let mut programs = Vec::new();
            if errors.is_empty() {
                (errors, programs) = self.run(&["test", "--no-run"])?;
            }
            if errors.is_empty() {
                return Ok((Compiled { why_not }, programs));
            }
            let mut taken = BTreeSet::new();
            for error in &errors {
                let blamed = blamed(error, &sources);
                if blamed.is_empty() {
                    return Err(
                        format!("no fault explains this error:\n{}", error["rendered"].as_str().unwrap_or("")).into()
                    );
                }
                taken.extend(blamed);
            }
            eprintln!("{} errors, {} faults taken out or around more", errors.len(), taken.len());
            for id in taken {
                memory.set_skip(&faults[id], memory.skip(&faults[id]) + 1);
            }
            memory.write(&self.memory_file())?;
        }
    }

    /// Every source with its faults, by its path.
    fn write_sources(
        &self,
        faults: &[Fault],
        memory: &mut Memory,
        why_not: &mut BTreeMap<usize, Outcome>,
    ) -> Result<BTreeMap<String, Switched>, AnyError> {
        let mut sources = BTreeMap::new();
        for (base, file) in self.present()? {
            if base != self.plain() {
                continue;
            }
            let text = std::fs::read_to_string(base.join(&file))?;
            let name = file.to_string_lossy().into_owned();
            let edits: Vec<Edit> = faults
                .iter()
                .enumerate()
                .filter(|(id, fault)| fault.file == name && !why_not.contains_key(id))
                .map(|(id, f)| {
                    let (number, skip) = (memory.number(f), memory.skip(f));
                    Edit { id, number, place: &f.place, replacement: &f.replacement, skip }
                })
                .collect();
            let runtime = if name.contains("/src/bin/") { "paintcopter::planted::on" } else { "crate::planted::on" };
            let switched = if edits.is_empty() {
                Switched { text, ..Switched::default() }
            } else {
                switch::switch(&text, &edits, runtime).map_err(|e| format!("{name}: {e}"))?
            };
            for &id in &switched.outside {
                why_not.insert(
                    id,
                    if memory.skip(&faults[id]) > 0 { Outcome::DoesNotCompile } else { Outcome::NotSwitched },
                );
            }
            write_if_new(&self.code().join(&file), switched.text.as_bytes())?;
            sources.insert(name, switched);
        }
        // Shaders and what else is no source.
        for (id, _) in faults.iter().enumerate().filter(|(_, fault)| !sources.contains_key(&fault.file)) {
            why_not.insert(id, Outcome::NotSwitched);
        }
        Ok(sources)
    }

    /// What the compiler says against the code, of as many crates as it can, and the programs of tests that it makes.
    fn run(&self, words: &[&str]) -> Result<(Vec<Value>, Vec<Program>), AnyError> {
        let packages = ["--release", "--workspace", "--exclude", "paintcopter-benches", "--all-features", "--quiet"];
        let mut child = Command::new("cargo")
            .args(words)
            .args(packages)
            .arg("--message-format=json")
            .current_dir(self.code())
            .env("CARGO_TARGET_DIR", self.folder.join("target"))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let (mut errors, mut programs) = (Vec::new(), Vec::new());
        for line in BufReader::new(child.stdout.take().ok_or("no output")?).lines() {
            let mut message: Value = serde_json::from_str(&line?)?;
            let said = message["message"].take();
            if said["level"] == "error" && said["spans"].as_array().is_some_and(|s| !s.is_empty()) {
                errors.push(said);
            }
            if let (Some(path), Some(manifest)) = (message["executable"].as_str(), message["manifest_path"].as_str())
                && message["profile"]["test"] == true
            {
                let folder = Path::new(manifest).parent().ok_or("a manifest has no folder")?;
                let krate = folder.file_name().ok_or("a crate has no folder")?.to_string_lossy().into_owned();
                programs.push(Program { krate, path: path.into(), folder: folder.to_owned() });
            }
        }
        if !child.wait()?.success() && errors.is_empty() {
            return Err(format!("cargo {} fails in {}", words.join(" "), self.code().display()).into());
        }
        Ok((errors, programs))
    }
}

/// Whether a file is part of what is tested.
fn is_source(file: &Path) -> bool {
    let name = file.to_string_lossy();
    name.ends_with(".rs") && name.contains("/src/") && !name.starts_with("benches/")
}

/// Unchanged files keep their time, and what is built from them is kept.
fn write_if_new(path: &Path, bytes: &[u8]) -> Result<(), AnyError> {
    if std::fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    Ok(std::fs::write(path, bytes)?)
}

/// The faults behind an error: those whose own lines it names first, otherwise those around one of which it is.
fn blamed(error: &Value, sources: &BTreeMap<String, Switched>) -> BTreeSet<usize> {
    let mut spans: Vec<&Value> = error["spans"].as_array().into_iter().flatten().collect();
    spans.sort_by_key(|span| span["is_primary"] != true);
    let children = error["children"].as_array().into_iter().flatten();
    spans.extend(children.flat_map(|c| c["spans"].as_array().into_iter().flatten()));
    let lines = |span: &&Value| -> Option<(&Switched, usize)> {
        Some((sources.get(span["file_name"].as_str()?)?, span["line_start"].as_u64()? as usize))
    };
    let places: Vec<(&Switched, usize)> = spans.iter().filter_map(lines).collect();
    for (source, line) in &places {
        let own: BTreeSet<usize> = source.lines.iter().filter(|(r, _)| r.contains(line)).map(|(_, id)| *id).collect();
        if !own.is_empty() {
            return own;
        }
    }
    for (source, line) in &places {
        let near = source.regions.iter().filter(|(r, _)| r.contains(line)).min_by_key(|(r, _)| r.len());
        if let Some((_, ids)) = near {
            return ids.iter().copied().collect();
        }
    }
    BTreeSet::new()
}
