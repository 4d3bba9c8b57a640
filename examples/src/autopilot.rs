//! Between this robot and an autopilot that speaks MAVLink: frames, messages, and the state of the off-board link, fed message by
//! message without sockets; two thin files of lines; and PX4 itself as a program beside this one.
//!
//! | link | where | what |
//! |---|---|---|
//! | simulator | TCP 4560, PX4 connects to us | [`simulator`]: `HIL_SENSOR` sets the clock, `HIL_ACTUATOR_CONTROLS` comes back |
//! | off-board | UDP, PX4 at 14580 sends to 14540; a serial line | [`OffboardLink`]: set-points, odometry, mode and arming, telemetry |

mod codec;
mod error;
pub mod frames;
mod link_address;
mod lockstep;
mod odometry;
mod offboard;
mod px4;
mod px4_folder;
mod setpoint;
pub mod simulator;
mod simulator_socket;
mod stamps;
mod telemetry;
mod vehicle_link;

pub use codec::{Decoder, Encoder};
pub use error::AutopilotError;
pub use link_address::LinkAddress;
pub use mavlink::dialects::common::MavMessage;
pub use odometry::Odometry;
pub use offboard::{OffboardLink, OffboardSettings};
pub use px4::Px4;
pub use px4_folder::Px4Vehicle;
pub use setpoint::Setpoint;
pub use simulator_socket::SimulatorSocket;
pub use telemetry::{AttitudeTarget, Identity, Mode, Telemetry};
pub use vehicle_link::VehicleLink;
