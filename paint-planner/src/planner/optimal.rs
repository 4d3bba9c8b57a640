//! The optimal planner: nozzle program, heading search, minimum snap (VR paper, section IV).

use super::Planner;
use super::finish::{Draft, finish};
use crate::clearance::Checker;
use crate::error::Error;
use crate::nozzle::{Mode, Nozzles, optimise, starts};
use crate::plan::Plan;
use crate::settings::Settings;
use crate::target::{Target, check};
use crate::world::{Surface, Tool};
use crate::{heading, route};

/// How much nearer than the target a ray from the nozzle may hit, m, before the target counts as hidden: surfaces are
/// meshes, targets need not lie exactly on them.
const OCCLUSION: f64 = 0.03;

/// The planner of the VR paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OptimalPlanner {
    /// Formulation of stage 1.
    pub mode: Mode,
}

impl Planner for OptimalPlanner {
    fn name(&self) -> &'static str {
        match self.mode {
            Mode::Repaired => "optimal",
            Mode::PaperExact => "optimal (paper-exact)",
        }
    }

    fn plan(
        &self,
        targets: &[Target],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        settings.check()?;
        check(targets)?;
        let linked = links(targets, settings.break_length);
        let starts = starts(targets, &settings.nozzle);
        let mut nozzles = optimise(targets, &starts, &linked, self.mode, &settings.nozzle)?;
        drop_hidden(targets, &mut nozzles, surface);
        let mut checker = Checker::new(surface, tool);
        let mut headings =
            heading::choose(&nozzles.states, &linked, tool, &mut checker, settings.clearance, &settings.heading);
        if headings.vehicle.iter().all(Option::is_none) {
            return Err(Error::NothingReachable { count: targets.len() });
        }
        let route = route::build(&mut headings.vehicle, &headings.joined, Some(&mut checker), settings)?;
        let draft = Draft { nozzles, vehicle: headings.vehicle, heading_cost: headings.cost, route };
        let plan = finish(&draft, targets, &mut checker, settings, false)?;
        if plan.report.clearance >= 0.0 {
            return Ok(plan);
        }
        // The curve cut a corner that its waypoints keep clear of: bind it to every one of them.
        let plan = finish(&draft, targets, &mut checker, settings, true)?;
        match plan.report.clearance {
            clearance if clearance < 0.0 => Err(Error::Collision { clearance }),
            _ => Ok(plan),
        }
    }
}

/// Which neighbouring targets are close enough to be one stroke.
pub(super) fn links(targets: &[Target], break_length: f64) -> Vec<bool> {
    targets.windows(2).map(|pair| (pair[1].point - pair[0].point).norm() <= break_length).collect()
}

/// Targets that something stands in front of are not served.
fn drop_hidden(targets: &[Target], nozzles: &mut Nozzles, surface: &dyn Surface) {
    for (target, state) in targets.iter().zip(&mut nozzles.states) {
        let hidden = state.is_some_and(|nozzle| {
            let distance = (target.point - nozzle.position).norm();
            let hit = surface.cast(&nozzle.position, &nozzle.direction, distance);
            hit.is_some_and(|hit| hit.distance < distance - OCCLUSION)
        });
        if hidden {
            *state = None;
        }
    }
}
