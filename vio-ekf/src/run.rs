//! The odometry's protocol around the filter: when it starts, when poses are withdrawn, when a new segment begins, and why.

mod calibration_check;
mod calibration_doubt;
mod calibration_evidence;
mod calibration_trial;
mod calibration_watch;
mod evaluation;
pub(crate) mod frames;
mod outcome;
mod pair_order;
mod recorded;
mod runner;
mod segments;
mod summary;

pub use calibration_check::check_calibration;
pub use calibration_doubt::{CalibrationDoubt, CalibrationPart};
pub use evaluation::{AlignedPair, GroundTruth, PoseError, RunEvaluation, evaluate_run};
pub use frames::{Picture, RecordedFrame, pair_by_stamp};
pub use outcome::{Event, ImageOutcome, Loss, LossReason, SkipReason, SkippedImage};
pub use recorded::run_recording;
pub use runner::{Runner, RunnerSettings};
pub use segments::{Estimate, Segment};
pub use summary::Run;
