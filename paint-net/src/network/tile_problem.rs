//! A rectangle of a painting problem in the network's units.

use super::footprint_operator::FootprintOperator;
use super::padded_grid::PaddedGrid;
use super::real::Real;
use super::response::Response;

/// A rectangle of a problem in the network's units: pixels of the reference with the canvas and weights, and the cells over them.
#[derive(Debug, Clone)]
pub(crate) struct TileProblem<T> {
    pub(crate) cells: PaddedGrid,
    pub(crate) pixels: PaddedGrid,
    pub(crate) footprint: FootprintOperator<T>,
    pub(crate) response: Response,
    /// Wanted ink, depth there already, and weight of each pixel; the weight is zero outside the picture.
    pub(crate) wanted: Vec<T>,
    pub(crate) before: Vec<T>,
    pub(crate) weight: Vec<T>,
    /// Largest paint of each cell.
    pub(crate) upper_bounds: Vec<T>,
    /// Standard deviation of the footprint in cells, less one, along and down.
    pub(crate) conditioning: [T; 2],
}

impl<T: Real> TileProblem<T> {
    /// A bare wall with no reference, to be filled in.
    pub(crate) fn new(
        cells: (usize, usize),
        pixels: (usize, usize),
        footprint: FootprintOperator<T>,
        response: Response,
    ) -> Self {
        let cells = PaddedGrid::new(cells.0, cells.1, footprint.reach());
        let pixels = PaddedGrid::new(pixels.0, pixels.1, 0);
        Self {
            wanted: pixels.planes(1),
            before: pixels.planes(1),
            weight: pixels.planes(1),
            upper_bounds: cells.planes(1),
            conditioning: footprint.conditioning(),
            cells,
            pixels,
            footprint,
            response,
        }
    }
}

/// What is needed during a pass only.
#[derive(Debug, Clone)]
pub(crate) struct Scratch<T> {
    /// Three planes of pixels: weighted residual, curvature, missing depth; in the backward pass their derivatives.
    pub(crate) pixels: Vec<T>,
    /// Planes of the footprint operator, one per phase.
    pub(crate) phases: Vec<T>,
}

impl<T: Real> Scratch<T> {
    pub(crate) fn new(problem: &TileProblem<T>) -> Self {
        let count = problem.footprint.stride().0;
        Self { pixels: problem.pixels.planes(3), phases: problem.footprint.scratch(&problem.cells).planes(count) }
    }
}
