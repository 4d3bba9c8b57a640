//! The checksum of a map's file: XXH3-64 with seed 0.

use std::hash::Hasher;

use twox_hash::XxHash3_64;

/// Of bytes that come in pieces.
#[derive(Clone)]
pub(crate) struct Checksum(XxHash3_64);

impl Checksum {
    pub(crate) fn new() -> Self {
        Self(XxHash3_64::new())
    }

    pub(crate) fn of(bytes: &[u8]) -> u64 {
        XxHash3_64::oneshot(bytes)
    }

    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    pub(crate) fn value(&self) -> u64 {
        self.0.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::Checksum;

    /// From the reference implementation (python-xxhash).
    #[test]
    fn is_xxh3_of_64_bits_however_it_is_fed() {
        assert_eq!([Checksum::of(b""), Checksum::of(b"abc")], [0x2d06_8005_38d3_94c2, 0x78af_5f94_892f_3950]);
        let bytes: Vec<u8> = (0..2000).map(|k| (k * 37 % 256) as u8).collect();
        let whole = Checksum::of(&bytes);
        assert_eq!(whole, 0x43e5_46a5_0649_33e5);
        for size in [1, 7, 64, 255, 1024] {
            let mut sum = Checksum::new();
            bytes.chunks(size).for_each(|piece| sum.add(piece));
            assert_eq!(sum.value(), whole);
        }
    }
}
