//! A fault: what stands in a file, and what stands there instead. Records by hand, and samples of the lists of `cargo mutants`.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::process::Command;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use serde::Deserialize;

use crate::any_error::AnyError;

/// Who planted a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Origin {
    /// Someone, for its meaning.
    Hand,
    /// A program, for breadth.
    Mutant,
}

/// One change of one file.
#[derive(Debug, Clone)]
pub(crate) struct Fault {
    /// Who planted it.
    pub(crate) origin: Origin,
    /// Folder of the crate, from the root.
    pub(crate) krate: String,
    /// The file, from the root.
    pub(crate) file: String,
    /// What is wrong with it.
    pub(crate) name: String,
    /// What is replaced, in bytes of the file.
    pub(crate) place: Range<usize>,
    /// What stands there instead.
    pub(crate) replacement: String,
    /// Line of the place, from 1.
    pub(crate) line: usize,
    /// Why nothing changes with it, if that is known.
    pub(crate) harmless: Option<String>,
}

impl Fault {
    /// Place and name.
    pub(crate) fn title(&self) -> String {
        format!("{}:{}: {}", self.file, self.line, self.name)
    }

    /// The same for as long as the file does not change.
    pub(crate) fn key(&self) -> String {
        format!("{}:{}-{}: {}", self.file, self.place.start, self.place.end, self.name)
    }

    fn new(origin: Origin, file: &str, name: String, text: &str, place: Range<usize>, replacement: String) -> Self {
        let krate = file.split('/').next().unwrap_or_default().to_owned();
        let line = text[..place.start].matches('\n').count() + 1;
        Self { origin, krate, file: file.to_owned(), name, place, replacement, line, harmless: None }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reasons {
    harmless: Vec<Reason>,
}

/// Why a mutant is none: the code's own line tells which one of a function is meant.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reason {
    file: String,
    name: String,
    code: String,
    why: String,
}

/// Puts down what is known of mutants that change nothing (`benches/faults/harmless/mutants.toml`).
fn explain(root: &Path, faults: &mut [Fault], texts: &BTreeMap<&String, String>) -> Result<(), AnyError> {
    let text = std::fs::read_to_string(root.join("benches/faults/harmless/mutants.toml"))?;
    let reasons: Reasons = toml::from_str(&text)?;
    for fault in faults {
        let code = texts[&fault.file].lines().nth(fault.line - 1).unwrap_or_default();
        let about = |r: &&Reason| r.file == fault.file && r.name == fault.name && code.contains(&r.code);
        fault.harmless = reasons.harmless.iter().find(about).map(|reason| reason.why.clone());
    }
    Ok(())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Records {
    fault: Vec<Record>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    name: String,
    file: String,
    find: String,
    replace: String,
}

/// The faults of `benches/faults/*.toml`. What is replaced must occur exactly once.
pub(crate) fn planted_by_hand(root: &Path) -> Result<Vec<Fault>, AnyError> {
    let mut paths: Vec<_> =
        std::fs::read_dir(root.join("benches/faults"))?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    paths.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    paths.sort();
    let (mut faults, mut wrong) = (Vec::new(), Vec::new());
    for path in paths {
        let records: Records =
            toml::from_str(&std::fs::read_to_string(&path)?).map_err(|e| format!("{}: {e}", path.display()))?;
        for Record { name, file, find, replace } in records.fault {
            let text = std::fs::read_to_string(root.join(&file)).unwrap_or_default();
            match *text.match_indices(&find).map(|(at, _)| at).collect::<Vec<_>>() {
                [at] => faults.push(Fault::new(Origin::Hand, &file, name, &text, at..at + find.len(), replace)),
                ref places => wrong.push(format!("{name}: `find` occurs {} times in {file}", places.len())),
            }
        }
    }
    if wrong.is_empty() { Ok(faults) } else { Err(wrong.join("\n").into()) }
}

/// What `cargo mutants --list --json` says of one mutant; lines and columns from 1, columns in characters.
#[derive(Deserialize)]
struct Listed {
    name: String,
    file: String,
    span: Span,
    replacement: String,
}

impl Listed {
    /// `FILE:LINE:COLUMN: what`, without the place.
    fn what(&self) -> &str {
        self.name.splitn(4, ':').nth(3).unwrap_or(&self.name).trim()
    }
}

#[derive(Deserialize)]
struct Span {
    start: Position,
    end: Position,
}

#[derive(Deserialize)]
struct Position {
    line: usize,
    column: usize,
}

/// For each seed, `count` of the mutants that `cargo mutants` lists over all crates but the benches; one that is drawn twice is one.
pub(crate) fn mutants(root: &Path, count: usize, seeds: &[u64]) -> Result<Vec<Fault>, AnyError> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let words = ["mutants", "--workspace", "--list", "--json"];
    let done = Command::new("cargo").args(words).current_dir(root).output()?;
    if !done.status.success() {
        return Err(format!("cargo {}: {}", words.join(" "), String::from_utf8_lossy(&done.stderr)).into());
    }
    let mut listed: Vec<Listed> = serde_json::from_slice(&done.stdout)?;
    listed.retain(|mutant| !mutant.file.starts_with("benches/"));
    let mut drawn = BTreeSet::new();
    for &seed in seeds {
        let mut ranks = ranks(&listed, seed);
        ranks.sort_unstable();
        drawn.extend(ranks.into_iter().take(count).map(|(_, index)| index));
    }
    eprintln!("{} of {} mutants", drawn.len(), listed.len());
    let mut texts = BTreeMap::new();
    let mut faults = Vec::new();
    for listed @ Listed { file, span, replacement, .. } in drawn.into_iter().map(|index| &listed[index]) {
        if !texts.contains_key(file) {
            texts.insert(file, std::fs::read_to_string(root.join(file))?);
        }
        let text = &texts[file];
        let place = offset(text, &span.start)..offset(text, &span.end);
        faults.push(Fault::new(Origin::Mutant, file, listed.what().to_owned(), text, place, replacement.clone()));
    }
    explain(root, &mut faults, &texts)?;
    Ok(faults)
}

/// Where each mutant stands in the draw of a seed, and its index. It stays there while its function does: a sample is the same
/// but for what has changed, and so can be compared with that of an earlier commit.
fn ranks(listed: &[Listed], seed: u64) -> Vec<(u64, usize)> {
    let mut same = BTreeMap::<(&str, &str), u64>::new();
    let rank = |mutant: &Listed, nth: u64| {
        let words = [mutant.file.as_bytes(), mutant.what().as_bytes(), &nth.to_le_bytes(), &seed.to_le_bytes()];
        // FNV-1a, mixed: its high bits say little of the last bytes.
        let hash = words
            .concat()
            .iter()
            .fold(0xcbf2_9ce4_8422_2325, |hash: u64, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
        SplitMix64::seed_from_u64(hash).next_u64()
    };
    let numbered = listed.iter().enumerate().map(|(index, mutant)| {
        let nth = same.entry((&mutant.file, mutant.what())).or_default();
        *nth += 1;
        (rank(mutant, *nth), index)
    });
    numbered.collect()
}

/// A place in bytes.
fn offset(text: &str, position: &Position) -> usize {
    let start: usize = text.split_inclusive('\n').take(position.line - 1).map(str::len).sum();
    text[start..].char_indices().nth(position.column - 1).map_or(text.len(), |(at, _)| start + at)
}
