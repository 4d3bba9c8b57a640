//! Painting by hand in virtual reality: from the states of a VR session to tasks for the planner (VR paper, Section III).
//!
//! A [`VrState`] is what the headset, or a mouse, says 90 times a second. [`Resampler`] puts states onto that clock. In a live session
//! a [`LiveQueue`] runs Algorithm 1: it breaks the states into [`Task`]s as they come and tells the person when to wait or to move
//! closer. After an offline session [`segments`] cuts from press to release. [`targets`] turns a segment into what a
//! [`Planner`](crate::Planner) takes, and [`continue_plan`] lets the vehicle go on from one segment to the next without a halt.
//! Everything is a function of the states alone, so a recorded session gives the same tasks again.

mod breaks;
mod continuation;
mod feedback;
mod lag;
mod live;
mod offline;
mod resample;
mod settings;
mod state;
mod targets;
mod task;

pub use continuation::{Continuation, continue_plan};
pub use feedback::Feedback;
pub use lag::{LagIndicator, latency_in_time};
pub use live::{LiveQueue, QueueCounts};
pub use offline::segments;
pub use resample::{ResampleCounts, Resampler};
pub use settings::{FarReference, SessionSettings, TargetSettings};
pub use state::{CradlePose, PaintHit, RATE, VERSION, VrMode, VrState};
pub use targets::targets;
pub use task::{Segment, Task};
