//! Maps a recorded RGB-D sequence: reads it frame by frame, fuses it, and shows what became of it.

mod decode;
mod error;
mod layouts;
mod map_store;
mod report;
mod run;
mod sequence;
mod views;

pub use decode::{Colour, Images};
pub use error::{ScanError, SequenceError};
pub use layouts::open_sequence;
pub use map_store::Device;
pub use report::ScanReport;
pub use run::{RayCastCheck, Scan, ScanMetrics, ScanSettings};
pub use sequence::{FrameFiles, Sequence};
pub use views::save_views;
