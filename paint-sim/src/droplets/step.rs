//! One step of spraying: which texels get how many droplets, and whether that does good (handheld paper, Eqs. (6), (7)).

use super::cast::Caster;
use super::directions::Droplets;
use super::sweep::Nozzle;
use super::texel_surface::TexelSurface;
use crate::error::{Error, check_not_negative, check_positive, check_range};
use crate::spray::QUANTUM;

/// How paint leaves the nozzle, and what too much of it costs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct DepositSettings {
    /// Paint per second with the valve open, m^3/s (default 0.5 mm^3/s: an airbrush with a fine needle; none is published).
    pub flow: f64,
    /// Length of a time step, s (default 0.01: the valve is switched at its ends).
    pub step: f64,
    /// Droplets per time step, a multiple of 64 (default 256; the paper's `r`, not published).
    pub droplets: usize,
    /// Punishment of paint above the target, the paper's `P` (default 2; not published).
    pub punishment: f64,
}

impl Default for DepositSettings {
    fn default() -> Self {
        Self { flow: 0.5e-9, step: 0.01, droplets: 256, punishment: 2.0 }
    }
}

impl DepositSettings {
    /// Refuses what cannot be sprayed.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn check(&self) -> Result<(), Error> {
        check_positive("deposit.flow", self.flow)?;
        check_range("deposit.step", self.step, 1e-5, 10.0, "between 0.00001 and 10 s")?;
        check_not_negative("deposit.punishment", self.punishment)
    }

    /// Paint in one droplet of a whole step, femtolitres.
    pub fn droplet(&self) -> u64 {
        (self.flow * self.step / (self.droplets.max(1) as f64 * QUANTUM)).round() as u64
    }
}

/// One time step to be cast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepCast {
    /// The nozzle in the middle of the step.
    pub nozzle: Nozzle,
    /// Which set of droplets, counted from 0.
    pub set: usize,
}

/// Droplets per texel of one time step.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StepHits {
    /// Texel and number of droplets, by ascending texel.
    pub texels: Vec<(u32, u32)>,
    /// Droplets that met no texel.
    pub missed: u32,
}

impl StepHits {
    /// Casts a set of droplets.
    pub fn cast(surface: &TexelSurface, nozzle: &Nozzle, droplets: &Droplets) -> Self {
        Self::cast_with(&mut Caster::default(), surface, nozzle, droplets)
    }

    pub(super) fn cast_with(caster: &mut Caster, surface: &TexelSurface, nozzle: &Nozzle, droplets: &Droplets) -> Self {
        let mut found = Vec::with_capacity(droplets.len());
        caster.cast(surface, nozzle, droplets, |hit| found.push(hit.texel));
        Self::of_texels(found, droplets.len())
    }

    /// From the texels of all droplets of a set of so many that met one.
    pub(super) fn of_texels(mut found: Vec<u32>, droplets: usize) -> Self {
        let missed = (droplets - found.len()) as u32;
        found.sort_unstable();
        let texels = found.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u32)).collect();
        Self { texels, missed }
    }

    /// Score of the step, Eqs. (6) and (7), with `droplet` femtolitres each, on texels that still need `remaining` femtolitres. The sum runs
    /// over texels: over rays, as printed, a texel that is hit k times would count k times.
    pub fn score(&self, droplet: u64, punishment: f64, remaining: impl Fn(u32) -> i64) -> StepOutcome {
        let (mut good, mut harm) = (0_u64, 0_u64);
        for &(texel, count) in &self.texels {
            let paint = u64::from(count) * droplet;
            let used = paint.min(remaining(texel).max(0).unsigned_abs());
            good += used;
            harm += paint - used;
        }
        StepOutcome { score: good as f64 - punishment * harm as f64, paint: good + harm, useful: good }
    }
}

/// What one time step would do.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepOutcome {
    /// Score `S`; the valve opens where it is positive.
    pub score: f64,
    /// Paint that lands on texels, femtolitres.
    pub paint: u64,
    /// The part of it that is wanted where it lands, femtolitres.
    pub useful: u64,
}
