//! The plan and the ways between as the controller's reference.

use paint_planner::control::ControlReference;
use paint_planner::onboard::{FlightPlan, Guided};
use paint_sim::flight::{Reference, ReferenceState};

use crate::adapters::{control_reference, reference_state};

/// A reference as the phases ask for it.
#[derive(Clone, Copy)]
pub(super) struct ReferencePlan<'a>(pub(super) &'a dyn Reference);

impl FlightPlan for ReferencePlan<'_> {
    fn duration(&self) -> f64 {
        self.0.duration()
    }

    fn at(&self, t: f64) -> ControlReference {
        control_reference(&self.0.at(t))
    }
}

/// What is followed, with what the plan asks of the gun; ways ask nothing of it.
pub(super) struct GuidedReference<'a>(pub(super) Guided<ReferencePlan<'a>>);

impl Reference for GuidedReference<'_> {
    fn duration(&self) -> f64 {
        f64::INFINITY
    }

    fn at(&self, t: f64) -> ReferenceState {
        self.0.plan_time(t).map_or_else(|| reference_state(&self.0.at(t)), |time| self.0.plan.0.at(time))
    }
}
