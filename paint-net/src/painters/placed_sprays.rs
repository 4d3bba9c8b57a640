//! Sprays at given places: along lines, and on the cells of the grid that are left.

use super::fitting::ink_cost;
use crate::model::{Spray, SprayKernel};
use crate::optimise::{StoppingRule, minimise};
use crate::problem::{PaintGrid, PaintProblem};

/// Sprays whose places are given and whose volumes are sought: those along the lines first, then cells of the grid.
pub(super) struct PlacedSprays {
    footprints: Vec<Footprint>,
    /// How many lie along each line.
    along: Vec<usize>,
    width: usize,
}

/// Where a spray of unit volume lies and what it adds: the outer product of two profiles.
struct Footprint {
    spray: Spray,
    allowed: bool,
    corner: [usize; 2],
    across: Vec<f64>,
    down: Vec<f64>,
}

impl Footprint {
    fn new(kernel: &SprayKernel, spray: Spray, (width, height): (usize, usize), allowed: bool) -> Self {
        let Spray { x, y, sigma, .. } = spray;
        let (left, across) = kernel.profile(x, sigma, width);
        let (top, down) = kernel.profile(y, sigma, height);
        Self { spray: Spray { volume: 1.0, ..spray }, allowed, corner: [left, top], across, down }
    }
}

/// What a nozzle may spray on, and whether anybody asks for paint there.
fn may(problem: &PaintProblem, [x, y]: [f64; 2]) -> bool {
    let (width, height) = problem.reference.size();
    let nearest = |at: f64, extent: usize| (at.round().max(0.0) as usize).min(extent - 1);
    let pixel = nearest(y, height) * width + nearest(x, width);
    problem.paintable.is_none_or(|mask| mask[pixel]) && problem.weight(pixel) > 0.0
}

impl PlacedSprays {
    /// Sprays at the places along lines, and on the cells of the grid where `rest` says so.
    pub(super) fn new(problem: &PaintProblem, grid: &PaintGrid, lines: &[Vec<[f64; 2]>], rest: &[bool]) -> Self {
        let (width, size, sigma) = (problem.reference.width(), problem.reference.size(), problem.kernel.sigma());
        let footprint = |[x, y]: [f64; 2], allowed: bool| {
            Footprint::new(problem.kernel, Spray { x, y, volume: 1.0, sigma }, size, allowed)
        };
        let mut footprints: Vec<Footprint> =
            lines.iter().flatten().map(|&at| footprint(at, may(problem, at))).collect();
        for (cell, &upper) in grid.upper_bounds.iter().enumerate() {
            let spray = grid.spray(cell, 1.0);
            let at = [spray.x, spray.y];
            if upper > 0.0 && rest[spray.y as usize * width + spray.x as usize] {
                footprints.push(footprint(at, true));
            }
        }
        Self { footprints, along: lines.iter().map(Vec::len).collect(), width }
    }

    /// Sprays of any spread along strokes.
    pub(super) fn along(problem: &PaintProblem, strokes: &[Vec<Spray>]) -> Self {
        let (width, size) = (problem.reference.width(), problem.reference.size());
        let footprint = |spray: &Spray| Footprint::new(problem.kernel, *spray, size, may(problem, [spray.x, spray.y]));
        let footprints = strokes.iter().flatten().map(footprint).collect();
        Self { footprints, along: strokes.iter().map(Vec::len).collect(), width }
    }

