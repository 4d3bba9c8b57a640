//! Paths of the nozzle over the sprays.

mod scan_order;
mod strokes;

pub use scan_order::ScanOrder;
pub use strokes::{Stroke, StrokeSettings, boustrophedon, in_order};
