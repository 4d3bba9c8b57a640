//! Which GPU to use.

/// Which adapter may be used, and how.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GpuOptions {
    /// Part of the adapter's name; empty for the best one (discrete before integrated).
    pub adapter: String,
    /// Whether an adapter may be a program on the processor, such as Mesa's lavapipe: meant for tests.
    pub software: bool,
    /// The largest single buffer, bytes; the adapter's own limit holds in any case (ours: none). Larger work is done in parts.
    pub max_buffer_bytes: u64,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { adapter: String::new(), software: false, max_buffer_bytes: u64::MAX }
    }
}
