use super::law::Law;
use super::planes::Grid;
use super::real::Real;
use super::spread::Spread;

/// A piece of a task in the network's units: pixels of the reference with the canvas and weights, and the cells over them.
#[derive(Debug, Clone)]
pub(crate) struct Field<T> {
    pub(crate) cells: Grid,
    pub(crate) pixels: Grid,
    pub(crate) spread: Spread<T>,
    pub(crate) law: Law,
    /// Wanted ink, depth there already, and weight of each pixel; the weight is zero outside the picture.
    pub(crate) wanted: Vec<T>,
    pub(crate) before: Vec<T>,
    pub(crate) weight: Vec<T>,
    /// Largest paint of each cell.
    pub(crate) top: Vec<T>,
    /// Standard deviation of the footprint in cells, less one, along and down.
    pub(crate) settings: [T; 2],
}

impl<T: Real> Field<T> {
    /// A bare wall with no reference, to be filled in.
    pub(crate) fn new(cells: (usize, usize), pixels: (usize, usize), spread: Spread<T>, law: Law) -> Self {
        let cells = Grid::new(cells.0, cells.1, spread.reach());
        let pixels = Grid::new(pixels.0, pixels.1, 0);
        Self {
            wanted: pixels.planes(1),
            before: pixels.planes(1),
            weight: pixels.planes(1),
            top: cells.planes(1),
            settings: spread.settings(),
            cells,
            pixels,
            spread,
            law,
        }
    }
}

/// What is needed during a pass only.
#[derive(Debug, Clone)]
pub(crate) struct Scratch<T> {
    /// Three planes of pixels: weighted residual, stiffness, missing depth; in the backward pass their derivatives.
    pub(crate) pixels: Vec<T>,
    pub(crate) spread: Vec<T>,
}

impl<T: Real> Scratch<T> {
    pub(crate) fn new(field: &Field<T>) -> Self {
        let phases = field.spread.stride().0;
        Self { pixels: field.pixels.planes(3), spread: field.spread.scratch(&field.cells).planes(phases) }
    }
}
