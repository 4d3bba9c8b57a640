//! Sprays at given places: along lines, and on the cells of the grid that are left.

use crate::model::{Spray, SprayKernel};
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
    fn new(kernel: &SprayKernel, [x, y]: [f64; 2], (width, height): (usize, usize), allowed: bool) -> Self {
        let sigma = kernel.sigma();
        let (left, across) = kernel.profile(x, sigma, width);
        let (top, down) = kernel.profile(y, sigma, height);
        Self { spray: Spray { x, y, volume: 1.0, sigma }, allowed, corner: [left, top], across, down }
    }
}

impl PlacedSprays {
    /// Sprays at the places along lines, and on the cells of the grid where `rest` says so.
    pub(super) fn new(problem: &PaintProblem, grid: &PaintGrid, lines: &[Vec<[f64; 2]>], rest: &[bool]) -> Self {
        let (width, size) = (problem.reference.width(), problem.reference.size());
        let pixel = |[x, y]: [f64; 2]| y.round() as usize * width + x.round() as usize;
        let may =
            |at: [f64; 2]| problem.paintable.is_none_or(|mask| mask[pixel(at)]) && problem.weight(pixel(at)) > 0.0;
        let footprint = |at: [f64; 2], allowed: bool| Footprint::new(problem.kernel, at, size, allowed);
        let mut footprints: Vec<Footprint> = lines.iter().flatten().map(|&at| footprint(at, may(at))).collect();
        for (cell, &upper) in grid.upper_bounds.iter().enumerate() {
            let spray = grid.spray(cell, 1.0);
            let at = [spray.x, spray.y];
            if upper > 0.0 && rest[pixel(at)] {
                footprints.push(footprint(at, true));
            }
        }
        Self { footprints, along: lines.iter().map(Vec::len).collect(), width }
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
