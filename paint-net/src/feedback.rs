use crate::deconvolution::prune_with;
use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::network::{Network, Scaled, Spread, State, Tiles};
use crate::painter::{Board, Limits, Painter, Painting, Task};
use crate::saturation::Saturation;

/// The network that learns to paint: it looks at its canvas, changes all sprays at once, and looks again. Ours.
///
/// Every pass renders the canvas, measures what is missing under each spray, and lets a small convolutional network, the same
/// on every cell and in every pass, decide how much paint to add or to take back from the plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback {
    /// The weights.
    pub network: Network,
    /// Looks at the canvas; 6 unless changed (ours): more bring a few hundredths of a dB, fewer are faster.
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

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        let within =
            |name, value: usize, most: usize, rule| require(name, value as f64, (1..=most).contains(&value), rule);
        within("passes", self.passes, 1000, "it must lie in 1..=1000")?;
        within("tile", self.tile, 1 << 20, "it must lie in 1..=1048576 cells")?;
        within("threads", self.threads, 1024, "it must lie in 1..=1024")?;
        let board = Board::new(task, kernel, saturation, limits)?;
        let (columns, rows) = (&board.footprints.columns, &board.footprints.rows);
        let scaled = Scaled::new(saturation);
        let stride = (limits.along, limits.row_spacing);
        // Paint is measured by the depth that it gives where all cells have the same.
        let depth_per_volume = kernel.mass() / ((stride.0 * stride.1) as f64 * scaled.depth);
        let narrow = |image: &Image, gain: f64| image.data().iter().map(|&v| (v * gain) as f32).collect();
        let block = self.network.block();
        let mut tiles = Tiles {
            block: &block,
            spread: Spread::new(kernel.taps(), stride, (columns[0], rows[0])),
            cells: (columns.len(), rows.len()),
            size: task.reference.size(),
            wanted: task.reference.data().iter().map(|&ink| (ink / scaled.ink).min(1.0) as f32).collect(),
            before: task.canvas.map(|canvas| narrow(canvas, 1.0 / scaled.depth)),
            weight: task.weight.map(|weight| narrow(weight, 1.0)),
            top: Vec::new(),
            law: scaled.law,
            tile: self.tile,
            threads: self.threads,
        };
        let mut run = |ceiling: &[f64], volumes: &mut Vec<f64>, stages: std::ops::Range<usize>| {
            tiles.top = ceiling.iter().map(|&top| (top * depth_per_volume) as f32).collect();
            let paint = volumes.iter().map(|&v| (v * depth_per_volume) as f32);
            let mut state = State::new(paint.zip(&tiles.top).map(|(v, &top)| v.min(top)).collect());
            let (first, count) = (stages.start, stages.len() as f64);
            tiles.run(stages, &mut state, &mut |stage| progress((stage - first) as f64 / count));
            volumes.clear();
            volumes
                .extend(state.paint.iter().zip(ceiling).map(|(&v, &top)| (f64::from(v) / depth_per_volume).min(top)));
        };
        let mut volumes = vec![0.0; board.footprints.cells()];
        run(&board.ceiling, &mut volumes, 0..self.passes);
        prune_with(&board, limits, &mut volumes, &mut |ceiling, volumes| {
            run(ceiling, volumes, self.passes..self.passes + PASSES_AFTER_PRUNING);
        });
        progress(1.0);
        Ok(board.painting(&volumes, saturation))
    }
}
