//! The network over an image of any size, in tiles with halos.

use std::ops::Range;

use super::footprint_operator::FootprintOperator;
use super::pass::PackedNetwork;
use super::response::Response;
use super::tile_buffers::TileBuffers;
use super::tile_problem::TileProblem;

/// A problem of any size, in the network's units, worked on in tiles. In every pass each tile has a halo as wide as the pass's
/// receptive field, so that the tiling does not change a bit of the result.
pub(crate) struct Tiles<'a> {
    pub(crate) network: &'a PackedNetwork<f32>,
    pub(crate) footprint: FootprintOperator<f32>,
    pub(crate) response: Response,
    /// Columns and rows of cells, and of pixels.
    pub(crate) cells: (usize, usize),
    pub(crate) size: (usize, usize),
    pub(crate) wanted: Vec<f32>,
    pub(crate) before: Option<Vec<f32>>,
    pub(crate) weight: Option<Vec<f32>>,
    pub(crate) upper_bounds: Vec<f32>,
    /// Side of a tile, cells.
    pub(crate) tile: usize,
    pub(crate) threads: usize,
}

/// Paint of every cell, and its last change.
pub(crate) struct State {
    pub(crate) paint: Vec<f32>,
    pub(crate) last_step: Vec<f32>,
}

impl State {
    pub(crate) fn new(paint: Vec<f32>) -> Self {
        Self { last_step: vec![0.0; paint.len()], paint }
    }
}

/// A rectangle of cells: columns and rows.
type Region = (Range<usize>, Range<usize>);

/// A row of tiles: its number, and its paint and last steps after the pass.
type Band<'a> = (usize, (&'a mut [f32], &'a mut [f32]));

