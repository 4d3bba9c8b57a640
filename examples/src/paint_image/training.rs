//! Training of the networks.

mod digits;
mod held_out;
mod painter;
mod rollout;
mod thesis;

pub use painter::{TrainingRun, train_painter};
pub use thesis::{ThesisTrainingRun, TrainingImages, held_out_patch, train_thesis};
