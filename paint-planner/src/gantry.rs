//! Shared control with a gantry robot: a person sweeps it past the object, the planner decides where its nozzle slides (handheld paper,
//! Section IV).
//!
//! [`plan_gantry`] samples how much paint is needed where the nozzle could be ([`DensityMap`], Eq. (1)), gives every movement between
//! lattice points a score (Eqs. (2)-(5)) and takes the path of the largest sum. What it needs to know of paint and robot is a
//! [`PaintModel`]. [`refine`] simulates the best candidates; [`greedy_path`], [`all_paths`] and [`random_path`] are what it is compared
//! with.

mod baselines;
mod beam;
mod best_path;
mod density_map;
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
pub use density_map::DensityMap;
pub use lattice::{GantryState, Lattice, Segment};
pub use model::{GantrySample, PaintModel};
pub use plan::{GantryPlan, plan_gantry};
pub use pose_filter::{PoseFilter, PoseFilterSettings};
pub use pose_smoother::PoseSmoother;
pub use registration::{RangeReading, Registration, RegistrationSettings};
pub use robot_motion::RobotMotion;
pub use rounded_path::RoundedPath;
pub use settings::GantrySettings;
