//! The swap file: compressed blocks on disk, in a file of the map's own whose free space is used again.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::codec::MAX_BYTES;

/// Blocks take whole multiples of this many bytes.
const UNIT: usize = 128;
/// Size classes, in units: `1..CLASSES`.
const CLASSES: usize = MAX_BYTES.div_ceil(UNIT) + 1;
/// End of a free list.
const NONE: u32 = u32::MAX;

/// Ranges of 128 to some 7500 bytes. A free range holds the number of the next one of its size, so that the free lists take
/// no memory. The file is removed with the map.
pub(crate) struct SwapFile {
    file: Mutex<File>,
    path: PathBuf,
    /// The file's end and the farthest it may grow to, in units.
    end: u32,
    max: u32,
    /// First free range of each size.
    free: [u32; CLASSES],
    blocks: usize,
}

impl SwapFile {
    pub(crate) fn create(path: &Path, max_bytes: u64) -> io::Result<Self> {
        let file = File::options().read(true).write(true).create(true).truncate(true).open(path)?;
        let max = (max_bytes / UNIT as u64).min(u64::from(NONE - 1)) as u32;
        Ok(Self { file: Mutex::new(file), path: path.into(), end: 0, max, free: [NONE; CLASSES], blocks: 0 })
    }

    /// Length of the file.
    pub(crate) fn bytes(&self) -> u64 {
        u64::from(self.end) * UNIT as u64
    }

    /// Blocks in it.
    pub(crate) fn blocks(&self) -> usize {
        self.blocks
    }

    /// Writes a compressed block; `None` if there is no room for it.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> io::Result<Option<u32>> {
        let units = bytes.len().div_ceil(UNIT);
        let at = if let Some(at) = self.pop_free(units)? {
            at
        } else if units as u32 <= self.max - self.end {
            self.end += units as u32;
            self.end - units as u32
        } else {
            // The smallest larger range that is free; what is left of it is free again.
            let mut larger = None;
            for size in units + 1..CLASSES {
                if let Some(at) = self.pop_free(size)? {
                    larger = Some((at, size));
                    break;
                }
            }
            let Some((at, size)) = larger else { return Ok(None) };
            self.push_free(at + units as u32, size - units);
            at
        };
        let written = write_at(&mut self.file(), at, bytes);
        if let Err(error) = written {
            self.push_free(at, units);
            return Err(error);
        }
        self.blocks += 1;
        Ok(Some(at))
    }

    pub(crate) fn read(&self, at: u32, out: &mut [u8]) -> io::Result<()> {
        read_at(&mut self.file(), at, out)
    }

    /// Gives a range back.
    pub(crate) fn release(&mut self, at: u32, len: usize) {
        self.push_free(at, len.div_ceil(UNIT));
        self.blocks -= 1;
    }

    /// Takes the first free range of a size from its list.
    fn pop_free(&mut self, units: usize) -> io::Result<Option<u32>> {
        let at = self.free[units];
        if at == NONE {
            return Ok(None);
        }
        let mut next = [0; 4];
        read_at(&mut self.file(), at, &mut next)?;
        self.free[units] = u32::from_le_bytes(next);
        Ok(Some(at))
    }

    fn push_free(&mut self, at: u32, units: usize) {
        let written = write_at(&mut self.file(), at, &self.free[units].to_le_bytes());
        // A range that cannot be written is lost until the file goes, which does no harm.
        if written.is_ok() {
            self.free[units] = at;
        }
    }

    fn file(&self) -> std::sync::MutexGuard<'_, File> {
        self.file.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for SwapFile {
    fn drop(&mut self) {
        // Best effort: an error could not be returned.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn write_at(file: &mut File, unit: u32, bytes: &[u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(u64::from(unit) * UNIT as u64))?;
    file.write_all(bytes)
}

fn read_at(file: &mut File, unit: u32, bytes: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(u64::from(unit) * UNIT as u64))?;
    file.read_exact(bytes)
}
