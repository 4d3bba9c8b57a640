//! Teleoperation: a person paints by hand in virtual reality, and a vehicle follows (VR paper, Section III).
//!
//! A [`VrState`] is what the headset, or a mouse, says 90 times a second. [`Resampler`] puts states onto that clock. [`Teleop`] takes
//! them, runs Algorithm 1, plans every task with the heading that the vehicle has, lets it go on from one segment to the next without a
//! halt, and hands the [`Flight`]s to a [`Vehicle`]: an autopilot, or a simulation of one.
//!
//! Its parts can be used by themselves. In a live session a [`LiveQueue`] breaks the states into [`Task`]s as they come and tells the
//! person when to wait or to move closer. After an offline session [`segments`] cuts from press to release. [`targets`] turns a segment
//! into what a [`Planner`](crate::Planner) takes, and [`continue_plan`] replaces the end of a plan in flight.
//! Everything is a function of the states alone, so a recorded session gives the same flights again.

mod assignment;
mod breaks;
mod continuation;
mod feedback;
mod held_heading;
mod lag;
mod live;
mod offline;
mod pilot;
mod resample;
mod scene;
mod settings;
mod state;
mod strokes;
mod targets;
mod task;
mod teleoperation;
mod vehicle;

pub use assignment::TaskKind;
pub use continuation::{Continuation, continue_plan};
pub use feedback::Feedback;
pub use lag::{LagIndicator, latency_in_time};
pub use live::{LiveQueue, QueueCounts};
pub use offline::segments;
pub use pilot::PlannedTask;
pub use resample::{ResampleCounts, Resampler};
pub use scene::TeleopScene;
pub use settings::{FarReference, SessionSettings, TargetSettings, TeleopSettings};
pub use state::{CradlePose, PaintHit, RATE, VERSION, VrMode, VrState};
pub use targets::targets;
pub use task::{Segment, Task};
pub use teleoperation::Teleop;
pub use vehicle::{Flight, Vehicle};
