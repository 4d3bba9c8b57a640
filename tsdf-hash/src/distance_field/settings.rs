//! How far the distance field looks.

use crate::error::Error;

/// Settings of a [`DistanceField`](crate::distance_field::DistanceField).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct DistanceSettings {
    /// Surfaces are looked for within this distance, metres, `1e-4..=1e6` (ours: 1).
    pub max_distance: f64,
}

impl Default for DistanceSettings {
    fn default() -> Self {
        Self { max_distance: 1.0 }
    }
}

impl DistanceSettings {
    pub(crate) fn check(self) -> Result<(), Error> {
        if (1e-4..=1e6).contains(&self.max_distance) {
            return Ok(());
        }
        Err(Error::InvalidSetting { name: "max_distance", value: self.max_distance, requirement: "1e-4..=1e6 metres" })
    }
}
