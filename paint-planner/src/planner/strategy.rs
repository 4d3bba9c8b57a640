//! The planners' one trait.

use crate::error::Error;
use crate::plan::Plan;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::{Surface, Tool};

/// Turns targets into a plan.
pub trait Planner {
    /// Short name for reports.
    fn name(&self) -> &'static str;

    /// Plans the whole path. Targets that cannot be served are marked in [`Plan::reachable`]; an error means that no
    /// part of the path can be flown, or that the input is unusable.
    fn plan(
        &self,
        targets: &[Target],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error>;
}
