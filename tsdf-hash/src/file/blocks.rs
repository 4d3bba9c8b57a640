//! The packed blocks of a file, read one by one, and their index.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::sync::{Mutex, PoisonError};

use super::layout::{Numbers, Section};
use crate::error::Error;
use crate::key::Key;
use crate::tiers::{Label, MOST_BYTES};

/// Bytes of an entry of the index.
const ENTRY: usize = 34;

/// Where a block of the file lies, and what is known of it.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) key: Key,
    /// From the start of the file.
    pub(crate) at: u64,
    pub(crate) len: u16,
    pub(crate) label: Label,
}

impl Entry {
    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        let Label { print, last, frames, peaks, stamp: _ } = self.label;
        out.extend_from_slice(&self.key.0.to_le_bytes());
        out.extend_from_slice(&print.to_le_bytes());
        out.extend_from_slice(&last.to_le_bytes());
        out.extend_from_slice(&frames.to_le_bytes());
        for number in [peaks[0], peaks[1], self.len] {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }
}

/// Reads the index: ascending keys, of blocks that fill their section one after the other.
pub(crate) fn read_index(bytes: &[u8], section: Section, blocks: Section) -> Result<Vec<Entry>, Error> {
    let mut numbers = Numbers::new(bytes, section.at, "the index of the blocks");
    let mut entries: Vec<Entry> = Vec::with_capacity(bytes.len() / ENTRY);
    let mut at = blocks.at;
    for _ in 0..bytes.len() / ENTRY {
        let key = Key(numbers.u64()?);
        let (print, last, frames) = (numbers.u64()?, numbers.f64()?, numbers.u32()?);
        let (peaks, len) = ([numbers.u16()?, numbers.u16()?], numbers.u16()?);
        let ascending = entries.last().is_none_or(|before| before.key < key);
        if !ascending || Key::new(key.block()) != Some(key) || usize::from(len) > MOST_BYTES || !last.is_finite() {
            return Err(numbers.bad());
        }
        entries.push(Entry { key, at, len, label: Label { print, last, frames, peaks, stamp: 0 } });
        at += u64::from(len);
    }
    numbers.end()?;
    if at == blocks.at + blocks.length { Ok(entries) } else { Err(numbers.bad()) }
}

/// An open file.
pub(crate) struct BlockFile(Mutex<File>);

impl BlockFile {
    pub(crate) fn new(file: File) -> Self {
        Self(Mutex::new(file))
    }

    pub(crate) fn read(&self, at: u64, out: &mut [u8]) -> Result<(), Error> {
        let mut file = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(out));
        read.map_err(|source| Error::Io { what: "reading the map's file", source })
    }
}
