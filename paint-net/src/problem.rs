//! The painting problem, and the grid of cells on which it is solved.

mod ceiling;
pub(crate) mod defaults;
mod ghost_pixels;
mod limits;
mod paint_grid;
mod paint_problem;

pub use ceiling::ink_ceiling;
pub use ghost_pixels::{GhostPixels, WeightedPixels};
pub use limits::Limits;
pub(crate) use paint_grid::PaintGrid;
pub use paint_problem::PaintProblem;
