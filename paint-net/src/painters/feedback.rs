//! The feedback network as a painter.

use super::fitting::prune_with;
use crate::error::{Error, require};
use crate::image::Image;
use crate::network::{FootprintOperator, Network, ScaledResponse, State, Tiles};
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::problem::{PaintGrid, PaintProblem};

/// A feedback network (Zamir et al. 2017) on the canvas: it renders, changes all volumes at once, and renders again. Ours; the
/// network of Paper IV decides one spray per step ([`crate::thesis`]).
///
/// Every pass renders the canvas, measures what is missing under each spray, and lets a small convolutional network, the same
/// on every cell and in every pass, decide how much paint to add or to take back from the plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback {
    /// The weights.
    pub network: Network,
    /// Passes over the canvas; 6 unless changed (ours): more bring a few hundredths of a dB, fewer are faster.
    pub passes: usize,
    /// Side of the tiles that are worked on one after the other, cells. It decides on memory and speed only, the painting is
    /// the same to the last bit.
    pub tile: usize,
    /// Threads; the painting does not depend on it.
    pub threads: usize,
}

impl Feedback {
    /// The shipped weights, six passes, tiles of 64 cells, one thread.
    pub fn shipped() -> Result<Self, Error> {
        Network::shipped().map(Self::new)
    }

    /// The same with weights of your own.
    pub fn new(network: Network) -> Self {
        Self { network, passes: 6, tile: 64, threads: 1 }
    }
}

/// Passes after sprays have been dropped.
const PASSES_AFTER_PRUNING: usize = 3;

impl Painter for Feedback {
    fn name(&self) -> &'static str {
        "feedback"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        let within =
            |name, value: usize, most: usize, rule| require(name, value as f64, (1..=most).contains(&value), rule);
        within("passes", self.passes, 1000, "it must lie in 1..=1000")?;
        within("tile", self.tile, 1 << 20, "it must lie in 1..=1048576 cells")?;
        within("threads", self.threads, 1024, "it must lie in 1..=1024")?;
        let grid = PaintGrid::new(problem)?;
        let PaintProblem { reference, kernel, limits, .. } = *problem;
        let (columns, rows) = (&grid.footprints.columns, &grid.footprints.rows);
        let scaled = ScaledResponse::new(problem.saturation);
        let stride = (limits.spray_spacing, limits.row_spacing);
        // Paint is measured by the depth that it gives where all cells have the same.
        let depth_per_volume = kernel.mass() / ((stride.0 * stride.1) as f64 * scaled.depth);
        let narrow = |values: &[f64], gain: f64| values.iter().map(|&v| (v * gain) as f32).collect::<Vec<f32>>();
        let shown = |image: &Image| {
            let mut values = image.data().to_vec();
            if let Some(ghosts) = problem.ghosts {
                ghosts.gather(&mut values);
            }
            values
        };
        let network = self.network.packed();
        let mut tiles = Tiles {
            network: &network,
            footprint: FootprintOperator::new(kernel.taps(), stride, (columns[0], rows[0])),
            cells: (columns.len(), rows.len()),
            size: reference.size(),
            wanted: shown(reference).iter().map(|&ink| (ink / scaled.ink).min(1.0) as f32).collect(),
            before: problem.canvas.map(|_| narrow(grid.initial.data(), 1.0 / scaled.depth)),
            weight: problem.weight.map(|weight| narrow(&shown(weight), 1.0)),
            upper_bounds: Vec::new(),
            response: scaled.response,
            tile: self.tile,
            threads: self.threads,
        };
        let mut run = |upper_bounds: &[f64], volumes: &mut Vec<f64>, stages: std::ops::Range<usize>| {
            tiles.upper_bounds = upper_bounds.iter().map(|&upper| (upper * depth_per_volume) as f32).collect();
            let paint = volumes.iter().map(|&v| (v * depth_per_volume) as f32);
            let mut state = State::new(paint.zip(&tiles.upper_bounds).map(|(v, &upper)| v.min(upper)).collect());
            let (first, count) = (stages.start, stages.len() as f64);
            let mut told = |stage| observer.progress((stage - first) as f64 / count);
            if problem.ghosts.is_none() {
                tiles.run(stages, &mut state, &mut told);
            } else {
                // What comes over the seams changes with every pass: for each pixel it is paint that was there before.
                for stage in stages {
                    let volumes: Vec<f64> = state.paint.iter().map(|&v| f64::from(v) / depth_per_volume).collect();
                    tiles.before = Some(narrow(&beside_own(problem, &grid, &volumes), 1.0 / scaled.depth));
                    tiles.run(stage..stage + 1, &mut state, &mut told);
                }
            }
            volumes.clear();
            volumes.extend(
                state.paint.iter().zip(upper_bounds).map(|(&v, &upper)| (f64::from(v) / depth_per_volume).min(upper)),
            );
        };
        let mut volumes = vec![0.0; grid.footprints.cells()];
        run(&grid.upper_bounds, &mut volumes, 0..self.passes);
        prune_with(&grid.upper_bounds, limits, &mut volumes, &mut |upper_bounds, volumes| {
            run(upper_bounds, volumes, self.passes..self.passes + PASSES_AFTER_PRUNING);
        });
        observer.progress(1.0);
        Ok(Painting::new(grid.sprays(&volumes), grid.canvas(problem, &volumes), problem.saturation))
    }
}

/// Depth of every pixel without what the sprays put there on the plane itself: paint from before, and from beyond the seams.
fn beside_own(problem: &PaintProblem, grid: &PaintGrid, volumes: &[f64]) -> Vec<f64> {
    let mut own = vec![0.0; grid.initial.data().len()];
    grid.footprints.deposit(volumes, &mut own);
    let mut all: Vec<f64> = own.iter().zip(grid.initial.data()).map(|(own, before)| own + before).collect();
    problem.settle(grid.initial.data(), &mut all);
    all.iter().zip(own).map(|(all, own)| all - own).collect()
}
