//! The finaliser of splitmix64, for hash tables and fingerprints.

/// A bijection of the 64-bit words that spreads every bit (Steele, Lea, Flood 2014).
pub(crate) const fn mix64(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
