//! Maps a recorded RGB-D sequence: reads it frame by frame, fuses it, and shows what became of it.

mod decode;
mod layouts;
mod sequence;

pub use decode::{Colour, Images};
pub use sequence::{FrameFiles, Sequence, SequenceError};
