//! Unpacks gzip files (RFC 1952 around RFC 1951): data sets come in them.

/// Longest code of the format.
const LONGEST: usize = 15;
/// Shortest lengths and distances of a code, and how many further bits it has.
const LENGTHS: [(usize, u32); 29] = spans::<29>(3, 4, 258);
const DISTANCES: [(usize, u32); 30] = spans::<30>(1, 2, usize::MAX);
/// Order in which the lengths of the codes of code lengths come.
const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

/// From `first` on, `group` codes for each count of further bits (twice as many without any); the last code may stand for one
/// value alone.
const fn spans<const N: usize>(first: usize, group: usize, last: usize) -> [(usize, u32); N] {
    let mut all = [(0, 0); N];
    let (mut at, mut k) = (first, 0);
    while k < N {
        let bits = if k < 2 * group { 0 } else { (k / group - 1) as u32 };
        all[k] = if k + 1 == N && last != usize::MAX { (last, 0) } else { (at, bits) };
        at += 1 << bits;
        k += 1;
    }
    all
}

/// The contents of a gzip file of one member; nothing if it is none, is cut off, or its checksum is wrong.
pub(super) fn unpack(bytes: &[u8]) -> Option<Vec<u8>> {
    let [0x1f, 0x8b, 8, flags, ..] = *bytes else { return None };
    let mut at = 10;
    if flags & 4 != 0 {
        at += 2 + usize::from(*bytes.get(at)?) + 256 * usize::from(*bytes.get(at + 1)?);
    }
    for text in [8, 16] {
        if flags & text != 0 {
            at += 1 + bytes.get(at..)?.iter().position(|&b| b == 0)?;
        }
    }
    at += if flags & 2 != 0 { 2 } else { 0 };
    let mut stream = Bits { bytes, at, held: 0, count: 0 };
    let mut out = Vec::new();
    while !stream.block(&mut out)? {}
    let end = stream.at - (stream.count / 8) as usize;
    let sum = bytes.get(end..end + 4)?;
    (crc(&out).to_le_bytes() == *sum).then_some(out)
}

struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    held: u32,
    count: u32,
}

impl Bits<'_> {
    fn take(&mut self, count: u32) -> Option<usize> {
        while self.count < count {
            self.held |= u32::from(*self.bytes.get(self.at)?) << self.count;
            self.at += 1;
            self.count += 8;
        }
        let value = self.held & ((1 << count) - 1);
        self.held >>= count;
        self.count -= count;
        Some(value as usize)
    }

    /// Unpacks a block; whether it was the last.
    fn block(&mut self, out: &mut Vec<u8>) -> Option<bool> {
        let last = self.take(1)? == 1;
        match self.take(2)? {
            0 => {
                self.take(self.count % 8)?;
                let (length, check) = (self.take(16)?, self.take(16)?);
                (length ^ check == 0xffff).then_some(())?;
                for _ in 0..length {
                    out.push(self.take(8)? as u8);
                }
            }
            1 => {
                let lengths: Vec<usize> = (0..288)
                    .map(|k| 8 + usize::from((144..256).contains(&k)) - usize::from((256..280).contains(&k)))
                    .collect();
                self.codes(&Code::new(&lengths), &Code::new(&[5; 30]), out)?;
            }
            2 => {
                let (literals, distances, count) = (257 + self.take(5)?, 1 + self.take(5)?, 4 + self.take(4)?);
                let mut lengths = [0; 19];
                for &k in &ORDER[..count] {
                    lengths[k] = self.take(3)?;
                }
                let code = Code::new(&lengths);
                let mut all: Vec<usize> = Vec::new();
                while all.len() < literals + distances {
                    let (value, repeat) = match code.read(self)? {
                        16 => (*all.last()?, 3 + self.take(2)?),
                        17 => (0, 3 + self.take(3)?),
                        18 => (0, 11 + self.take(7)?),
                        length => (length, 1),
                    };
                    all.extend(std::iter::repeat_n(value, repeat));
                }
                let (literals, rest) = all.split_at(literals);
                self.codes(&Code::new(literals), &Code::new(rest.get(..distances)?), out)?;
            }
            _ => return None,
        }
        Some(last)
    }

    fn codes(&mut self, literals: &Code, distances: &Code, out: &mut Vec<u8>) -> Option<()> {
        loop {
            match literals.read(self)? {
                byte @ 0..=255 => out.push(byte as u8),
                256 => return Some(()),
                symbol => {
                    let &(length, bits) = LENGTHS.get(symbol - 257)?;
                    let length = length + self.take(bits)?;
                    let &(distance, bits) = DISTANCES.get(distances.read(self)?)?;
                    let from = out.len().checked_sub(distance + self.take(bits)?)?;
                    for k in from..from + length {
                        out.push(out[k]);
                    }
                }
            }
        }
    }
}

/// A canonical Huffman code: how many codes of each length, and the symbols in the order of their codes.
struct Code {
    counts: [usize; LONGEST + 1],
    symbols: Vec<usize>,
}

impl Code {
    fn new(lengths: &[usize]) -> Self {
        let mut counts = [0; LONGEST + 1];
        for &length in lengths {
            counts[length] += 1;
        }
        counts[0] = 0;
        let mut symbols: Vec<usize> = (0..lengths.len()).filter(|&k| lengths[k] > 0).collect();
        symbols.sort_by_key(|&k| lengths[k]);
        Self { counts, symbols }
    }

    fn read(&self, bits: &mut Bits) -> Option<usize> {
        let (mut code, mut first, mut index) = (0, 0, 0);
        for &count in &self.counts[1..] {
            code = 2 * code + bits.take(1)?;
            first *= 2;
            if code < first + count {
                return self.symbols.get(index + code - first).copied();
            }
            index += count;
            first += count;
        }
        None
    }
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |mut sum, &byte| {
        sum ^= u32::from(byte);
        for _ in 0..8 {
            sum = (sum >> 1) ^ (0xEDB8_8320 & (sum & 1).wrapping_neg());
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `printf 'aaaaaaaaaabcabcabcabc\n' | gzip -n9`, by the outside program.
    const PACKED: &[u8] =
        &[31, 139, 8, 0, 0, 0, 0, 0, 2, 3, 75, 76, 132, 129, 164, 100, 56, 226, 2, 0, 156, 138, 135, 106, 22, 0, 0, 0];
    const TEXT: &[u8] = b"aaaaaaaaaabcabcabcabc\n";

    #[test]
    fn unpacks_what_gzip_packed_and_nothing_else() {
        assert_eq!(unpack(PACKED).as_deref(), Some(TEXT));
        for cut in 0..PACKED.len() - 4 {
            assert_eq!(unpack(&PACKED[..cut]), None, "cut at {cut}");
        }
        for bit in 0..8 * (PACKED.len() - 4) {
            let mut bytes = PACKED.to_vec();
            bytes[bit / 8] ^= 1 << (bit % 8);
            // Time and system are not looked at, and a run of one letter may be copied from any of them: never another text.
            assert!(unpack(&bytes).is_none_or(|text| text == TEXT), "bit {bit}");
        }
        // Length codes: 3 to 258; distances: up to 32768 (RFC 1951, 3.2.5).
        assert_eq!((LENGTHS[7], LENGTHS[8], LENGTHS[27], LENGTHS[28]), ((10, 0), (11, 1), (227, 5), (258, 0)));
        assert_eq!((DISTANCES[3], DISTANCES[4], DISTANCES[29]), ((4, 0), (5, 1), (24577, 13)));
    }
}
