//! Settings of a ray cast.

use crate::error::Error;

/// Settings of [`Map::ray_cast`](crate::Map::ray_cast).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct RayCastSettings {
    /// Surfaces nearer than this along the optical axis are not seen, metres (ours: 0.1).
    pub min_depth: f64,
    /// Surfaces farther than this are not seen, metres (ours: 6, as [`Settings::max_depth`](crate::Settings)).
    pub max_depth: f64,
    /// Whether colours are wanted; without them the cast is a little faster.
    pub colour: bool,
    /// Threads used inside one call; 1 spawns none. Results do not depend on it.
    pub threads: usize,
}

impl Default for RayCastSettings {
    fn default() -> Self {
        Self { min_depth: 0.1, max_depth: 6.0, colour: true, threads: 1 }
    }
}

impl RayCastSettings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let within = |name, value: f64, lo: f64, hi: f64, requirement| {
            // A comparison that a NaN fails.
            if value >= lo && value <= hi { Ok(()) } else { Err(Error::InvalidSetting { name, value, requirement }) }
        };
        within("min_depth", self.min_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth - self.min_depth, 1e-6, 1e3, "larger than min_depth")?;
        within("threads", self.threads as f64, 1.0, 1024.0, "1..=1024")
    }
}
