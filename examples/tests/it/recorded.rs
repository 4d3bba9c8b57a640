//! Data that others have recorded, which not every machine has.

use std::path::PathBuf;

/// A folder or file below `PAINTCOPTER_DATA`; `None`, said on stderr, where it is absent. With `PAINTCOPTER_REQUIRE_DATA=1` its
/// absence is a failure.
pub(crate) fn recorded(name: &str) -> Option<PathBuf> {
    let found = std::env::var_os("PAINTCOPTER_DATA").map(|root| PathBuf::from(root).join(name)).filter(|p| p.exists());
    if found.is_none() {
        let required = std::env::var_os("PAINTCOPTER_REQUIRE_DATA").is_some_and(|value| value == "1");
        assert!(!required, "{name} is absent: set PAINTCOPTER_DATA to the folder with the recordings");
        eprintln!("SKIPPED: {name} is absent: set PAINTCOPTER_DATA to the folder with the recordings");
    }
    found
}
