//! Recorded trajectories for tests. They may not be redistributed, so they are looked for and may be absent.

#![allow(dead_code, reason = "every test file uses its own part of this")]
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

pub(crate) mod abuse;
pub(crate) mod flight;
pub(crate) mod imus;
pub(crate) mod sequences;
pub(crate) mod tracker;

use std::path::PathBuf;
use std::process::Command;

use vio_ekf::nalgebra::Vector3;

/// Text of a gzipped file below `PAINTCOPTER_DATA` (default: `../shared/data` beside the workspace); `None` if absent.
pub(crate) fn recorded(path: &str) -> Option<String> {
    let root = std::env::var_os("PAINTCOPTER_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let file = root.join(path);
    if !file.exists() {
        eprintln!("SKIPPED: {} is absent; set PAINTCOPTER_DATA to the folder with the recordings", file.display());
        return None;
    }
    let output = Command::new("gzip").arg("-dc").arg(&file).output().unwrap();
    assert!(output.status.success(), "gzip -dc {} failed", file.display());
    Some(String::from_utf8(output.stdout).unwrap())
}

/// splitmix64 (Steele, Lea, Flood 2014): all the randomness these tests need.
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `[-1, 1)`.
    pub(crate) fn signed(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Three of [`signed`](Self::signed).
    pub(crate) fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.signed())
    }
}
