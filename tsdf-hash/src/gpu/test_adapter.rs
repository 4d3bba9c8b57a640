//! An adapter for the tests.

use crate::gpu::device::Device;
use crate::gpu::options::GpuOptions;

/// Options that open some adapter; `None`, and a line that says so, where there is none and none is demanded.
pub(crate) fn options() -> Option<GpuOptions> {
    let options = GpuOptions { software: true, ..GpuOptions::default() };
    match Device::open(&options) {
        Ok(_) => Some(options),
        Err(error) if std::env::var_os("PAINTCOPTER_REQUIRE_GPU").is_none_or(|v| v != "1") => {
            eprintln!("skipped: {error}");
            None
        }
        Err(error) => panic!("PAINTCOPTER_REQUIRE_GPU=1, but {error}"),
    }
}
