//! Flying along a trajectory: model predictive control of a multirotor whose attitude follows its commands as a first-order system
//! (Paper II, section 5.2), and identification of that system from a flight that excites it, or from a recording.

mod attitude_sample;
mod axis;
mod excitation;
mod identification;
mod mpc;
mod output_error;
mod response;
mod vehicle;

pub use attitude_sample::AttitudeSample;
pub use excitation::{Excitation, Identification, IdentifiedAttitude};
pub use identification::{AttitudeFit, SecondOrderFit, SecondOrderResponse, identify_attitude, identify_second_order};
pub use mpc::{MpcSettings, TrackingMpc};
pub use vehicle::{AttitudeResponse, ControlCommand, ControlReference, ControlState, VehicleModel};
