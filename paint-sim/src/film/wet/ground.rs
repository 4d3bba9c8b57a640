//! What the paint lies on, as a sponge.

use crate::error::{Error, check_not_negative};

/// How the ground soaks up solvent; the pigment stays outside. The default is sealed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Ground {
    /// Sorptivity, m/s^½: a ground that is kept wet soaks up `sorptivity * sqrt(t)` (Washburn 1921; Hall 1989). Bricks and sandstones have
    /// 1e-5 to 3e-4.
    pub sorptivity: f64,
    /// Most that it holds, m³ per m².
    pub capacity: f64,
}

impl Ground {
    /// What a ground holds, m, that held `soaked` and is offered enough for `seconds`.
    pub fn soaked_after(&self, soaked: f64, seconds: f64) -> f64 {
        (soaked * soaked + self.sorptivity * self.sorptivity * seconds).sqrt().min(self.capacity).max(soaked)
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        check_not_negative("ground.sorptivity", self.sorptivity)?;
        check_not_negative("ground.capacity", self.capacity)
    }
}
