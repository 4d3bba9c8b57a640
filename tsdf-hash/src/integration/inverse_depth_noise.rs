//! The noise of inverse depth, in the working precision.

use crate::settings::Settings;

/// The noise model of the settings.
#[derive(Clone, Copy)]
pub(crate) struct InverseDepthNoise {
    pub(crate) base: f32,
    quadratic: f32,
    nearest: f32,
}

impl InverseDepthNoise {
    pub(crate) fn new(settings: &Settings) -> Self {
        let n = &settings.noise;
        Self { base: n.base as f32, quadratic: n.quadratic as f32, nearest: n.nearest as f32 }
    }

    /// Standard deviation of the inverse depth, `σ(1/ω) ω²`, 1/m.
    #[inline(always)]
    pub(crate) fn sigma_inverse(&self, omega: f32) -> f32 {
        let beyond = 1.0 - self.nearest * omega;
        self.base * omega * omega + self.quadratic * beyond * beyond
    }
}
