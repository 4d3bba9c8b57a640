//! The optimal planner: nozzle program, heading search, minimum snap (VR paper, section IV).

use super::assemble::{ClearanceViolation, UntimedPlan, assemble_plan};
use super::solution::Plan;
use super::strategy::Planner;
use crate::clearance::ClearanceChecker;
use crate::error::Error;
use crate::heading::HeadingGraph;
use crate::minimum_snap::KnotDerivatives;
use crate::not_served::NotServed;
use crate::nozzle::{Mode, PrimalDualActiveSet, QpSolver, initial_states, optimise};
use crate::raise_clearance::{Raise, Shortfall, until_clear};
use crate::settings::Settings;
use crate::target::{Target, check, stroke_links};
use crate::trace::{event, span};
use crate::visibility::drop_hidden;
use crate::world::{Surface, Tool};
use crate::{heading, route};

/// The planner of the VR paper.
#[derive(Debug, Clone, Copy)]
pub struct OptimalPlanner<'a> {
    /// Formulation of stage 1.
    pub mode: Mode,
    /// Who solves its quadratic programs.
    pub solver: &'a dyn QpSolver,
}

impl Default for OptimalPlanner<'static> {
    fn default() -> Self {
        Self { mode: Mode::default(), solver: &PrimalDualActiveSet }
    }
}

impl Planner for OptimalPlanner<'_> {
    fn name(&self) -> &'static str {
        match self.mode {
            Mode::Sequential => "optimal",
            Mode::PaperExact => "optimal (paper-exact)",
        }
    }

    fn plan_with_clearance(
        &self,
        targets: &[Target],
        clearance: &[Option<f64>],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        span!("plan");
        settings.check()?;
        check(targets, settings.nozzle.distances())?;
        let usable = |index: &usize| clearance.get(*index).is_some_and(|c| c.is_none_or(|c| c >= 0.0));
        if let Some(index) = (0..targets.len()).find(|index| !usable(index)) {
            return Err(Error::Target { index, what: "needs a clearance of its own that is not negative" });
        }
        let linked = stroke_links(targets, settings.break_length);
        let mut initial_states = initial_states(targets, &settings.nozzle);
        if self.mode == Mode::PaperExact {
            for (start, target) in initial_states.iter_mut().zip(targets) {
                if let Some(start) = start {
                    start.facet = surface.facet(&target.point);
                }
            }
        }
        let mut nozzles = optimise(targets, &initial_states, &linked, self.mode, self.solver, &settings.nozzle)?;
        drop_hidden(targets, &mut nozzles.states, surface)?;
        event!(
            debug,
            targets = targets.len(),
            hidden = nozzles.states.iter().filter(|state| state.is_err()).count(),
            "targets that cannot be seen are left out"
        );
        let mut checker = ClearanceChecker::new(surface, tool);
        let mut graph = HeadingGraph::build(&nozzles.states, &mut checker, settings.heading.bins);
        let mut before = clearance.to_vec();
        let raise = Raise { beyond: BEYOND, most: MAX_CLEARANCE };
        until_clear(&mut clearance.to_vec(), raise, |kept, attempt| {
            let is_new = |i: &usize| kept[*i] != before[*i] || attempt == 0 && kept[*i].is_none();
            let changed: Vec<usize> = (0..kept.len()).filter(is_new).collect();
            before = kept.to_vec();
            for &i in changed.iter().filter(|&&i| kept[i].is_none()) {
                nozzles.states[i] = match nozzles.states[i] {
                    _ if attempt == 0 => Err(NotServed::Excluded),
                    state => state.and(Err(NotServed::TooNear)),
                };
            }
            graph.update(&nozzles.states, &mut checker, &changed);
            let kept_off = |kept: &Option<f64>| kept.unwrap_or(settings.clearance) + CURVE_MARGIN;
            let clearance: Vec<f64> = kept.iter().map(kept_off).collect();
            let mut headings = heading::choose_headings(
                &mut graph,
                &nozzles.states,
                &linked,
                &mut checker,
                &clearance,
                &settings.heading,
            );
            checker.check_answers()?;
            if headings.vehicle.iter().all(Result::is_err) {
                return Err(Error::NothingReachable { count: targets.len() });
            }
            let route =
                route::build(&mut headings.vehicle, &headings.joined, Some(&mut checker), &clearance, settings)?;
            let untimed = UntimedPlan {
                nozzles: nozzles.clone(),
                vehicle: headings.vehicle,
                heading_cost: headings.cost,
                route,
                start: KnotDerivatives::zeros(),
            };
            // A curve that cuts a corner its waypoints keep clear of is bound to every one of them.
            let (mut plan, mut violations) = assemble_plan(&untimed, targets, &mut checker, settings, attempt > 0)?;
            if attempt == 0 && !violations.is_empty() {
                (plan, violations) = assemble_plan(&untimed, targets, &mut checker, settings, true)?;
            }
            checker.check_answers()?;
            if violations.is_empty() {
                return Ok((plan, Vec::new()));
            }
            event!(warn, attempt, violations = violations.len(), "plan refused: too near to the surface");
            if attempt + 1 < MAX_ATTEMPTS {
                let last = attempt + LAST_ATTEMPTS >= MAX_ATTEMPTS;
                let shortfalls = violations.iter().flat_map(|violation| shortfalls(&plan, violation, last)).collect();
                return Ok((plan, shortfalls));
            }
            match plan.report.clearance {
                clearance if clearance > 0.0 => Ok((plan, Vec::new())),
                clearance => Err(Error::Collision { clearance }),
            }
        })
    }
}

/// Plans made before a collision is final.
const MAX_ATTEMPTS: usize = 8;
/// How many of them give up what still comes too near.
const LAST_ATTEMPTS: usize = 4;
/// More clearance than is asked of the curve at its waypoints, m: between them it is certified to what is asked.
const CURVE_MARGIN: f64 = 0.002;
/// More clearance than is missing, m.
const BEYOND: f64 = 0.02;
/// Clearance beyond which a target that still causes violations is given up, m.
const MAX_CLEARANCE: f64 = 0.2;

/// The targets on both sides of a violation; at the ends of a flight that comes too near more clearance does not help.
fn shortfalls(plan: &Plan, violation: &ClearanceViolation, last: bool) -> impl Iterator<Item = Shortfall> {
    let about = plan.targets_about(violation.waypoint);
    let hopeless = last || !matches!(about, [Some(a), Some(b)] if b <= a + 1);
    let missing = violation.missing;
    about.into_iter().flatten().map(move |target| Shortfall { target, missing, hopeless })
}
