//! Maps a recorded RGB-D sequence: reads it frame by frame, fuses it, and shows what became of it.

mod decode;
mod keeper;
mod layouts;
mod report;
mod run;
mod sequence;
mod views;

pub use decode::{Colour, Images};
pub use keeper::Device;
pub use report::ScanReport;
pub use run::{Course, Look, Scan, ScanError, ScanSettings};
pub use sequence::{FrameFiles, Sequence, SequenceError};
