//! Shared control with a gantry robot: a person sweeps it past the object, the robot decides where its nozzle slides and when it sprays
//! (handheld paper, Sections IV to VI).
//!
//! [`Controller`] is the robot's on-board program, fed frame by frame; what it needs to know of paint is a [`DepositModel`]. Its parts can
//! be used alone: [`plan_gantry`] samples how much paint is needed where the nozzle could be ([`DensityMap`], Eq. (1)), gives every movement between
//! lattice points a score (Eqs. (2)-(5)) and takes the path of the largest sum. What it needs to know of paint and robot is a
//! [`PaintModel`]. [`refine`] simulates the best candidates; [`greedy_path`], [`all_paths`] and [`random_path`] are what it is compared
//! with.

mod baselines;
mod beam;
mod best_path;
mod controller;
mod density_map;
mod deposit_estimate;
mod edge_scores;
mod filter_state;
mod idle;
mod lattice;
mod model;
mod plan;
mod pose_filter;
mod pose_smoother;
mod registration;
mod robot_motion;
mod rounded_path;
mod settings;

pub use baselines::{all_paths, greedy_path, random_path, rank};
pub use beam::{BeamSettings, refine};
pub use controller::{Command, Controller, ControllerSettings, Event, Frame, InertialSample, SlideSetpoint};
pub use density_map::DensityMap;
pub use deposit_estimate::DepositEstimate;
pub use lattice::{GantryState, Lattice, Segment};
pub use model::{DepositModel, GantrySample, PaintModel};
pub use plan::{GantryPlan, plan_gantry};
pub use pose_filter::{PoseFilter, PoseFilterSettings};
pub use pose_smoother::PoseSmoother;
pub use registration::{RangeReading, Registration, RegistrationSettings};
pub use robot_motion::RobotMotion;
pub use rounded_path::RoundedPath;
pub use settings::GantrySettings;
