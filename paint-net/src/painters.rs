//! The painters: three that plan on a grid of cells, one that follows lines, two of rows that fill regions or follow the picture, one network, one
//! of free sprays, and four that wrap others.

mod adaptive_rows;
mod area_fill;
mod centrelines;
mod centring;
mod closed_loop;
mod deconvolution;
mod distance;
mod doses;
mod drawn_lines;
mod feedback;
mod fitting;
mod free_sprays;
mod layers;
mod on_surface;
mod placed_sprays;
mod pursuit;
mod skeleton_graph;
mod skeleton_lines;
mod slew;
mod thinning;
mod trace;
mod volume_fit;

pub use adaptive_rows::{AdaptiveRows, RowWidth};
pub use area_fill::AreaFill;
pub use centrelines::Centrelines;
pub use closed_loop::ClosedLoopPainter;
pub use deconvolution::Deconvolution;
pub use doses::{DoseCorrection, DoseFootprint};
pub use feedback::Feedback;
pub use free_sprays::FreeSprays;
pub use layers::{LayerPlanning, Layered, ThresholdSpacing};
pub use on_surface::OnSurface;
pub use pursuit::MatchingPursuit;
pub use slew::{SlewLimited, slew_violations};
pub use volume_fit::{SurfaceFootprint, VolumeFit};
