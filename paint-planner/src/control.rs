//! Flying along a trajectory: model predictive control of a multirotor whose attitude follows its commands as a first-order system
//! (Paper II, section 5.2), and identification of that system from a recording.

mod axis;
mod identification;
mod mpc;
mod vehicle;

pub use identification::{AttitudeFit, AttitudeSample, identify_attitude};
pub use mpc::{MpcSettings, TrackingMpc};
pub use vehicle::{AttitudeResponse, ControlCommand, ControlReference, ControlState, VehicleModel};
