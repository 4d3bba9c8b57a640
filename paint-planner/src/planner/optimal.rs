//! The optimal planner: nozzle program, heading search, minimum snap (VR paper, section IV).

use super::Planner;
use super::finish::{Draft, Touch, finish};
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
        let mut clearance = vec![settings.clearance; targets.len()];
        let mut attempt = 0;
        loop {
            let mut headings =
                heading::choose(&nozzles.states, &linked, tool, &mut checker, &clearance, &settings.heading);
            if headings.vehicle.iter().all(Option::is_none) {
                return Err(Error::NothingReachable { count: targets.len() });
            }
            let route = route::build(&mut headings.vehicle, &headings.joined, Some(&mut checker), settings)?;
            let draft =
                Draft { nozzles: nozzles.clone(), vehicle: headings.vehicle, heading_cost: headings.cost, route };
            // A curve that cuts a corner its waypoints keep clear of is bound to every one of them.
            let (mut plan, mut touches) = finish(&draft, targets, &mut checker, settings, attempt > 0)?;
            if attempt == 0 && !touches.is_empty() {
                (plan, touches) = finish(&draft, targets, &mut checker, settings, true)?;
            }
            if touches.is_empty() {
                return Ok(plan);
            }
            attempt += 1;
            if attempt == ATTEMPTS {
                return Err(Error::Collision { clearance: plan.report.clearance });
            }
            for touch in touches {
                keep_off(&plan, &touch, &mut clearance, &mut nozzles);
            }
        }
    }
}

/// Plans made before a collision is final.
const ATTEMPTS: usize = 8;
/// Targets on either side of a touch that are kept farther off.
const REACH: usize = 2;
/// Clearance beyond which a target that still causes touches is given up, m.
const GIVE_UP: f64 = 0.2;

/// Asks for more clearance about a touch; targets that have had their chances, and those at the ends of a flight that
/// touches, are given up.
fn keep_off(plan: &Plan, touch: &Touch, clearance: &mut [f64], nozzles: &mut Nozzles) {
    let before = plan.waypoints[..=touch.waypoint].iter().rev().find_map(|w| w.target);
    let after = plan.waypoints[touch.waypoint + 1..].iter().find_map(|w| w.target);
    let on_stroke = matches!((before, after), (Some(a), Some(b)) if b <= a + 1);
    for target in before.into_iter().chain(after) {
        for near in target.saturating_sub(REACH)..(target + REACH + 1).min(clearance.len()) {
            clearance[near] += touch.depth + 0.02;
            if !on_stroke || clearance[near] > GIVE_UP {
                nozzles.states[near] = None;
            }
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
