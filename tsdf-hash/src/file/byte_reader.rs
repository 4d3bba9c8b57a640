//! Little-endian numbers from bytes.

use crate::error::Error;

/// Reads numbers from bytes; an error names what was read and where.
pub(crate) struct ByteReader<'a> {
    bytes: &'a [u8],
    offset: u64,
    what: &'static str,
}

impl<'a> ByteReader<'a> {
    pub(crate) fn new(bytes: &'a [u8], offset: u64, what: &'static str) -> Self {
        Self { bytes, offset, what }
    }

    pub(crate) fn bad(&self) -> Error {
        Error::CorruptFile { what: self.what, offset: self.offset }
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let taken = self.bytes.split_off(..count).ok_or_else(|| self.bad())?;
        self.offset += count as u64;
        Ok(taken)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        self.take(N)?.try_into().map_err(|_| self.bad())
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Error> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Error> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(crate) fn u16(&mut self) -> Result<u16, Error> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(crate) fn f64(&mut self) -> Result<f64, Error> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// Nothing may be left over.
    pub(crate) fn end(&self) -> Result<(), Error> {
        if self.bytes.is_empty() { Ok(()) } else { Err(self.bad()) }
    }
}
