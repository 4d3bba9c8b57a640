//! The planners' one trait.

use super::solution::Plan;
use crate::error::Error;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::{Surface, Tool};

/// Turns targets into a plan.
pub trait Planner {
    /// Short name for reports.
    fn name(&self) -> &'static str;

    /// Plans the whole path with a clearance of its own for every target, m, in the place of `settings.clearance`: what a rehearsal
    /// has shown to be needed. A flight between two strokes keeps what both of its ends keep; a target without a clearance is not
    /// served.
    ///
    /// Targets that cannot be served are marked in [`Plan::reachable`]; an error means that no part of the path can be flown, or
    /// that the input is unusable.
    ///
    /// # Errors
    /// [`Error::Setting`], [`Error::Target`] (also where a clearance is missing, negative or not a number), [`Error::World`],
    /// [`Error::NothingReachable`], [`Error::NoTransit`], [`Error::Collision`].
    fn plan_with_clearance(
        &self,
        targets: &[Target],
        clearance: &[Option<f64>],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error>;

    /// Plans the whole path with `settings.clearance` at every target.
    ///
    /// # Errors
    /// As [`plan_with_clearance`](Self::plan_with_clearance).
    fn plan(
        &self,
        targets: &[Target],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        self.plan_with_clearance(targets, &vec![Some(settings.clearance); targets.len()], surface, tool, settings)
    }
}
