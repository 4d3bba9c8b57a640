//! The disk tier: one file of the map's own, written and read at positions, its holes used again.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::coder::MOST_BYTES;

/// Places are whole multiples of this many bytes.
pub(crate) const GRAIN: usize = 128;
/// Sizes of a place, in grains: `1..CLASSES`.
const CLASSES: usize = MOST_BYTES.div_ceil(GRAIN) + 1;
/// End of a list of holes.
const NONE: u32 = u32::MAX;

/// Places of 128 to some 7500 bytes. A hole holds the number of the next hole of its size, so that the lists of holes
/// take no memory. The file is removed with the map.
pub(crate) struct Swap {
    file: Mutex<File>,
    path: PathBuf,
    /// The file's end and the farthest it may grow to, in grains.
    end: u32,
    max: u32,
    /// First hole of each size.
    holes: [u32; CLASSES],
    used: usize,
}

impl Swap {
    pub(crate) fn create(path: &Path, max_bytes: u64) -> io::Result<Self> {
        let file = File::options().read(true).write(true).create(true).truncate(true).open(path)?;
        let max = (max_bytes / GRAIN as u64).min(u64::from(NONE - 1)) as u32;
        Ok(Self { file: Mutex::new(file), path: path.into(), end: 0, max, holes: [NONE; CLASSES], used: 0 })
    }

    /// Length of the file.
    pub(crate) fn bytes(&self) -> u64 {
        u64::from(self.end) * GRAIN as u64
    }

    /// Blocks in it.
    pub(crate) fn used(&self) -> usize {
        self.used
    }

    /// Writes a packed block; `None` if there is no place for it.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> io::Result<Option<u32>> {
        let grains = bytes.len().div_ceil(GRAIN);
        let at = if let Some(at) = self.hole(grains)? {
            at
        } else if grains as u32 <= self.max - self.end {
            self.end += grains as u32;
            self.end - grains as u32
        } else {
            // The smallest larger hole; what is left of it becomes a hole again.
            let mut larger = None;
            for size in grains + 1..CLASSES {
                if let Some(at) = self.hole(size)? {
                    larger = Some((at, size));
                    break;
                }
            }
            let Some((at, size)) = larger else { return Ok(None) };
            self.add_hole(at + grains as u32, size - grains);
            at
        };
        let written = write_at(&mut self.file(), at, bytes);
        if let Err(error) = written {
            self.add_hole(at, grains);
            return Err(error);
        }
        self.used += 1;
        Ok(Some(at))
    }

    pub(crate) fn read(&self, at: u32, out: &mut [u8]) -> io::Result<()> {
        read_at(&mut self.file(), at, out)
    }

    /// Gives a place back.
    pub(crate) fn free(&mut self, at: u32, len: usize) {
        self.add_hole(at, len.div_ceil(GRAIN));
        self.used -= 1;
    }

    /// Takes the first hole of a size from its list.
    fn hole(&mut self, grains: usize) -> io::Result<Option<u32>> {
        let at = self.holes[grains];
        if at == NONE {
            return Ok(None);
        }
        let mut next = [0; 4];
        read_at(&mut self.file(), at, &mut next)?;
        self.holes[grains] = u32::from_le_bytes(next);
        Ok(Some(at))
    }

    fn add_hole(&mut self, at: u32, grains: usize) {
        let written = write_at(&mut self.file(), at, &self.holes[grains].to_le_bytes());
        // A hole that cannot be written is lost, which harms nobody.
        if written.is_ok() {
            self.holes[grains] = at;
        }
    }

    fn file(&self) -> std::sync::MutexGuard<'_, File> {
        self.file.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Swap {
    fn drop(&mut self) {
        // Best effort: nobody is left to be told.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn write_at(file: &mut File, grain: u32, bytes: &[u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(u64::from(grain) * GRAIN as u64))?;
    file.write_all(bytes)
}

fn read_at(file: &mut File, grain: u32, bytes: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(u64::from(grain) * GRAIN as u64))?;
    file.read_exact(bytes)
}
