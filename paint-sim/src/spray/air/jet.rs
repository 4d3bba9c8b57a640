//! The air that a spray drags along.

use super::AIR_DENSITY;

/// A spray as a turbulent jet whose momentum `M` is shared with all the air that it has drawn in (Morton, Taylor and Turner 1956: one speed
/// over each cross-section; for sprays: Cossali 2001). At the depth `z` its speed is
///
/// ```text
/// u(z) = sqrt(M / pi rho) / (2 t z),   at most the nozzle's
/// ```
///
/// where `t` is the slope of one deviation: that is the mean over a Gaussian profile as wide as the spray. Of its mass at `z`, all but `u(z)`
/// over the nozzle's speed was drawn in, with whatever speed across it had: that share of a cross-wind acts inside. Where it meets the wall, it
/// turns along it within its own radius: there its speed towards the wall falls in proportion to the distance (stagnation flow).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// Speed times depth beyond the core, m²/s.
    strength: f64,
    /// Speed at the nozzle, m/s.
    speed: f64,
    /// Distance to the wall, m.
    pub(super) stand_off: f64,
    /// Radius at the wall, at most the stand-off, m.
    pub(super) radius: f64,
}

impl Jet {
    /// Of a momentum per second (N), a speed at the nozzle (m/s) and the slope of one deviation, towards a wall `stand_off` metres away.
    pub fn new(momentum: f64, speed: f64, slope: f64, stand_off: f64) -> Self {
        let strength = (momentum / (std::f64::consts::PI * AIR_DENSITY)).sqrt() / (2.0 * slope);
        Self { strength, speed, stand_off, radius: (2.0 * slope * stand_off).min(stand_off) }
    }

    /// Speed along the axis at a depth, m/s, as if there were no wall.
    pub fn speed(&self, depth: f64) -> f64 {
        // Speed at most that of the nozzle; no division by a depth of zero.
        if self.strength >= self.speed * depth { self.speed } else { self.strength / depth }
    }

    /// Share of the air at a depth that came from the surroundings.
    pub fn drawn_in(&self, depth: f64) -> f64 {
        if self.strength > 0.0 { 1.0 - self.speed(depth) / self.speed } else { 1.0 }
    }

    /// Share of the speed towards the wall that is left at a depth.
    pub(super) fn left(&self, depth: f64) -> f64 {
        ((self.stand_off - depth) / self.radius).clamp(0.0, 1.0)
    }
}
