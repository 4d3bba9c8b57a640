//! The packed blocks of a file, read one by one.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::sync::{Mutex, PoisonError};

use crate::error::Error;
use crate::key::Key;
use crate::tiers::Label;

/// Where a block of the file lies, and what is known of it.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) key: Key,
    /// From the start of the file.
    pub(crate) at: u64,
    pub(crate) len: u16,
    pub(crate) label: Label,
}

/// An open file.
pub(crate) struct BlockFile(pub(crate) Mutex<File>);

impl BlockFile {
    pub(crate) fn read(&self, at: u64, out: &mut [u8]) -> Result<(), Error> {
        let mut file = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(out));
        read.map_err(|source| Error::Io { what: "reading the map's file", source })
    }
}
