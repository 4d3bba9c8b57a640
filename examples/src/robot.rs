//! The robot in the air: the on-board program that flies a plan on an autopilot and paints, and the simulated vehicle below it.
//!
//! | component | rate | file |
//! |---|---|---|
//! | physics: rigid body, motors, wind, hose, servos, valve | 1 kHz | [`SimulatedRobot`] |
//! | autopilot's sensors and motor commands | 250 Hz | [`SimulatedRobot`], [`autopilot`](crate::autopilot) |
//! | on-board program: phases, set-points, aim, valve | 100 Hz | [`OnBoard`] |
//! | odometry for the autopilot | 50 Hz | [`OffboardLink`](crate::autopilot::OffboardLink) |

mod arguments;
mod error;
mod fault;
mod flight;
mod guided_reference;
mod on_board;
mod px4_flyer;
mod recorder;
mod report;
mod run;
mod settings;
mod simulated_robot;
mod simulation;
mod trial;
mod vehicle;

pub use arguments::{Arguments, AutopilotChoice};
pub use error::RobotError;
pub use fault::{Fault, FaultKind};
pub use flight::{Flown, Scene, fly_px4};
pub use on_board::{Commanded, OnBoard, OnBoardSettings, SetpointKind};
pub use recorder::Record;
pub use report::{FlightReport, RobotReport, TrialReport};
pub use run::run;
pub use simulated_robot::SimulatedRobot;
