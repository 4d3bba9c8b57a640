//! From targets to a plan: one trait, the optimal planner and the smoothing baseline.

mod assemble;
mod binding;
mod optimal;
mod smoothing;
mod solution;
mod strategy;
mod valve;

use crate::error::Error;
pub use crate::not_served::NotServed;
pub use crate::settings::LowessSettings;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::{Surface, Tool};

pub(crate) use assemble::{UntimedPlan, assemble_plan};
pub use binding::BindingLimits;
pub use optimal::OptimalPlanner;
pub use smoothing::SmoothingPlanner;
pub use solution::{Plan, PlanReport, Setpoint, Waypoint};
pub use strategy::Planner;

/// Plans a whole path with the optimal planner in one call; see [`Planner::plan`].
///
/// # Errors
/// As [`Planner::plan`].
pub fn plan(targets: &[Target], surface: &dyn Surface, tool: &dyn Tool, settings: &Settings) -> Result<Plan, Error> {
    OptimalPlanner::default().plan(targets, surface, tool, settings)
}
