//! Public recordings. They may not be redistributed: `PAINTCOPTER_DATA` names the folder that has them, and without it the
//! tests that need them say that they are skipped. With `PAINTCOPTER_REQUIRE_DATA=1` a missing one is a failure.

use std::path::PathBuf;
use std::process::Command;

/// A file or folder of the recordings; `None`, and a line that says so, where it is missing and not demanded.
pub(crate) fn path(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("PAINTCOPTER_DATA").map(PathBuf::from);
    let found = root.map(|root| root.join(name)).filter(|path| path.exists());
    if found.is_none() {
        let demanded = std::env::var_os("PAINTCOPTER_REQUIRE_DATA").is_some_and(|value| value == "1");
        assert!(!demanded, "PAINTCOPTER_REQUIRE_DATA=1, but there is no {name} under PAINTCOPTER_DATA");
        eprintln!("SKIPPED: no {name} under PAINTCOPTER_DATA");
    }
    found
}

/// Text of a gzipped file.
pub(crate) fn text(name: &str) -> Option<String> {
    let file = path(name)?;
    let output = Command::new("gzip").arg("-dc").arg(&file).output().unwrap();
    assert!(output.status.success(), "gzip -dc {} failed", file.display());
    Some(String::from_utf8(output.stdout).unwrap())
}
