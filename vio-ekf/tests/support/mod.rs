//! Recorded trajectories for tests. They may not be redistributed, so they are looked for and may be absent.

use std::path::PathBuf;
use std::process::Command;

/// Text of a gzipped file below `PAINTCOPTER_DATA` (default: `../shared/data` beside the workspace); `None` if absent.
pub fn recorded(path: &str) -> Option<String> {
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
