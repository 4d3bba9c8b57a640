//! Samples for the feedback network: a procedural image with a nozzle, a grid and flaws of its own.

use crate::network::{FootprintOperator, Response, TileProblem};
use crate::procedural::{lattice, scene, value_noise};

/// A picture to train on, with its nozzle and grid.
pub(super) struct Sample {
    pub(super) problem: TileProblem<f32>,
    seed: u64,
    /// Noise of the volumes between passes, relative.
    noise: f32,
}

impl Sample {
    pub(super) fn new(seed: u64, side: usize, index: u64) -> Self {
        let seed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(index);
        let draw = |k: i64| lattice(seed, k, -11);
        // Mostly the thesis' nozzle: σ of one cell, cut at two.
        let (stride, sigma, cut) = if draw(0) < 0.65 {
            ((2, 2), 2.0, 2.0)
        } else {
            let stride = (2 + (draw(1) * 1.5) as usize, 2 + (draw(8) * 2.5) as usize);
            let cells = 0.55 * 3.6_f64.powf(draw(2));
            (stride, cells * ((stride.0 * stride.1) as f64).sqrt(), 2.0 + 2.0 * draw(3))
        };
        let radius = (cut * sigma) as i64;
        let taps: Vec<f64> = (-radius..=radius).map(|d| (-((d * d) as f64) / (2.0 * sigma * sigma)).exp()).collect();
        let first = ((stride.0 - 1) / 2, (stride.1 - 1) / 2);
        let cells = ((side - first.0).div_ceil(stride.0), (side - first.1).div_ceil(stride.1));
        let mut problem =
            TileProblem::new(cells, (side, side), FootprintOperator::new(&taps, stride, first), Response::Tanh);
        let picture = scene(seed, side, side);
        // A third has been painted on before.
        let painted = if draw(4) < 0.33 { 0.9 * draw(5) } else { 0.0 };
        for y in 0..side {
            for x in 0..side {
                let k = problem.pixels.at(x, y);
                let ink = picture.at(x, y);
                problem.wanted[k] = ink as f32;
                if painted > 0.0 {
                    let share = painted * (0.6 + 0.8 * value_noise(seed, x as f64 / 5.0, y as f64 / 5.0));
                    problem.before[k] = (share * ink.atanh()) as f32;
                }
                problem.weight[k] = 1.0;
            }
        }
        let mass: f64 = taps.iter().sum::<f64>().powi(2) / (stride.0 * stride.1) as f64;
        problem.upper_bounds.fill((3.0 * mass) as f32);
        if draw(9) < 0.15 {
            mask(&mut problem, seed);
        }
        let noise = if draw(6) < 0.2 { 0.2 * draw(7) as f32 } else { 0.0 };
        Self { problem, seed, noise }
    }

    /// What the valve does wrong between two passes: every volume is off by its own factor.
    pub(super) fn perturb(&self, pass: usize, paint: &mut [f32]) {
        if self.noise > 0.0 {
            for (k, v) in paint.iter_mut().enumerate() {
                *v *= 1.0 + self.noise * (2.0 * lattice(self.seed, k as i64, pass as i64) - 1.0) as f32;
            }
        }
    }
}

/// Puts part of the picture out of sight and of reach, with a ragged border between.
fn mask(problem: &mut TileProblem<f32>, seed: u64) {
    let (along, down) = problem.footprint.stride();
    let outside = |x: usize, y: usize| value_noise(seed ^ 9, x as f64 / 20.0, y as f64 / 20.0) > 0.6;
    for y in 0..problem.pixels.height {
        for x in 0..problem.pixels.width {
            if outside(x, y) {
                let k = problem.pixels.at(x, y);
                problem.weight[k] = 0.02;
            }
        }
    }
    for y in 0..problem.cells.height {
        for x in 0..problem.cells.width {
            if outside(x * along, y * down) {
                let k = problem.cells.at(x, y);
                problem.upper_bounds[k] = 0.0;
            }
        }
    }
}
