//! The map on a GPU.

mod device;
mod probe;

/// Which adapter to use, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct GpuOptions {
    /// Part of the adapter's name; empty for the best one (discrete before integrated).
    pub adapter: String,
    /// Whether an adapter may be a program on the processor, such as Mesa's lavapipe: slower than [`Map`](crate::Map), and
    /// meant for tests.
    pub software: bool,
    /// The largest single buffer, bytes; the adapter's own limit holds in any case (ours: none).
    pub max_buffer_bytes: usize,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { adapter: String::new(), software: false, max_buffer_bytes: usize::MAX }
    }
}

#[cfg(test)]
mod tests {
    use super::GpuOptions;
    use super::device::Device;

    /// Options that open some adapter; `None`, said aloud, where there is none and none is demanded.
    pub(super) fn options() -> Option<GpuOptions> {
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
}
