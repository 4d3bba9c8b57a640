//! What a tile is worked on with, kept from tile to tile and from painting to painting.

use std::cell::Cell;

use super::architecture::Architecture;
use super::padded_grid::PaddedGrid;
use super::pass::{PackedNetwork, Pass};
use super::tile_problem::{Scratch, TileProblem};

/// Most bytes that a thread keeps.
const MOST_KEPT: usize = 8 << 20;

thread_local! {
    /// Fresh buffers would take a quarter of the time of a small picture: the system hands out their pages one by one.
    static KEPT: Cell<Option<TileBuffers>> = const { Cell::new(None) };
}

/// Buffers of one thread.
pub(super) struct TileBuffers {
    layout: Layout,
    pub(super) pass: Pass<f32>,
    pub(super) scratch: Scratch<f32>,
    pub(super) paint: Vec<f32>,
    pub(super) last_step: Vec<f32>,
}

/// Where everything lies: what a margin is in one layout holds values in another.
#[derive(PartialEq)]
struct Layout {
    cells: PaddedGrid,
    pixels: PaddedGrid,
    phases: (usize, PaddedGrid),
    architecture: Architecture,
}

impl TileBuffers {
    /// Those given, if they are laid out for this problem, or new ones.
    pub(super) fn fitting(given: Option<Self>, problem: &TileProblem<f32>, network: &PackedNetwork<f32>) -> Self {
        let (cells, pixels, architecture) = (problem.cells, problem.pixels, network.architecture());
        let phases = (problem.footprint.stride().0, problem.footprint.scratch(&cells));
        let layout = Layout { cells, pixels, phases, architecture };
        given.filter(|given| given.layout == layout).unwrap_or_else(|| Self {
            layout,
            pass: Pass::new(problem, &architecture),
            scratch: Scratch::new(problem),
            paint: cells.planes(1),
            last_step: cells.planes(1),
        })
    }

    /// Those that this thread has kept.
    pub(super) fn kept() -> Option<Self> {
        KEPT.take()
    }

    /// Keeps them for the next painting of this thread, unless they are large.
    pub(super) fn keep(self) {
        if self.bytes() <= MOST_KEPT {
            KEPT.set(Some(self));
        }
    }

    fn bytes(&self) -> usize {
        let (Pass { ink, slope, inputs, hidden, step }, Scratch { pixels, phases }) = (&self.pass, &self.scratch);
        let planes = [ink, slope, inputs, step, pixels, phases, &self.paint, &self.last_step];
        planes.into_iter().chain(hidden).map(|plane| size_of_val(&plane[..])).sum()
    }
}
