//! One spray that is free to move, and its bounds.

use crate::model::Spray;

/// A spray in single precision, in the units of the rasteriser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FreeSpray {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) volume: f32,
    pub(super) sigma: f32,
}

impl FreeSpray {
    /// In the caller's units, `unit` of depth being 1 here. `max_volume` holds exactly, which rounding to single precision
    /// does not see to.
    pub(super) fn spray(&self, unit: f64, max_volume: f64) -> Spray {
        let volume = (f64::from(self.volume) * unit).min(max_volume);
        Spray { x: self.x.into(), y: self.y.into(), volume, sigma: self.sigma.into() }
    }
}

/// What a spray may be, in the units of the rasteriser.
pub(super) struct SprayBounds {
    pub(super) min_sigma: f32,
    pub(super) max_sigma: f32,
    pub(super) max_volume: f32,
}

impl SprayBounds {
    pub(super) fn clamp_sigma(&self, sigma: f32) -> f32 {
        sigma.clamp(self.min_sigma, self.max_sigma)
    }
}
