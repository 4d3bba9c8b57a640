//! A checksum of 64 bits.

use crate::hashing::mix64;

/// Each word of eight bytes enters a chain of bijections: whatever changes in one word changes the result.
#[derive(Clone, Default)]
pub(crate) struct Checksum {
    state: u64,
    /// Bytes of a word that is not full yet, and how many bytes there were in all.
    word: [u8; 8],
    length: u64,
}

impl Checksum {
    pub(crate) fn of(bytes: &[u8]) -> u64 {
        let mut sum = Self::default();
        sum.add(bytes);
        sum.value()
    }

    pub(crate) fn add(&mut self, mut bytes: &[u8]) {
        let begun = (self.length % 8) as usize;
        self.length += bytes.len() as u64;
        if begun > 0 {
            let (first, rest) = bytes.split_at(bytes.len().min(8 - begun));
            self.word[begun..begun + first.len()].copy_from_slice(first);
            if begun + first.len() < 8 {
                return;
            }
            self.enter(self.word);
            bytes = rest;
        }
        let (words, rest) = bytes.as_chunks::<8>();
        for &word in words {
            self.enter(word);
        }
        self.word[..rest.len()].copy_from_slice(rest);
    }

    fn enter(&mut self, word: [u8; 8]) {
        self.state = mix64(self.state ^ u64::from_le_bytes(word)).wrapping_add(1);
    }

    pub(crate) fn value(&self) -> u64 {
        let mut last = self.clone();
        let begun = (self.length % 8) as usize;
        last.word[begun..].fill(0);
        last.enter(last.word);
        mix64(last.state ^ self.length)
    }
}

#[cfg(test)]
mod tests {
    use super::Checksum;

    #[test]
    fn pieces_do_not_matter_and_every_bit_does() {
        let bytes: Vec<u8> = (0..99).map(|k| (k * 37 % 256) as u8).collect();
        let whole = Checksum::of(&bytes);
        for size in 1..40 {
            let mut sum = Checksum::default();
            bytes.chunks(size).for_each(|piece| sum.add(piece));
            assert_eq!(sum.value(), whole);
        }
        for bit in 0..8 * bytes.len() {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_ne!(Checksum::of(&flipped), whole);
        }
        for length in 0..bytes.len() {
            assert_ne!(Checksum::of(&bytes[..length]), whole);
        }
        assert_ne!(Checksum::of(&[0; 3]), Checksum::of(&[0; 4]));
    }
}
