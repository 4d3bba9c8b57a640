use std::ops::Range;

use super::field::{Field, Scratch};
use super::law::Law;
use super::pass::{Block, Pass};
use super::planes::Grid;
use super::spread::Spread;

/// A task of any size, in the network's units, worked on in tiles. In every pass each tile sees as much of its neighbours as
/// the pass can feel, so that the tiling does not change a bit of the result.
pub(crate) struct Tiles<'a> {
    pub(crate) block: &'a Block<f32>,
    pub(crate) spread: Spread<f32>,
    pub(crate) law: Law,
    /// Columns and rows of cells, and of pixels.
    pub(crate) cells: (usize, usize),
    pub(crate) size: (usize, usize),
    pub(crate) wanted: Vec<f32>,
    pub(crate) before: Option<Vec<f32>>,
    pub(crate) weight: Option<Vec<f32>>,
    pub(crate) top: Vec<f32>,
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

/// Buffers of one thread, kept from tile to tile while their size stays the same.
struct Work {
    grids: (Grid, Grid),
    pass: Pass<f32>,
    scratch: Scratch<f32>,
    paint: Vec<f32>,
    last_step: Vec<f32>,
}

impl Work {
    fn new(field: &Field<f32>, block: &Block<f32>) -> Self {
        Self {
            grids: (field.cells, field.pixels),
            pass: Pass::new(field, &block.shape()),
            scratch: Scratch::new(field),
            paint: field.cells.planes(1),
            last_step: field.cells.planes(1),
        }
    }
}

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

    /// One tile is the whole picture: its field serves all passes.
    fn run_whole(&self, stages: Range<usize>, state: &mut State, progress: &mut dyn FnMut(usize)) {
        let all: Region = (0..self.cells.0, 0..self.cells.1);
        let field = self.field(&all);
        let mut work = Work::new(&field, self.block);
        self.load(&all, &field, state, &mut work);
        for stage in stages {
            progress(stage);
            self.pass(&field, stage, &mut work);
        }
        for y in 0..self.cells.1 {
            let at = y * self.cells.0..(y + 1) * self.cells.0;
            state.paint[at.clone()].copy_from_slice(field.cells.row(&work.paint, 0, y));
            state.last_step[at].copy_from_slice(field.cells.row(&work.last_step, 0, y));
        }
    }

    /// One pass over some bands.
    fn run_bands(&self, stage: usize, before: &State, bands: Vec<Band>) {
        let mut kept: Option<Work> = None;
        let (wide, high) = self.cells;
        for (band, (paint, last_step)) in bands {
            let rows = band * self.tile..((band + 1) * self.tile).min(high);
            for left in (0..wide).step_by(self.tile) {
                let columns = left..(left + self.tile).min(wide);
                let seen = self.seen(&columns, &rows);
                let field = self.field(&seen);
                let mut work = kept
                    .take()
                    .filter(|w| w.grids == (field.cells, field.pixels))
                    .unwrap_or_else(|| Work::new(&field, self.block));
                self.load(&seen, &field, before, &mut work);
                self.pass(&field, stage, &mut work);
                for y in rows.clone() {
                    let to = (y - rows.start) * wide;
                    let from = columns.start - seen.0.start..columns.end - seen.0.start;
                    let row = field.cells.row(&work.paint, 0, y - seen.1.start);
                    paint[to + columns.start..to + columns.end].copy_from_slice(&row[from.clone()]);
                    let row = field.cells.row(&work.last_step, 0, y - seen.1.start);
                    last_step[to + columns.start..to + columns.end].copy_from_slice(&row[from]);
                }
                kept = Some(work);
            }
        }
    }

    fn pass(&self, field: &Field<f32>, stage: usize, work: &mut Work) {
        work.pass.look(field, &work.paint, &mut work.scratch);
        work.pass.sense(field, &work.paint, &work.last_step, &mut work.scratch);
        work.pass.think(field, self.block, stage);
        work.pass.act(field, &mut work.paint, &mut work.last_step);
    }

    /// What a pass over a tile can feel: the layers of the network, and two footprints between cells.
    fn seen(&self, columns: &Range<usize>, rows: &Range<usize>) -> Region {
        let halo = self.block.shape().layers + 1 + 2 * self.spread.reach();
        let grown = |r: &Range<usize>, end: usize| r.start.saturating_sub(halo)..(r.end + halo).min(end);
        (grown(columns, self.cells.0), grown(rows, self.cells.1))
    }

    /// The task on a rectangle of cells.
    fn field(&self, cells: &Region) -> Field<f32> {
        let (along, down) = self.spread.stride();
        // The last cell takes what remains of the picture.
        let pixels = |r: &Range<usize>, stride: usize, end: usize, size: usize| {
            r.start * stride..if r.end == end { size } else { (r.end * stride).min(size) }
        };
        let columns = pixels(&cells.0, along, self.cells.0, self.size.0);
        let rows = pixels(&cells.1, down, self.cells.1, self.size.1);
        let mut field = Field::new(
            (cells.0.len(), cells.1.len()),
            (columns.len(), rows.len()),
            self.spread.clone(),
            self.law.clone(),
        );
        for (j, y) in rows.enumerate() {
            let from = y * self.size.0 + columns.start..y * self.size.0 + columns.end;
            field.pixels.row_mut(&mut field.wanted, 0, j).copy_from_slice(&self.wanted[from.clone()]);
            if let Some(before) = &self.before {
                field.pixels.row_mut(&mut field.before, 0, j).copy_from_slice(&before[from.clone()]);
            }
            match &self.weight {
                Some(weight) => field.pixels.row_mut(&mut field.weight, 0, j).copy_from_slice(&weight[from]),
                None => field.pixels.row_mut(&mut field.weight, 0, j).fill(1.0),
            }
        }
        for (j, y) in cells.1.clone().enumerate() {
            let from = y * self.cells.0;
            let row = &self.top[from + cells.0.start..from + cells.0.end];
            field.cells.row_mut(&mut field.top, 0, j).copy_from_slice(row);
        }
        field
    }

    /// Puts the state of a rectangle of cells into the buffers.
    fn load(&self, cells: &Region, field: &Field<f32>, state: &State, work: &mut Work) {
        for (j, y) in cells.1.clone().enumerate() {
            let from = y * self.cells.0 + cells.0.start..y * self.cells.0 + cells.0.end;
            field.cells.row_mut(&mut work.paint, 0, j).copy_from_slice(&state.paint[from.clone()]);
            field.cells.row_mut(&mut work.last_step, 0, j).copy_from_slice(&state.last_step[from]);
        }
    }
}
