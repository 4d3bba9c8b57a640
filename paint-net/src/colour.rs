//! Several paints: palettes, Kubelka-Munk mixtures, and images in colour.

mod colour_image;
mod colour_metric;
mod colour_problem;
mod cost;
mod kubelka_munk;
mod mixture;
mod palette;
mod separation;
mod unmix;

pub use colour_image::ColourImage;
pub use colour_metric::ColourMetric;
pub use colour_problem::ColourProblem;
pub use palette::{MAX_PAINTS, Paint, Palette};
pub use separation::{ColourPainting, ColourSeparation};