    /// Fits the volumes under their upper bounds so that the ink comes as near the reference as it can, with `smoothness` as the weight of
    /// differences between neighbours on a line; the canvas that they give.
    pub(super) fn fit(
        &self,
        problem: &PaintProblem,
        smoothness: f64,
        upper_bounds: &[f64],
        volumes: &mut Vec<f64>,
        stop: &StoppingRule,
        progress: &mut dyn FnMut(f64),
    ) -> Vec<f64> {
        // In units of what the square of a volume costs on white paper.
        let stiffness = smoothness * std::f64::consts::PI * problem.kernel.sigma().powi(2);
        let initial = problem.initial_canvas();
        let show = |v: &[f64], canvas: &mut [f64]| {
            canvas.copy_from_slice(initial.data());
            self.deposit(v, canvas);
            problem.settle(initial.data(), canvas);
        };
        let mut canvas = initial.data().to_vec();
        let mut cost = |v: &[f64], gradient: &mut [f64]| {
            show(v, &mut canvas);
            let value = ink_cost(problem, problem.saturation, &mut canvas);
            problem.settle_adjoint(&mut canvas);
            self.adjoint(&canvas, gradient);
            value + self.roughness(v, stiffness, gradient)
        };
        minimise(volumes, upper_bounds, stop, &mut cost, progress);
        show(volumes, &mut canvas);
        canvas
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.footprints.len()
    }

    /// Volumes with as many of 0 after those of the lines: for the sprays of more lines.
    pub(super) fn with_more(&self, volumes: &[f64], count: usize) -> Vec<f64> {
        let (along, rest) = volumes.split_at(self.along.iter().sum());
        along.iter().copied().chain(std::iter::repeat_n(0.0, count)).chain(rest.iter().copied()).collect()
    }

    /// Largest volume of every spray; 0 where the nozzle may not spray.
    pub(super) fn upper_bounds(&self, most: f64) -> Vec<f64> {
        self.footprints.iter().map(|f| if f.allowed { most } else { 0.0 }).collect()
    }

    /// Adds all sprays to a canvas.
    pub(super) fn deposit(&self, volumes: &[f64], canvas: &mut [f64]) {
        for (f, &volume) in self.footprints.iter().zip(volumes).filter(|(_, volume)| **volume > 0.0) {
            for (y, down) in (f.corner[1]..).zip(&f.down) {
                let row = &mut canvas[y * self.width + f.corner[0]..][..f.across.len()];
                let share = volume * down;
                row.iter_mut().zip(&f.across).for_each(|(depth, across)| *depth += share * across);
            }
        }
    }

    /// Sums a field over every footprint.
    pub(super) fn adjoint(&self, field: &[f64], sums: &mut [f64]) {
        for (f, sum) in self.footprints.iter().zip(sums) {
            *sum = 0.0;
            for (y, down) in (f.corner[1]..).zip(&f.down) {
                let row = &field[y * self.width + f.corner[0]..][..f.across.len()];
                *sum += down * row.iter().zip(&f.across).map(|(v, across)| v * across).sum::<f64>();
            }
        }
    }

    /// `½ stiffness Σ (v_k - v_k+1)²` over neighbours on a line; its derivative is added to `gradient`.
    pub(super) fn roughness(&self, volumes: &[f64], stiffness: f64, gradient: &mut [f64]) -> f64 {
        let (mut first, mut sum) = (0, 0.0);
        for &count in &self.along {
            for k in first + 1..first + count {
                let rise = volumes[k] - volumes[k - 1];
                sum += 0.5 * stiffness * rise * rise;
                gradient[k] += stiffness * rise;
                gradient[k - 1] -= stiffness * rise;
            }
            first += count;
        }
        sum
    }

    /// The sprays that are left: those along lines, a line cut at long gaps, and those on the grid.
    pub(super) fn sprays(&self, volumes: &[f64], max_gap: f64) -> (Vec<Vec<Spray>>, Vec<Spray>) {
        let all: Vec<Spray> =
            self.footprints.iter().zip(volumes).map(|(f, &volume)| Spray { volume, ..f.spray }).collect();
        let mut rest = all.as_slice();
        let mut strokes = Vec::new();
        for &count in &self.along {
            let (line, after) = rest.split_at(count);
            let line: Vec<Spray> = line.iter().copied().filter(|spray| spray.volume > 0.0).collect();
            let runs = line.chunk_by(|a, b| (a.x - b.x).hypot(a.y - b.y) <= max_gap);
            strokes.extend(runs.map(<[Spray]>::to_vec));
            rest = after;
        }
        (strokes, rest.iter().copied().filter(|spray| spray.volume > 0.0).collect())
    }
}
