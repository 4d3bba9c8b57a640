//! Iteration and gate of an update.

use crate::error::Error;
use crate::error::{all_positive, invalid};

/// Iteration and gate of an update.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct UpdateSettings {
    /// The gate: largest squared Mahalanobis distance of a landmark's residual; 9.21, 99 % of chi-square with 2 degrees of freedom.
    pub max_mahalanobis: f64,
    /// Iterations of one update at most; 20 as in ROVIO.
    pub max_iterations: usize,
    /// A landmark that fails this many times in a row is dropped; ours.
    pub max_consecutive_failures: u32,
}

impl Default for UpdateSettings {
    fn default() -> Self {
        Self { max_mahalanobis: 9.21, max_iterations: 20, max_consecutive_failures: 5 }
    }
}

impl UpdateSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.max_iterations == 0 {
            return Err(invalid("max_iterations", 0.0, "must be at least 1"));
        }
        all_positive(&[("max_mahalanobis", self.max_mahalanobis)])
    }
}
