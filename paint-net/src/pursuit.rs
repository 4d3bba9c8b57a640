use crate::deconvolution::{fit, prune};
use crate::error::{Error, require};
use crate::footprints::Footprints;
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Board, Limits, Painter, Painting, Task};
use crate::projected_lbfgs::Stop;
use crate::saturation::Saturation;

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
    pub smallest_gain: f64,
    /// Largest depth added by one placement: the linearisation holds no further. Default 1, ours.
    pub largest_step: f64,
    /// Iterations of the joint refit at the end; 0 for none. Default 200, ours.
    pub refit: usize,
}

impl Default for MatchingPursuit {
    fn default() -> Self {
        Self { placements: 20_000, smallest_gain: 2e-4, largest_step: 1.0, refit: 200 }
    }
}

impl Painter for MatchingPursuit {
    fn name(&self) -> &'static str {
        "pursuit"
    }

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        require("smallest_gain", self.smallest_gain, self.smallest_gain > 0.0, "it must be positive")?;
        require("largest_step", self.largest_step, self.largest_step > 0.0, "it must be positive")?;
        let board = Board::new(task, kernel, saturation, limits)?;
        let mut search = Search::new(task, &board, kernel, saturation, limits);
        let mut visited = 0;
        for placed in 0..self.placements {
            let full = limits.max_sprays.is_some_and(|most| visited >= most);
            let Some(k) = search.best_cell(full) else { break };
            if 0.5 * search.score(k) < self.smallest_gain {
                break;
            }
            visited += usize::from(search.volumes[k] == 0.0);
            search.place(k, self.largest_step);
            if placed % 64 == 0 {
                progress(0.9 * placed as f64 / self.placements as f64);
            }
        }
        let mut volumes = search.volumes;
        let stop = Stop { iterations: self.refit, relative_decrease: 1e-6 };
        if self.refit > 0 {
            let ceiling: Vec<f64> =
                volumes.iter().zip(&board.ceiling).map(|(&v, &top)| if v > 0.0 { top } else { 0.0 }).collect();
            fit(task, &board, saturation, &ceiling, &mut volumes, &stop, &mut |_| ());
        }
        prune(task, &board, saturation, limits, &mut volumes, &stop);
        progress(1.0);
        Ok(board.painting(&volumes, saturation))
    }
}

/// The state of the greedy search: canvas, scores of all cells, and the best cell of each row.
struct Search<'a> {
    task: &'a Task<'a>,
    board: &'a Board,
    saturation: &'a Saturation,
    radius: usize,
    squared: Footprints,
    canvas: Image,
    /// `weight · w · r` and `weight · w²` per pixel.
    pull: Vec<f64>,
    stiffness: Vec<f64>,
    num: Vec<f64>,
    den: Vec<f64>,
    row_best: Vec<Option<usize>>,
    volumes: Vec<f64>,
}

impl<'a> Search<'a> {
    fn new(
        task: &'a Task,
        board: &'a Board,
        kernel: &SprayKernel,
        saturation: &'a Saturation,
        limits: &Limits,
    ) -> Self {
        let cells = board.footprints.cells();
        let pixels = task.reference.data().len();
        let squared = Footprints::new(&kernel.squared(), task.reference.size(), limits.along, limits.row_spacing);
        let mut search = Self {
            task,
            board,
            saturation,
            radius: kernel.radius(),
            squared,
            canvas: board.bare.clone(),
            pull: vec![0.0; pixels],
            stiffness: vec![0.0; pixels],
            num: vec![0.0; cells],
            den: vec![0.0; cells],
            row_best: vec![None; board.footprints.rows.len()],
            volumes: vec![0.0; cells],
        };
        let (width, height) = task.reference.size();
        search.linearise(0, width, 0, height);
        board.footprints.gather(&search.pull, &mut search.num);
        search.squared.gather(&search.stiffness, &mut search.den);
        for row in 0..search.row_best.len() {
            search.rank_row(row, false);
        }
        search
    }

    /// `num²/den`; zero where no spray helps or none is allowed.
    fn score(&self, k: usize) -> f64 {
        let room = self.board.ceiling[k] > self.volumes[k];
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
        let n = self.board.footprints.columns.len();
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
        let n = self.board.footprints.columns.len();
        let (column, row) = (self.board.footprints.columns[k % n], self.board.footprints.rows[k / n]);
        let volume = (self.num[k] / self.den[k]).min(largest).min(self.board.ceiling[k] - self.volumes[k]);
        self.volumes[k] += volume;
        let (width, height) = self.task.reference.size();
        let (x0, x1) = (column.saturating_sub(self.radius), (column + self.radius + 1).min(width));
        let (y0, y1) = (row.saturating_sub(self.radius), (row + self.radius + 1).min(height));
        self.board.footprints.add_one(k, volume, self.canvas.data_mut());
        self.linearise(x0, x1, y0, y1);
        let near = |cells: &[usize], low: usize, high: usize| {
            let first = cells.partition_point(|&c| c + self.radius < low);
            let last = cells.partition_point(|&c| c < high + self.radius);
            first..last
        };
        let columns = near(&self.board.footprints.columns, x0, x1);
        for r in near(&self.board.footprints.rows, y0, y1) {
            self.board.footprints.gather_row(&self.pull, r, columns.clone(), &mut self.num[r * n..(r + 1) * n]);
            self.squared.gather_row(&self.stiffness, r, columns.clone(), &mut self.den[r * n..(r + 1) * n]);
            self.rank_row(r, false);
        }
    }

    fn linearise(&mut self, x0: usize, x1: usize, y0: usize, y1: usize) {
        let width = self.task.reference.width();
        for y in y0..y1 {
            for p in y * width + x0..y * width + x1 {
                let depth = self.canvas.data()[p];
                let (slope, weight) = (self.saturation.derivative(depth), self.task.weight(p));
                self.pull[p] = weight * slope * (self.task.reference.data()[p] - self.saturation.forward(depth));
                self.stiffness[p] = weight * slope * slope;
            }
        }
    }
}
