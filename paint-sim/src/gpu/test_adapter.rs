//! An adapter for the tests.

use super::device::Program;
use super::options::GpuOptions;

/// Options that open some adapter; `None`, and a line that says so, where there is none and none is demanded.
pub(crate) fn options() -> Option<GpuOptions> {
    let options = GpuOptions { software: true, ..GpuOptions::default() };
    let source = "@compute @workgroup_size(1) fn nothing() {}";
    match Program::new(&options, source, "nothing") {
        Ok(_) => Some(options),
        Err(error) => {
            assert!(std::env::var_os("PAINTCOPTER_REQUIRE_GPU").is_none_or(|v| v != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}
