//! The compressed blocks of an opened map file, read one by one.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::sync::{Mutex, PoisonError};

use crate::blocks::block_key::BlockKey;
use crate::error::Error;
use crate::storage::summary::BlockSummary;

/// A block of a map file, as its index has it.
#[derive(Clone, Copy)]
pub(crate) struct StoredBlock {
    pub(crate) key: BlockKey,
    /// Bytes from the start of the file.
    pub(crate) at: u64,
    pub(crate) len: u16,
    /// Time of the last frame that updated it, seconds, and the number of frames that did.
    pub(crate) last_update: f64,
    pub(crate) frames: u32,
    pub(crate) summary: BlockSummary,
}

/// An open file, never written to.
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
