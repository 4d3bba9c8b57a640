//! Numbers of a few bits each, one after the other.

/// Writes bits, the lowest first.
#[derive(Default)]
pub(crate) struct BitWriter {
    pub(crate) bytes: Vec<u8>,
    pending: u64,
    count: u32,
}

impl BitWriter {
    /// The lowest `bits` of a value, 32 at most.
    pub(crate) fn put(&mut self, value: u32, bits: u32) {
        self.pending |= u64::from(value) << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.count -= 8;
        }
    }

    pub(crate) fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.pending as u8);
        }
        self.bytes
    }
}

/// Reads them again.
pub(crate) struct BitReader<'a> {
    bytes: &'a [u8],
    pending: u64,
    count: u32,
}

impl<'a> BitReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, pending: 0, count: 0 }
    }

    /// The next value of so many bits, 32 at most; `None` at the end.
    pub(crate) fn take(&mut self, bits: u32) -> Option<u32> {
        while self.count < bits {
            let (first, rest) = self.bytes.split_first()?;
            self.bytes = rest;
            self.pending |= u64::from(*first) << self.count;
            self.count += 8;
        }
        let value = (self.pending & ((1_u64 << bits) - 1)) as u32;
        self.pending >>= bits;
        self.count -= bits;
        Some(value)
    }
}
