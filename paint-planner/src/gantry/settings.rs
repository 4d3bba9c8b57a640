//! Numbers of the gantry planner.

use crate::error::{Error, ensure};

/// Lattice, horizon and flux of the gantry planner. `Default` is the handheld paper's setting: 7 decisions of 0.1 s, 3 directions.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GantrySettings {
    /// Time between decisions, s (0.1, Section VI-B).
    pub interval: f64,
    /// Decisions that are looked ahead (7, Table I).
    pub horizon: usize,
    /// Speeds to choose from at each decision, an odd number: evenly spread from full speed down to full speed up (3, Table I).
    pub directions: usize,
    /// Most steps that the speed may change by at a decision (default 2: with 3 directions each may follow each, as in the paper's 3^7
    /// paths).
    pub speed_change: usize,
    /// Fastest movement along the gantry, m/s (default 0.05; none is published).
    pub max_speed: f64,
    /// Length of the slide, m (default 0.1).
    pub travel: f64,
    /// Samples along each movement (32, Section IV-C).
    pub samples: usize,
    /// Distance of the density's samples along the gantry, m, and in time, s (default 1.25 mm, 25 ms).
    pub density_spacing: [f64; 2],
    /// What the nozzle sprays per unit speed, `flow / w` or `flow / A` in Eq. (3); divided by the nozzle's speed it is compared with the
    /// density. Physically `flow` in m^3/s over the width `w` of the footprint at unit distance.
    pub flux_speed: f64,
    /// Least share of the flux that the density must take for a movement to score (default 0.7: a punishment of 2 shuts the valve at two
    /// thirds; 1 in Eq. (4)).
    pub least_use: f64,
    /// Whether the need of a ray is cut at the flux of the nozzle (default true; Eq. (1) does not).
    pub saturate: bool,
}

impl Default for GantrySettings {
    fn default() -> Self {
        Self {
            interval: 0.1,
            horizon: 7,
            directions: 3,
            speed_change: 2,
            max_speed: 0.05,
            travel: 0.1,
            samples: 32,
            density_spacing: [1.25e-3, 0.025],
            flux_speed: 2.4e-8,
            least_use: 0.7,
            saturate: true,
        }
    }
}

impl GantrySettings {
    /// Refuses values outside their ranges.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn check(&self) -> Result<(), Error> {
        let positive = "finite and greater than 0";
        for (name, value) in [
            ("gantry.interval", self.interval),
            ("gantry.max_speed", self.max_speed),
            ("gantry.travel", self.travel),
            ("gantry.density_spacing[0]", self.density_spacing[0]),
            ("gantry.density_spacing[1]", self.density_spacing[1]),
            ("gantry.flux_speed", self.flux_speed),
            ("gantry.least_use", self.least_use),
        ] {
            ensure(name, value, value.is_finite() && value > 0.0, positive)?;
        }
        for (name, value, most) in [
            ("gantry.horizon", self.horizon, 1000),
            ("gantry.samples", self.samples, 10_000),
            ("gantry.speed_change", self.speed_change, 1000),
        ] {
            ensure(name, value as f64, (1..=most).contains(&value), "at least 1 and not absurdly many")?;
        }
        let odd = self.directions % 2 == 1 && (3..=99).contains(&self.directions);
        ensure("gantry.directions", self.directions as f64, odd, "an odd number from 3 to 99")?;
        let samples = (self.travel / self.density_spacing[0]) * (self.duration() / self.density_spacing[1]);
        ensure("gantry.density_spacing", samples, samples <= 1e7, "coarser: that many samples are too many")
    }

    /// With the flux of a nozzle that sprays `flow` (m^3/s) in a Gaussian of the half angle `sigma` (rad), on a robot whose valve shuts where
    /// the paint above the target, times `punishment`, outweighs the rest. `paper_literal` takes Eqs. (1), (3) and (4) as they are printed.
    #[must_use]
    pub fn with_spray(self, flow: f64, sigma: f64, punishment: f64, paper_literal: bool) -> Self {
        let spread = sigma.tan();
        // Width, or area, over which a Gaussian of this spread is even for its own droplets: one over the integral of its square.
        let width = 2.0 * std::f64::consts::PI.sqrt() * spread;
        let area = 4.0 * std::f64::consts::PI * spread * spread;
        Self {
            flux_speed: flow / if paper_literal { area } else { width },
            // Handheld paper, Eq. (4), scores where all of the flux is needed. Where the punishment shuts the valve nothing is gained.
            least_use: if paper_literal { 1.0 } else { punishment / (1.0 + punishment) },
            saturate: self.saturate && !paper_literal,
            ..self
        }
    }

    /// Fastest movement in steps of speed.
    pub(super) fn fastest(&self) -> i32 {
        (self.directions / 2) as i32
    }

    /// Distance of the lattice's positions, m: the slowest movement in one interval.
    pub(super) fn cell(&self) -> f64 {
        self.max_speed * self.interval / f64::from(self.fastest())
    }

    /// Length of the horizon, s.
    pub(super) fn duration(&self) -> f64 {
        self.interval * self.horizon as f64
    }
}
