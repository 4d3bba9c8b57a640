//! Volumes of sprays for the footprints that they really have.

use super::fitting::ink_cost;
use crate::error::{Error, require};
use crate::image::Image;
use crate::optimise::{StoppingRule, minimise};
use crate::problem::PaintProblem;

/// What a spray leaves: pixels, none of them a ghost, and the depth on each per unit of the spray's volume.
pub type SurfaceFootprint = Vec<(u32, f32)>;

/// A fit of given volumes to the ink, for given footprints:
///
/// ```text
/// ½ Σ w (f(c₀ + S v) - y)² + ½ ρ π σ² Σ (v - v_given)²    subject to  v_min ≤ v ≤ v_max
/// ```
///
/// with footprints as columns of `S` and the limits of the problem. No spray falls below the least volume, so that the valve stays open; one that
/// leaves nothing gets 0. Ours.
#[derive(Debug, Clone, Copy)]
pub struct VolumeFit<'a> {
    /// What is wanted and what is there.
    pub problem: &'a PaintProblem<'a>,
    /// One for each spray.
    pub footprints: &'a [SurfaceFootprint],
    /// `ρ`: weight of the differences from the given volumes against the ink.
    pub proximity: f64,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row.
    pub tolerance: f64,
}

impl VolumeFit<'_> {
    /// Changes `volumes`; the canvas that they give. `progress` is told the share done.
    ///
    /// # Errors
    /// Settings out of range; as many footprints as volumes, on pixels of the picture and with depths of 0 or more, are asked for.
    pub fn solve(&self, volumes: &mut Vec<f64>, progress: &mut dyn FnMut(f64)) -> Result<Image, Error> {
        require("tolerance", self.tolerance, self.tolerance >= 0.0, "it must be 0 or more")?;
        require("proximity", self.proximity, (0.0..=1e6).contains(&self.proximity), "it must lie in [0, 1000000]")?;
        self.check_footprints(volumes.len())?;
        let Self { problem, footprints, .. } = *self;
        // A spray that is wanted stays one that is worth opening the valve for: what is sought is how much more it gets.
        let least: Vec<f64> =
            footprints.iter().map(|f| if f.is_empty() { 0.0 } else { problem.limits.min_volume }).collect();
        let room = problem.limits.max_volume - problem.limits.min_volume;
        let most: Vec<f64> = footprints.iter().map(|f| if f.is_empty() { 0.0 } else { room }).collect();
        let initial = problem.initial_canvas();
        let mut base = initial.data().to_vec();
        deposit(footprints, &least, &mut base);
        let given: Vec<f64> = volumes.iter().zip(&least).map(|(volume, least)| volume - least).collect();
        // In units of what the square of a volume costs on white paper.
        let stiffness = self.proximity * std::f64::consts::PI * problem.kernel.sigma().powi(2);
        let mut canvas = base.clone();
        let mut cost = |more: &[f64], gradient: &mut [f64]| {
            canvas.copy_from_slice(&base);
            deposit(footprints, more, &mut canvas);
            let mut value = ink_cost(problem, problem.saturation, &mut canvas);
            for (k, slot) in gradient.iter_mut().enumerate() {
                let change = more[k] - given[k];
                value += 0.5 * stiffness * change * change;
                let missed = footprints[k].iter().map(|&(pixel, depth)| f64::from(depth) * canvas[pixel as usize]);
                *slot = missed.sum::<f64>() + stiffness * change;
            }
            value
        };
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: self.tolerance };
        volumes.clone_from(&given);
        minimise(volumes, &most, &stop, &mut cost, progress);
        volumes.iter_mut().zip(&least).for_each(|(volume, least)| *volume += least);

        let mut canvas = initial;
        deposit(footprints, volumes, canvas.data_mut());
        if let Some(ghosts) = problem.ghosts {
            ghosts.gather(canvas.data_mut());
        }
        Ok(canvas)
    }

    fn check_footprints(&self, sprays: usize) -> Result<(), Error> {
        if self.footprints.len() != sprays {
            let (found, expected) = ((self.footprints.len(), 1), (sprays, 1));
            return Err(Error::Mismatch { what: "list of footprints", found, expected });
        }
        let (width, pixels) = (self.problem.reference.width(), self.problem.reference.data().len());
        for &(k, depth) in self.footprints.iter().flatten() {
            if k as usize >= pixels || !(depth >= 0.0 && depth.is_finite()) {
                let (x, y) = (k as usize % width, k as usize / width);
                let range = "pixels of the picture and a depth of 0 or more";
                return Err(Error::Pixel { what: "footprint", x, y, value: f64::from(depth), range });
            }
        }
        Ok(())
    }
}

/// `canvas += S v`.
fn deposit(footprints: &[SurfaceFootprint], volumes: &[f64], canvas: &mut [f64]) {
    for (footprint, &volume) in footprints.iter().zip(volumes).filter(|(_, volume)| **volume > 0.0) {
        for &(k, depth) in footprint {
            canvas[k as usize] += volume * f64::from(depth);
        }
    }
}
