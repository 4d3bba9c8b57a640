//! Several paints: palettes, Kubelka-Munk mixtures, and images in colour.

mod coarse_picture;
mod colour_fit;
mod colour_image;
mod colour_metric;
mod colour_problem;
mod cost;
mod footprint_set;
mod kubelka_munk;
mod mixing_model;
mod mixture;
mod paint_choice;
mod palette;
mod pixel_fit;
mod separation;
mod sparse_colour_fit;
mod texel_separation;
mod unmix;

pub use colour_fit::ColourFit;
pub use colour_image::ColourImage;
pub use colour_metric::ColourMetric;
pub use colour_problem::ColourProblem;
pub use footprint_set::FootprintSet;
pub use mixing_model::{MOST_PAINTS, MixingModel};
pub use paint_choice::{best_order, choose_paints};
pub use palette::{MAX_PAINTS, Paint, Palette};
pub use separation::{ColourPainting, ColourSeparation};
pub use sparse_colour_fit::SparseColourFit;
pub use texel_separation::{Separated, TexelSeparation};
