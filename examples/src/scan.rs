//! Maps a recorded RGB-D sequence: reads it frame by frame, fuses it, and shows what became of it.

mod decode;
mod layouts;
mod map_store;
mod report;
mod run;
mod sequence;
mod views;

pub use decode::{Colour, Images};
pub use map_store::Device;
pub use report::ScanReport;
pub use run::{RayCastCheck, Scan, ScanError, ScanMetrics, ScanSettings};
pub use sequence::{FrameFiles, Sequence, SequenceError};
