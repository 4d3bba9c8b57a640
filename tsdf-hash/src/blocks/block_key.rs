//! Block coordinates packed into one 64-bit word.

use crate::hashing::mix64;

/// Half the range of a coordinate: blocks `-2^20..2^20`, at 1 cm voxels ±84 km.
const BIAS: i32 = 1 << 20;
const BITS: u32 = 21;

/// Block coordinates, packed so that the order of the words is the order of `(x, y, z)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct BlockKey(pub(crate) u64);

impl BlockKey {
    /// `None` beyond the range.
    pub(crate) fn new(block: [i32; 3]) -> Option<Self> {
        let mut word = 0;
        for c in block {
            if !(-BIAS..BIAS).contains(&c) {
                return None;
            }
            word = word << BITS | u64::from((c + BIAS).unsigned_abs());
        }
        Some(Self(word))
    }

    pub(crate) fn block(self) -> [i32; 3] {
        let field = |k: u32| ((self.0 >> (BITS * k)) & ((1 << BITS) - 1)) as i32 - BIAS;
        [field(2), field(1), field(0)]
    }

    pub(crate) fn neighbour(self, step: [i32; 3]) -> Option<Self> {
        let b = self.block();
        Self::new([b[0] + step[0], b[1] + step[1], b[2] + step[2]])
    }

    /// Spread over all bits, for the hash table.
    pub(crate) fn hashed(self) -> u64 {
        mix64(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::BlockKey;

    #[test]
    fn packs_any_sign_and_keeps_the_order() {
        let corners = [-(1 << 20), -1, 0, 1, 7, (1 << 20) - 1];
        let mut all = Vec::new();
        for x in corners {
            for y in corners {
                for z in corners {
                    let key = BlockKey::new([x, y, z]).unwrap();
                    assert_eq!(key.block(), [x, y, z]);
                    all.push(key);
                }
            }
        }
        assert!(all.is_sorted() && all.windows(2).all(|w| w[0] != w[1]));
        assert!(BlockKey::new([1 << 20, 0, 0]).is_none() && BlockKey::new([0, -(1 << 20) - 1, 0]).is_none());
    }
}
