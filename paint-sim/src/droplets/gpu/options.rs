//! Which GPU to use.

/// Which adapter may be used.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GpuOptions {
    /// Part of the adapter's name; empty for the best one (discrete before integrated).
    pub adapter: String,
    /// Whether an adapter may be a program on the processor, such as Mesa's lavapipe: meant for tests.
    pub software: bool,
}
