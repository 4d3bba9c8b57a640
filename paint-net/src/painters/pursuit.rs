//! Greedy matching pursuit on the grid.

use super::fitting::{fit, prune};
use crate::error::{Error, require};
use crate::image::Image;
use crate::model::FootprintMatrix;
use crate::optimise::StoppingRule;
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::problem::{PaintGrid, PaintProblem};

/// Greedy matching pursuit: one spray at a time, each the one that lowers the error most, then a joint refit of the cells
/// visited.
///
/// With the ink linearised at the present canvas, `w = f'(c)` and `r = y - f(c)`, a spray of volume `v` at a cell changes
/// the cost by `-v num + v² den / 2`, `num = G(w r)`, `den = G²(w²)` (pixel weights included); the best cell maximises
/// `num²/den`, the best volume is `num/den`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct MatchingPursuit {
    /// Largest number of placements; cells may be visited again. Default 20 000, ours.
    pub placements: usize,
    /// Stop when the best spray would lower `½ Σ w (f - y)²` by less than this. Default 2e-4, ours: a fifth of a grey level
    /// over one footprint.
    pub min_gain: f64,
    /// Largest depth added by one placement: the linearisation holds no further. Default 1, ours.
    pub max_step: f64,
    /// Iterations of the joint refit at the end; 0 for none. Default 200, ours.
    pub refit: usize,
}

impl Default for MatchingPursuit {
    fn default() -> Self {
        Self { placements: 20_000, min_gain: 2e-4, max_step: 1.0, refit: 200 }
    }
}

impl Painter for MatchingPursuit {
    fn name(&self) -> &'static str {
        "pursuit"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        require("min_gain", self.min_gain, self.min_gain > 0.0, "it must be positive")?;
        require("max_step", self.max_step, self.max_step > 0.0, "it must be positive")?;
        let grid = PaintGrid::new(problem)?;
        let mut search = Search::new(problem, &grid);
        let mut visited = 0;
        for placed in 0..self.placements {
            let full = problem.limits.max_sprays.is_some_and(|most| visited >= most);
            let Some(k) = search.best_cell(full) else { break };
            if 0.5 * search.score(k) < self.min_gain {
                break;
            }
            visited += usize::from(search.volumes[k] == 0.0);
            search.place(k, self.max_step);
            if placed % 64 == 0 {
                observer.progress(0.9 * placed as f64 / self.placements as f64);
            }
        }
        let mut volumes = search.volumes;
        let stop = StoppingRule { iterations: self.refit, relative_decrease: 1e-6 };
        if self.refit > 0 {
            let visited_only = |(&v, &upper): (&f64, &f64)| if v > 0.0 { upper } else { 0.0 };
            let upper_bounds: Vec<f64> = volumes.iter().zip(&grid.upper_bounds).map(visited_only).collect();
            fit(problem, &grid, &upper_bounds, &mut volumes, &stop, &mut |_| ());
        }
        prune(problem, &grid, &mut volumes, &stop);
        observer.progress(1.0);
        Ok(Painting::new(grid.sprays(&volumes), grid.canvas(problem, &volumes), problem.saturation))
    }
}

/// The state of the greedy search: canvas, scores of all cells, and the best cell of each row.
struct Search<'a> {
    problem: &'a PaintProblem<'a>,
    grid: &'a PaintGrid,
    radius: usize,
    squared: FootprintMatrix,
    canvas: Image,
    /// Per pixel `weight · w · r`, the gradient by depth (downhill), and `weight · w²`, its Gauss-Newton curvature.
    gradient: Vec<f64>,
    curvature: Vec<f64>,
    num: Vec<f64>,
    den: Vec<f64>,
    row_best: Vec<Option<usize>>,
    volumes: Vec<f64>,
}

