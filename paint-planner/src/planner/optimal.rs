//! The optimal planner: nozzle program, heading search, minimum snap (VR paper, section IV).

use super::assemble::{ClearanceViolation, UntimedPlan, assemble_plan};
use super::strategy::Planner;
use crate::clearance::ClearanceChecker;
use crate::error::Error;
use crate::heading::HeadingGraph;
use crate::minimum_snap::KnotDerivatives;
use crate::nozzle::{Mode, Nozzles, PrimalDualActiveSet, QpSolver, initial_states, optimise};
use crate::plan::{NotServed, Plan};
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

    fn plan(
        &self,
        targets: &[Target],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        self.plan_with_clearance(targets, &vec![settings.clearance; targets.len()], surface, tool, settings)
    }
}

impl OptimalPlanner<'_> {
    /// The same with a clearance of its own for every target, m, in the place of `settings.clearance`: what a rehearsal in wind
    /// has shown to be needed. A flight between two strokes keeps what both of its ends keep.
    ///
    /// # Errors
    /// As [`Planner::plan`]; [`Error::Target`] where a clearance is missing, negative or not a number.
    pub fn plan_with_clearance(
        &self,
        targets: &[Target],
        clearance: &[f64],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        span!("plan");
        settings.check()?;
        check(targets)?;
        let usable = |index: &usize| clearance.get(*index).is_some_and(|c| *c >= 0.0);
        if let Some(index) = (0..targets.len()).find(|index| !usable(index)) {
            return Err(Error::Target { index, what: "needs a clearance of its own that is not negative" });
        }
        let linked = stroke_links(targets, settings.break_length);
        let initial_states = initial_states(targets, &settings.nozzle);
        let mut not_served = vec![None; targets.len()];
        explain(&mut not_served, &initial_states, NotServed::OutOfReach);
        let mut nozzles = optimise(targets, &initial_states, &linked, self.mode, self.solver, &settings.nozzle)?;
        drop_hidden(targets, &mut nozzles.states, surface)?;
        explain(&mut not_served, &nozzles.states, NotServed::Hidden);
        event!(
            debug,
            targets = targets.len(),
            hidden = nozzles.states.iter().filter(|state| state.is_none()).count(),
            "targets that cannot be seen are left out"
        );
        let mut checker = ClearanceChecker::new(surface, tool);
        let mut clearance = clearance.to_vec();
        let mut graph = HeadingGraph::build(&nozzles.states, &mut checker, settings.heading.bins);
        let mut attempt = 0;
        loop {
            let mut headings = heading::choose_headings(
                &mut graph,
                &nozzles.states,
                &linked,
                &mut checker,
                &clearance,
                &settings.heading,
            );
            checker.check_answers()?;
            if headings.vehicle.iter().all(Option::is_none) {
                return Err(Error::NothingReachable { count: targets.len() });
            }
            let mut not_served_here = not_served.clone();
            explain(&mut not_served_here, &headings.vehicle, NotServed::NoHeading);
            let route =
                route::build(&mut headings.vehicle, &headings.joined, Some(&mut checker), &clearance, settings)?;
            explain(&mut not_served_here, &headings.vehicle, NotServed::NoTransit);
            let untimed = UntimedPlan {
                nozzles: nozzles.clone(),
                vehicle: headings.vehicle,
                not_served: not_served_here,
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
                return Ok(plan);
            }
            attempt += 1;
            event!(warn, attempt, violations = violations.len(), "plan refused: too near to the surface");
            if attempt == MAX_ATTEMPTS {
                return if plan.report.clearance > 0.0 {
                    Ok(plan)
                } else {
                    Err(Error::Collision { clearance: plan.report.clearance })
                };
            }
            let before = clearance.clone();
            for violation in violations {
                raise_clearance(&plan, &violation, &mut clearance, &mut nozzles);
            }
            explain(&mut not_served, &nozzles.states, NotServed::TooNear);
            let raised: Vec<usize> = (0..clearance.len()).filter(|&i| clearance[i] > before[i]).collect();
            graph.update(&nozzles.states, &mut checker, &raised);
        }
    }
}

/// Notes why targets have no state, for those that had one so far.
fn explain<T>(not_served: &mut [Option<NotServed>], states: &[Option<T>], why: NotServed) {
    for (reason, _) in not_served.iter_mut().zip(states).filter(|(reason, state)| reason.is_none() && state.is_none()) {
        *reason = Some(why);
    }
}

/// Plans made before a collision is final.
const MAX_ATTEMPTS: usize = 8;
/// Targets on either side of a violation that are kept farther off.
const NEIGHBOURS: usize = 2;
/// Clearance beyond which a target that still causes violations is given up, m.
const MAX_CLEARANCE: f64 = 0.2;

/// Asks for more clearance about a violation; targets that have had their chances, and those at the ends of a flight
/// that comes too near, are given up.
fn raise_clearance(plan: &Plan, violation: &ClearanceViolation, clearance: &mut [f64], nozzles: &mut Nozzles) {
    let before = plan.waypoints[..=violation.waypoint].iter().rev().find_map(|w| w.target);
    let after = plan.waypoints[violation.waypoint + 1..].iter().find_map(|w| w.target);
    let on_stroke = matches!((before, after), (Some(a), Some(b)) if b <= a + 1);
    for target in before.into_iter().chain(after) {
        for neighbour in target.saturating_sub(NEIGHBOURS)..(target + NEIGHBOURS + 1).min(clearance.len()) {
            clearance[neighbour] += violation.missing + 0.02;
            if !on_stroke || clearance[neighbour] > MAX_CLEARANCE {
                nozzles.states[neighbour] = None;
            }
        }
    }
}
