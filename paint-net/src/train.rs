//! Training of the feedback network on procedural images, and of the thesis' network on images given: seeded, and the same to
//! the last bit for any number of threads.

mod adam;
mod checkpoint;
mod descent;
mod feedback;
mod patch;
mod sample;
mod thesis;

pub use feedback::{TrainProgress, TrainSettings, Trainer};
pub use patch::{thesis_patch, thesis_patch_of};
pub use thesis::{ThesisLoss, ThesisSettings, ThesisTrainer};
