//! What a registration is told.

use nalgebra::Vector3;

use crate::error::Error;

/// Settings of [`GlobalRegistration`](super::GlobalRegistration). Ours, from walls with a relief of decimetres and rooms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlobalRegistrationSettings {
    /// Distance of the points by which surface and cloud are compared, metres, `1e-3..=10`; 0.04.
    pub spacing: f64,
    /// Up in the world of the surface; z.
    pub up: Vector3<f64>,
    /// Points of the cloud that are laid onto every point of the surface; 6.
    pub bases: usize,
    /// Places that are refined; 24.
    pub refined: usize,
    /// Least share of the cloud that lies on the surface, within half a spacing; 0.85.
    pub least_share: f64,
    /// A second place is another answer where its remaining error is at most so many times that of the best; 2.
    pub ambiguity: f64,
    /// Slopes, root mean square, that must be seen along every direction to fix a place; 0.05.
    pub least_slope: f64,
}

impl Default for GlobalRegistrationSettings {
    fn default() -> Self {
        Self {
            spacing: 0.04,
            up: Vector3::z(),
            bases: 6,
            refined: 24,
            least_share: 0.85,
            ambiguity: 2.0,
            least_slope: 0.05,
        }
    }
}

impl GlobalRegistrationSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        let refuse = |name, value, requirement| Err(Error::InvalidSetting { name, value, requirement });
        if !(1e-3..=10.0).contains(&self.spacing) {
            return refuse("spacing", self.spacing, "1e-3..=10 metres");
        }
        if !(self.up.norm() - 1.0).abs().lt(&1e-6) {
            return refuse("up", self.up.norm(), "of length 1");
        }
        if self.bases == 0 || self.refined == 0 {
            return refuse("bases", self.bases.min(self.refined) as f64, "at least 1, as `refined`");
        }
        if !(0.0..=1.0).contains(&self.least_share) {
            return refuse("least_share", self.least_share, "0..=1");
        }
        for (name, value) in [("ambiguity", self.ambiguity), ("least_slope", self.least_slope)] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(name, value, "finite and at least 0");
            }
        }
        Ok(())
    }
}
