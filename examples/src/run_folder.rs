//! A folder holds the results of one run. Each program notes in `.NAME.files` what it has written; what an earlier run of it has left and
//! this one does not write again is moved to `earlier/`, the reports at once, the rest in the end, since it may be read until then.
//!
//! Files are written all over a program and its end may be a signal, so the folders of a process are known to all of it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::say;

/// Where files of an earlier run go.
const EARLIER: &str = "earlier";
/// They say that a run is complete.
const REPORTS: [&str; 2] = ["report.json", "report.md"];

static FOLDERS: Mutex<BTreeMap<PathBuf, RunFolder>> = Mutex::new(BTreeMap::new());

#[derive(Default)]
struct RunFolder {
    program: String,
    /// Files of an earlier run, relative to the folder, and those of this one.
    earlier: BTreeSet<String>,
    written: BTreeSet<String>,
}

/// Makes the folder of a program's results, and knows what an earlier run has left in it.
///
/// # Errors
/// What the system says.
pub fn begin(folder: &Path, program: &str) -> io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let folder = folder.canonicalize()?;
    let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
    if folders.contains_key(&folder) {
        return Ok(());
    }
    let listed = std::fs::read_to_string(list_of(&folder, program)).unwrap_or_default();
    let own = |name: &&str| Path::new(name).components().all(|part| matches!(part, std::path::Component::Normal(_)));
    let earlier = listed.lines().filter(|name| !name.is_empty()).filter(own).map(str::to_string).collect();
    let run = RunFolder { program: program.into(), earlier, written: BTreeSet::new() };
    folders.insert(folder, run);
    Ok(())
}

/// A file is written.
pub(crate) fn note(path: &Path) {
    let path = path.canonicalize().unwrap_or_else(|_| path.into());
    let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
    let Some((folder, run)) = folders.iter_mut().rev().find(|(folder, _)| path.starts_with(folder)) else { return };
    let Some(name) = path.strip_prefix(folder).ok().and_then(Path::to_str) else { return };
    if run.written.is_empty() {
        let reports = run.earlier.iter().filter(|name| Path::new(name).file_name().is_some_and(is_report));
        let reports: Vec<String> = reports.filter(|report| report.as_str() != name).cloned().collect();
        run.retire(folder, &reports);
    }
    if run.written.insert(name.to_string()) {
        // A folder in which this fails has refused the file before as well.
        let list = OpenOptions::new().create(true).append(true).open(list_of(folder, &run.program));
        let _ = list.and_then(|mut list| writeln!(list, "{name}"));
    }
}

/// Files with this ending that were written so far.
pub(crate) fn written(ending: &str) -> Vec<PathBuf> {
    let folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
    let all = folders.iter().flat_map(|(folder, run)| run.written.iter().map(|name| folder.join(name)));
    all.filter(|path| path.extension().is_some_and(|own| own == ending)).collect()
}

/// The runs of this process are over: what they have not written again goes. Their reports.
pub(crate) fn end() -> Vec<PathBuf> {
    let folders = std::mem::take(&mut *FOLDERS.lock().unwrap_or_else(PoisonError::into_inner));
    let end = |(folder, run): (PathBuf, RunFolder)| {
        let reported = run.written.contains(REPORTS[0]);
        run.end(&folder);
        reported.then(|| folder.join(REPORTS[0]))
    };
    folders.into_iter().filter_map(end).collect()
}

impl RunFolder {
    fn end(mut self, folder: &Path) {
        // What has written nothing has left everything as it was.
        if self.written.is_empty() {
            return;
        }
        let stale: Vec<String> = self.earlier.difference(&self.written).cloned().collect();
        let moved = self.retire(folder, &stale);
        if moved > 0 {
            say!("{moved} files of an earlier run are in {}", folder.join(EARLIER).display());
        }
        let text: String = self.written.iter().flat_map(|name| [name, "\n"]).collect();
        let _ = std::fs::write(list_of(folder, &self.program), text);
    }

    /// Moves files of the earlier run away; how many.
    fn retire(&mut self, folder: &Path, names: &[String]) -> usize {
        let mut moved = 0;
        for name in names {
            self.earlier.remove(name);
            let (from, to) = (folder.join(name), folder.join(EARLIER).join(name));
            let parent = to.parent().map_or(Ok(()), std::fs::create_dir_all);
            moved += usize::from(from.is_file() && parent.and_then(|()| std::fs::rename(&from, &to)).is_ok());
        }
        moved
    }
}

fn list_of(folder: &Path, program: &str) -> PathBuf {
    folder.join(format!(".{program}.files"))
}

fn is_report(name: &std::ffi::OsStr) -> bool {
    REPORTS.iter().any(|report| name == *report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whole_file::write;

    fn end(folder: &Path) {
        let folder = folder.canonicalize().unwrap();
        let run = FOLDERS.lock().unwrap().remove(&folder).unwrap();
        run.end(&folder);
    }

    #[test]
    fn what_an_earlier_run_left_is_moved_and_what_is_not_ours_stays() {
        let folder = std::env::temp_dir().join(format!("paintcopter-run-{}", std::process::id()));
        let file = |name: &str| folder.join(name);
        begin(&folder, "fly").unwrap();
        std::fs::create_dir_all(file("white")).unwrap();
        for name in ["map.png", "white/film.png", "mission.toml", "report.json"] {
            write(&file(name), "first").unwrap();
        }
        std::fs::write(file("notes.txt"), "mine").unwrap();
        end(&folder);
        assert!(!file(EARLIER).exists());

        // A run that writes nothing, and one of another program, change nothing.
        begin(&folder, "fly").unwrap();
        end(&folder);
        begin(&folder, "scan").unwrap();
        write(&file("mesh.ply"), "scanned").unwrap();
        end(&folder);
        assert!(file("report.json").exists() && !file(EARLIER).exists());

        begin(&folder, "fly").unwrap();
        write(&file("mission.toml"), "second").unwrap();
        // Until its end what may be read is there; nothing says that the folder is complete.
        assert!(file("map.png").exists() && !file("report.json").exists());
        write(&file("preview.png"), "second").unwrap();
        end(&folder);
        for (name, text) in
            [("mission.toml", "second"), ("preview.png", "second"), ("notes.txt", "mine"), ("mesh.ply", "scanned")]
        {
            assert_eq!(std::fs::read_to_string(file(name)).unwrap(), text, "{name}");
        }
        for name in ["map.png", "white/film.png", "report.json"] {
            assert!(!file(name).exists(), "{name}");
            assert_eq!(std::fs::read_to_string(file(EARLIER).join(name)).unwrap(), "first");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_list_cannot_name_what_lies_outside() {
        let folder = std::env::temp_dir().join(format!("paintcopter-list-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("run")).unwrap();
        std::fs::write(folder.join("outside"), "").unwrap();
        std::fs::write(list_of(&folder.join("run"), "fly"), "../outside\n/etc/hostname\n\ninside\n").unwrap();
        begin(&folder.join("run"), "fly").unwrap();
        write(&folder.join("run/new"), "").unwrap();
        end(&folder.join("run"));
        assert!(folder.join("outside").exists() && Path::new("/etc/hostname").exists());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