impl Tiles<'_> {
    /// Runs the passes of these stages; `progress` is told every stage.
    pub(crate) fn run(&self, stages: Range<usize>, state: &mut State, progress: &mut dyn FnMut(usize)) {
        if self.cells.0 <= self.tile && self.cells.1 <= self.tile {
            self.run_whole(stages, state, progress);
            return;
        }
        for stage in stages {
            progress(stage);
            let mut next = State::new(vec![0.0; state.paint.len()]);
            let band = self.tile * self.cells.0;
            let bands = next.paint.chunks_mut(band).zip(next.last_step.chunks_mut(band)).enumerate();
            let mut shares: Vec<Vec<_>> = (0..self.threads).map(|_| Vec::new()).collect();
            for band in bands {
                shares[band.0 % self.threads].push(band);
            }
            let before = &*state;
            std::thread::scope(|scope| {
                let mut shares = shares.into_iter();
                let own = shares.next();
                for share in shares {
                    scope.spawn(move || self.run_bands(stage, before, share));
                }
                self.run_bands(stage, before, own.unwrap_or_default());
            });
            *state = next;
        }
    }

    /// One tile is the whole picture: its problem serves all passes.
    fn run_whole(&self, stages: Range<usize>, state: &mut State, progress: &mut dyn FnMut(usize)) {
        let all: Region = (0..self.cells.0, 0..self.cells.1);
        let problem = self.tile_problem(&all);
        let mut work = TileBuffers::fitting(TileBuffers::kept(), &problem, self.network);
        self.load(&all, &problem, state, &mut work);
        for stage in stages {
            progress(stage);
            self.pass(&problem, stage, &mut work);
        }
        for y in 0..self.cells.1 {
            let at = y * self.cells.0..(y + 1) * self.cells.0;
            state.paint[at.clone()].copy_from_slice(problem.cells.row(&work.paint, 0, y));
            state.last_step[at].copy_from_slice(problem.cells.row(&work.last_step, 0, y));
        }
        work.keep();
    }

    /// One pass over some bands.
    fn run_bands(&self, stage: usize, before: &State, bands: Vec<Band>) {
        let mut kept = TileBuffers::kept();
        let (wide, high) = self.cells;
        for (band, (paint, last_step)) in bands {
            let rows = band * self.tile..((band + 1) * self.tile).min(high);
            for left in (0..wide).step_by(self.tile) {
                let columns = left..(left + self.tile).min(wide);
                let region = self.with_halo(&columns, &rows);
                let problem = self.tile_problem(&region);
                let mut work = TileBuffers::fitting(kept.take(), &problem, self.network);
                self.load(&region, &problem, before, &mut work);
                self.pass(&problem, stage, &mut work);
                for y in rows.clone() {
                    let to = (y - rows.start) * wide;
                    let from = columns.start - region.0.start..columns.end - region.0.start;
                    let row = problem.cells.row(&work.paint, 0, y - region.1.start);
                    paint[to + columns.start..to + columns.end].copy_from_slice(&row[from.clone()]);
                    let row = problem.cells.row(&work.last_step, 0, y - region.1.start);
                    last_step[to + columns.start..to + columns.end].copy_from_slice(&row[from]);
                }
                kept = Some(work);
            }
        }
        if let Some(work) = kept {
            work.keep();
        }
    }

    fn pass(&self, problem: &TileProblem<f32>, stage: usize, work: &mut TileBuffers) {
        work.pass.render(problem, &work.paint, &mut work.scratch);
        work.pass.features(problem, &work.paint, &work.last_step, &mut work.scratch);
        work.pass.predict(problem, self.network, stage);
        work.pass.update(problem, &mut work.paint, &mut work.last_step);
    }

    /// A tile with its halo, the receptive field of a pass: a cell per convolution, and the footprints of two cells that share a
    /// pixel.
    fn with_halo(&self, columns: &Range<usize>, rows: &Range<usize>) -> Region {
        let halo = self.network.architecture().layers + 1 + self.footprint.overlap();
        let grown = |r: &Range<usize>, end: usize| r.start.saturating_sub(halo)..(r.end + halo).min(end);
        (grown(columns, self.cells.0), grown(rows, self.cells.1))
    }

    /// The problem on a rectangle of cells.
    fn tile_problem(&self, cells: &Region) -> TileProblem<f32> {
        let (along, down) = self.footprint.stride();
        // The last cell takes what remains of the picture.
        let pixels = |r: &Range<usize>, stride: usize, end: usize, size: usize| {
            r.start * stride..if r.end == end { size } else { (r.end * stride).min(size) }
        };
        let columns = pixels(&cells.0, along, self.cells.0, self.size.0);
        let rows = pixels(&cells.1, down, self.cells.1, self.size.1);
        let mut problem = TileProblem::new(
            (cells.0.len(), cells.1.len()),
            (columns.len(), rows.len()),
            self.footprint.clone(),
            self.response.clone(),
        );
        for (j, y) in rows.enumerate() {
            let from = y * self.size.0 + columns.start..y * self.size.0 + columns.end;
            problem.pixels.row_mut(&mut problem.wanted, 0, j).copy_from_slice(&self.wanted[from.clone()]);
            if let Some(before) = &self.before {
                problem.pixels.row_mut(&mut problem.before, 0, j).copy_from_slice(&before[from.clone()]);
            }
            match &self.weight {
                Some(weight) => problem.pixels.row_mut(&mut problem.weight, 0, j).copy_from_slice(&weight[from]),
                None => problem.pixels.row_mut(&mut problem.weight, 0, j).fill(1.0),
            }
        }
        for (j, y) in cells.1.clone().enumerate() {
            let from = y * self.cells.0;
            let row = &self.upper_bounds[from + cells.0.start..from + cells.0.end];
            problem.cells.row_mut(&mut problem.upper_bounds, 0, j).copy_from_slice(row);
        }
        problem
    }

    /// Puts the state of a rectangle of cells into the buffers.
    fn load(&self, cells: &Region, problem: &TileProblem<f32>, state: &State, work: &mut TileBuffers) {
        for (j, y) in cells.1.clone().enumerate() {
            let from = y * self.cells.0 + cells.0.start..y * self.cells.0 + cells.0.end;
            problem.cells.row_mut(&mut work.paint, 0, j).copy_from_slice(&state.paint[from.clone()]);
            problem.cells.row_mut(&mut work.last_step, 0, j).copy_from_slice(&state.last_step[from]);
        }
    }
}
