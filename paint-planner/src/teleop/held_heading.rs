//! The vehicle as long as it keeps the heading that it has, or nearly.

use nalgebra::Point3;

use crate::error::Error;
use crate::plan::{Plan, plan};
use crate::settings::Settings;
use crate::target::{NozzleState, Target};
use crate::world::{Surface, Tool, VehicleState};

/// How far the vehicle may turn in a segment, and the pan that may be needed for it, rad, the first that serves all targets: none, which
/// is a little more than half a bin of the planner's headings; a little; whatever it takes. The pan joint ends at 1.57, and a turn costs
/// more than the segment itself: 0.9 of it are used before the vehicle turns at all, and 1.1 before it turns far.
const TURNS: [[f64; 2]; 3] = [[0.05, 0.9], [0.2, 1.1], [f64::INFINITY, f64::INFINITY]];

/// A tool that neither turns by more than `turn[0]` from a heading nor pans by more than `turn[1]`, rad.
pub(super) struct HeldHeading<'a> {
    tool: &'a dyn Tool,
    heading: f64,
    turn: [f64; 2],
}

impl<'a> HeldHeading<'a> {
    /// The two narrow ones, for a vehicle in motion that cannot turn far.
    pub(super) fn nearly(tool: &'a dyn Tool, heading: f64) -> impl Iterator<Item = Self> {
        TURNS[..2].iter().map(move |&turn| Self { tool, heading, turn })
    }
}

impl Tool for HeldHeading<'_> {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let turned = (heading - self.heading).sin().atan2((heading - self.heading).cos()).abs();
        let held = |state: &VehicleState| turned <= self.turn[0] && state.pan.abs() <= self.turn[1];
        self.tool.vehicle(nozzle, heading).filter(held)
    }

    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        self.tool.spheres(vehicle, out);
    }

    fn permits(&self, vehicle: &VehicleState) -> bool {
        self.tool.permits(vehicle)
    }
}

/// Plans with the heading that the vehicle has, or nearly, if that serves every target: segments that follow each other are then flown
/// without a turn in between, which would cost more than the segment itself.
pub(super) fn plan_with_held_heading(
    targets: &[Target],
    heading: f64,
    surface: &dyn Surface,
    tool: &dyn Tool,
    settings: &Settings,
) -> Result<Plan, Error> {
    let mut planned = Err(Error::NothingReachable { count: targets.len() });
    for turn in TURNS {
        planned = plan(targets, surface, &HeldHeading { tool, heading, turn }, settings);
        if planned.as_ref().is_ok_and(|plan| plan.report.served == targets.len()) {
            break;
        }
    }
    planned
}