impl<'a> Search<'a> {
    fn new(problem: &'a PaintProblem<'a>, grid: &'a PaintGrid) -> Self {
        let (kernel, limits, size) = (problem.kernel, problem.limits, problem.reference.size());
        let cells = grid.footprints.cells();
        let pixels = problem.reference.data().len();
        let mut search = Self {
            problem,
            grid,
            radius: kernel.radius(),
            squared: FootprintMatrix::new(&kernel.squared(), size, limits.spray_spacing, limits.row_spacing),
            canvas: grid.initial.clone(),
            gradient: vec![0.0; pixels],
            curvature: vec![0.0; pixels],
            num: vec![0.0; cells],
            den: vec![0.0; cells],
            row_best: vec![None; grid.footprints.rows.len()],
            volumes: vec![0.0; cells],
        };
        search.linearise(0, size.0, 0, size.1);
        grid.footprints.adjoint(&search.gradient, &mut search.num);
        search.squared.adjoint(&search.curvature, &mut search.den);
        for row in 0..search.row_best.len() {
            search.rank_row(row, false);
        }
        search
    }

    /// `num²/den`; zero where no spray helps or none is allowed.
    fn score(&self, k: usize) -> f64 {
        let room = self.grid.upper_bounds[k] > self.volumes[k];
        if room && self.num[k] > 0.0 && self.den[k] > 0.0 { self.num[k] * self.num[k] / self.den[k] } else { 0.0 }
    }

    /// The cell with the highest score, the first of equals; among visited cells only if `revisit`.
    fn best_cell(&mut self, revisit: bool) -> Option<usize> {
        if revisit {
            for row in 0..self.row_best.len() {
                self.rank_row(row, true);
            }
        }
        let better = |best: Option<usize>, k: usize| match best {
            Some(b) if self.score(b) >= self.score(k) => Some(b),
            _ => Some(k),
        };
        self.row_best.iter().flatten().copied().fold(None, better).filter(|&k| self.score(k) > 0.0)
    }

    fn rank_row(&mut self, row: usize, visited_only: bool) {
        let n = self.grid.footprints.columns.len();
        let mut best: Option<usize> = None;
        for k in row * n..(row + 1) * n {
            if visited_only && self.volumes[k] == 0.0 {
                continue;
            }
            if best.is_none_or(|b| self.score(k) > self.score(b)) {
                best = Some(k);
            }
        }
        self.row_best[row] = best;
    }

    /// Sprays the best volume at cell `k` and updates what it touches: pixels within one radius, cells within two.
    fn place(&mut self, k: usize, largest: f64) {
        let n = self.grid.footprints.columns.len();
        let (column, row) = (self.grid.footprints.columns[k % n], self.grid.footprints.rows[k / n]);
        let volume = (self.num[k] / self.den[k]).min(largest).min(self.grid.upper_bounds[k] - self.volumes[k]);
        self.volumes[k] += volume;
        let (width, height) = self.problem.reference.size();
        let (x0, x1) = (column.saturating_sub(self.radius), (column + self.radius + 1).min(width));
        let (y0, y1) = (row.saturating_sub(self.radius), (row + self.radius + 1).min(height));
        self.grid.footprints.deposit_one(k, volume, self.canvas.data_mut());
        self.linearise(x0, x1, y0, y1);
        let near = |cells: &[usize], low: usize, high: usize| {
            let first = cells.partition_point(|&c| c + self.radius < low);
            let last = cells.partition_point(|&c| c < high + self.radius);
            first..last
        };
        let columns = near(&self.grid.footprints.columns, x0, x1);
        for r in near(&self.grid.footprints.rows, y0, y1) {
            self.grid.footprints.adjoint_row(&self.gradient, r, columns.clone(), &mut self.num[r * n..(r + 1) * n]);
            self.squared.adjoint_row(&self.curvature, r, columns.clone(), &mut self.den[r * n..(r + 1) * n]);
            self.rank_row(r, false);
        }
    }

    fn linearise(&mut self, x0: usize, x1: usize, y0: usize, y1: usize) {
        let width = self.problem.reference.width();
        for y in y0..y1 {
            for p in y * width + x0..y * width + x1 {
                let depth = self.canvas.data()[p];
                let (ink, slope) = self.problem.saturation.forward_and_derivative(depth);
                let weight = self.problem.weight(p);
                self.gradient[p] = weight * slope * (self.problem.reference.data()[p] - ink);
                self.curvature[p] = weight * slope * slope;
            }
        }
    }
}
