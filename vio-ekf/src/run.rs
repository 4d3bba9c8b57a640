//! The odometry's protocol around the filter: when it starts, when poses are withdrawn, when a new segment begins, and why.

pub(crate) mod frames;
mod outcome;
mod recorded;
mod runner;
mod segments;
mod summary;

pub use frames::{Picture, RecordedFrame, pair_by_stamp};
pub use outcome::{Event, ImageOutcome, Loss, LossReason, SkipReason, SkippedImage};
pub use recorded::run_recording;
pub use runner::{Runner, RunnerSettings};
pub use segments::{Estimate, Segment};
pub use summary::Run;
