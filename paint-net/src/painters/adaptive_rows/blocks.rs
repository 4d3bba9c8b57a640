//! Blocks of the picture, each with its kind of rows.

use super::trials::{Direction, Trial};
use crate::model::{Spray, cells};
use crate::problem::PaintProblem;

/// Rows of the limits in a block, at least.
const ROWS: usize = 12;
/// How often every block may change its kind.
const SWEEPS: usize = 6;

/// A kind of rows, as far as the way along it goes.
#[derive(Clone, Copy)]
struct Kind {
    direction: Direction,
    spacing: f64,
}

/// What ways are compared with.
#[derive(Clone, Copy)]
pub(super) struct Prices {
    /// Structural similarity that a block may lose to save all of the way over it with rows of the limits.
    pub(super) tolerance: f64,
    /// Way that the turn at the end of a row costs, pixels.
    pub(super) turn: f64,
}

/// The picture in squares.
pub(super) struct Blocks {
    columns: usize,
    rows: usize,
    /// Pixels of a side: a multiple of all distances of rows, so that rows go on from block to block.
    side: usize,
    kinds: Vec<Kind>,
    /// Structural similarity that each kind loses, block by block.
    losses: Vec<Vec<f64>>,
    /// The kind that was chosen; none where nothing counts.
    chosen: Vec<Option<usize>>,
}

impl Blocks {
    pub(super) fn new(problem: &PaintProblem, trials: &[Trial], prices: Prices) -> Self {
        let (width, height) = problem.reference.size();
        let multiple = trials.iter().map(|trial| trial.spacing).fold(1, least_common_multiple).min(width.max(height));
        let side = multiple * (ROWS * trials[0].spacing).div_ceil(multiple);
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        let block = |pixel: usize| pixel / width / side * columns + pixel % width / side;
        let mut chosen = vec![None; columns * rows];
        (0..width * height).filter(|&k| problem.weight(k) > 0.0).for_each(|k| chosen[block(k)] = Some(0));
        let mean = |(kind, trial): (usize, &Trial)| {
            let mut sums = vec![(0.0, 0.0); chosen.len()];
            for &(pixel, lost) in &trial.lost {
                let (sum, count) = &mut sums[block(pixel as usize)];
                (*sum, *count) = (*sum + f64::from(lost), *count + 1.0);
            }
            // Too little for a window is painted as usual.
            let unknown = if kind == 0 { 0.0 } else { 1.0 };
            sums.iter().map(|(sum, count)| if *count > 0.0 { sum / count } else { unknown }).collect()
        };
        let losses = trials.iter().enumerate().map(mean).collect();
        let kind = |trial: &Trial| Kind { direction: trial.direction, spacing: trial.spacing as f64 };
        let mut blocks = Self { columns, rows, side, kinds: trials.iter().map(kind).collect(), losses, chosen };
        blocks.choose(prices);
        blocks
    }

