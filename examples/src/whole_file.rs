//! Files that are whole or not there: written beside under the name `NAME.part`, and renamed.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::run_folder;

/// Files of this process that are not whole yet: a signal may end it at any time.
static PARTS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Writes a file.
///
/// # Errors
/// What the system says; then the file is as it was before.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> io::Result<()> {
    let mut file = WholeFile::create(path)?;
    file.write_all(bytes.as_ref())?;
    file.commit()
}

/// Removes what is not whole: the process ends. While the guard lives no file begins or gets its name.
pub(crate) fn remove_parts() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    let parts = parts();
    for part in parts.iter() {
        let _ = std::fs::remove_file(part);
    }
    parts
}

fn parts() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file under way. Dropped before [`WholeFile::commit`], it leaves nothing.
pub struct WholeFile {
    out: BufWriter<File>,
    path: PathBuf,
    part: PathBuf,
    committed: bool,
    /// What cannot be made again: its part stays, whatever happens.
    kept: bool,
}

impl WholeFile {
    /// Begins a file beside its name.
    ///
    /// # Errors
    /// What the system says.
    pub fn create(path: &Path) -> io::Result<Self> {
        // No signal comes between the file and its name in the list.
        let mut parts = parts();
        let file = Self::begin(path, false)?;
        parts.insert(file.part.clone());
        Ok(file)
    }

    /// The same for what cannot be made again, such as a session: as much of it as was flushed stays as `NAME.part`, whatever happens.
    ///
    /// # Errors
    /// What the system says.
    pub fn create_kept(path: &Path) -> io::Result<Self> {
        Self::begin(path, true)
    }

    fn begin(path: &Path, kept: bool) -> io::Result<Self> {
        // A link stays one; a terminal, a pipe or a device is written to as it is.
        let path = path.canonicalize().unwrap_or_else(|_| path.into());
        let special = std::fs::metadata(&path).is_ok_and(|found| !found.is_file() && !found.is_dir());
        let part = if special { path.clone() } else { part_of(&path) };
        Ok(Self { out: BufWriter::new(File::create(&part)?), path, part, committed: special, kept })
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// What the system says.
    pub fn commit(mut self) -> io::Result<()> {
        self.out.flush()?;
        if !self.committed {
            let _parts = parts();
            std::fs::rename(&self.part, &self.path)?;
            self.committed = true;
            run_folder::note(&self.path);
        }
        Ok(())
    }
}

/// The name of a file while it is not whole.
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".part");
    path.with_file_name(name)
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        let mut parts = parts();
        if !self.committed && !self.kept {
            let _ = std::fs::remove_file(&self.part);
        }
        parts.remove(&self.part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_its_name_when_it_is_whole_and_not_before() {
        let folder = std::env::temp_dir().join(format!("paintcopter-whole-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("map.ply");
        std::fs::write(&path, "earlier").unwrap();
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"later").unwrap();
        file.flush().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"earlier");
        assert_eq!(std::fs::read(part_of(&path)).unwrap(), b"later");
        drop(file);
        assert!(!part_of(&path).exists() && std::fs::read(&path).unwrap() == b"earlier");
        write(&path, "whole").unwrap();
        assert!(!part_of(&path).exists() && std::fs::read(&path).unwrap() == b"whole");

        let mut session = WholeFile::create_kept(&path).unwrap();
        session.write_all(b"half").unwrap();
        session.flush().unwrap();
        drop(session);
        assert_eq!(std::fs::read(part_of(&path)).unwrap(), b"half");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let folder = std::env::temp_dir().join(format!("paintcopter-links-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (file, link) = (folder.join("file"), folder.join("link"));
        std::fs::write(&file, "").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, "through").unwrap();
        assert!(link.is_symlink() && std::fs::read(&file).unwrap() == b"through");
        write(Path::new("/dev/null"), "gone").unwrap();
        assert!(!Path::new("/dev/null").is_file());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