    /// Gives each block a kind so that way and loss become small together: from each kind all over, block by block to a better one until none is
    /// (iterated conditional modes, Besag 1986); the best of these.
    fn choose(&mut self, prices: Prices) {
        let counts: Vec<usize> = (0..self.chosen.len()).filter(|&block| self.chosen[block].is_some()).collect();
        let mut best: Option<(f64, Vec<Option<usize>>)> = None;
        for first in 0..self.kinds.len() {
            for &block in &counts {
                self.chosen[block] = Some(first);
            }
            self.improve(&counts, prices);
            let cost = counts.iter().map(|&block| self.whole_cost(block, prices)).sum();
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, self.chosen.clone()));
            }
        }
        self.chosen = best.map(|(_, chosen)| chosen).unwrap_or_default();
    }

    fn improve(&mut self, counts: &[usize], prices: Prices) {
        for _ in 0..SWEEPS {
            let mut changed = false;
            for &block in counts {
                let cost = |kind: usize| self.cost(block, kind, prices);
                let best = (0..self.kinds.len()).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
                changed |= best != self.chosen[block];
                self.chosen[block] = best;
            }
            if !changed {
                break;
            }
        }
    }

    /// Way of the rows of a block as it is, with half a turn for each end of a row, and its loss.
    fn whole_cost(&self, block: usize, prices: Prices) -> f64 {
        let Some(kind) = self.chosen[block] else { return 0.0 };
        let beside = |(direction, neighbour): (Direction, Option<usize>)| {
            self.ends(kind, neighbour.and_then(|block| self.chosen[block]), direction, prices.turn)
        };
        self.own(block, kind, prices) + self.neighbours(block).map(beside).iter().sum::<f64>()
    }

    /// Way of the rows of a block, and what its loss counts.
    fn own(&self, block: usize, kind: usize, prices: Prices) -> f64 {
        let [usual, own] = [0, kind].map(|kind| (self.side * self.side) as f64 / self.kinds[kind].spacing);
        own + usual * self.losses[kind][block] / prices.tolerance
    }

    /// Turns at the border of a block to one of another kind, or to none, half of each.
    fn ends(&self, kind: usize, beside: Option<usize>, border: Direction, turn: f64) -> f64 {
        let Kind { direction, spacing } = self.kinds[kind];
        if direction == border && beside != Some(kind) { self.side as f64 / spacing * 0.5 * turn } else { 0.0 }
    }

    /// What a kind in a block costs: its rows, their ends, those of its neighbours that end at it, and its loss.
    fn cost(&self, block: usize, kind: usize, prices: Prices) -> f64 {
        let mut cost = self.own(block, kind, prices);
        for (border, neighbour) in self.neighbours(block) {
            let beside = neighbour.and_then(|block| self.chosen[block]);
            cost += self.ends(kind, beside, border, prices.turn);
            cost += beside.map_or(0.0, |of| self.ends(of, Some(kind), border, prices.turn));
        }
        cost
    }

    /// The four neighbours, with the direction in which rows go over to them; none beyond the picture.
    fn neighbours(&self, block: usize) -> [(Direction, Option<usize>); 4] {
        let (i, j) = (block % self.columns, block / self.columns);
        [
            (Direction::Across, (i > 0).then(|| block - 1)),
            (Direction::Across, (i + 1 < self.columns).then_some(block + 1)),
            (Direction::Down, (j > 0).then(|| block - self.columns)),
            (Direction::Down, (j + 1 < self.rows).then_some(block + self.columns)),
        ]
    }

    /// Sprays along the rows of all blocks, one row after the other, with the volumes of the trials; a row ends where the kind does.
    pub(super) fn rows(&self, problem: &PaintProblem, trials: &[Trial]) -> Vec<Vec<Spray>> {
        let (width, height) = problem.reference.size();
        let mut rows = Vec::new();
        for (kind, trial) in trials.iter().enumerate() {
            let Trial { direction, spacing, sigma, .. } = *trial;
            // Along and beside the rows.
            let (length, breadth) = match direction {
                Direction::Across => (width, height),
                Direction::Down => (height, width),
            };
            let place = |along: usize, beside: usize| match direction {
                Direction::Across => [along, beside],
                Direction::Down => [beside, along],
            };
            for beside in cells(breadth, spacing) {
                let sprays = cells(length, problem.limits.spray_spacing).into_iter().map(|along| {
                    let [x, y] = place(along, beside);
                    let block = y / self.side * self.columns + x / self.side;
                    let spray = Spray { x: x as f64, y: y as f64, volume: trial.volumes[y * width + x].into(), sigma };
                    (self.chosen[block] == Some(kind)).then_some(spray)
                });
                let sprays: Vec<Option<Spray>> = sprays.collect();
                let runs = sprays.split(Option::is_none).map(|run| run.iter().copied().flatten().collect::<Vec<_>>());
                rows.extend(runs.filter(|run| !run.is_empty()));
            }
        }
        rows
    }
}

fn least_common_multiple(a: usize, b: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y > 0 {
        (x, y) = (y, x % y);
    }
    (a / x).saturating_mul(b)
}
