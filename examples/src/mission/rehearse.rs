//! A plan is flown in simulated wind before it counts: where the robot then comes too near the surface, the plan keeps farther
//! off, and what cannot be served that way stays bare.

use std::time::Instant;

use paint_planner::{Error, OptimalPlanner, Plan, Surface, Target};
use paint_sim::flight::FlightSample;
use ptu_kinematics::Joints;

use super::error::MissionError;
use super::settings::MissionSettings;
use super::simulated_flight::{flight_settings, fly_plan};
use crate::adapters::{MeshSurface, Robot};
use crate::surface::PaintSurface;

/// Plans that are flown before what still comes too near is left bare.
const ROUNDS: usize = 4;
/// Winds in which each of them is flown.
const WINDS: u64 = 2;
/// What the robot keeps from the surface in a rehearsal, metres: the wind of the flight itself is not known.
const MARGIN: f64 = 0.015;
/// More clearance than is missing, metres: the next plan comes near elsewhere.
const BEYOND: f64 = 0.01;
/// Targets on either side of a near miss that are kept farther off.
const NEIGHBOURS: usize = 2;
/// A clearance that no target has, metres.
pub(super) const BARE: f64 = 10.0;
/// Samples of a flight between two looks at the gap: 50 ms, 2.5 cm at full speed.
pub(super) const GAP_STRIDE: usize = 5;
/// Winds of the rehearsals are not that of the flight.
const SALT: u64 = 0x5EED_0F4E;

/// A plan that has been rehearsed.
pub(super) struct Rehearsed {
    pub(super) plan: Plan,
    /// Time that all plans took, seconds on one core.
    pub(super) seconds: f64,
    /// Targets that keep more clearance than the settings ask for.
    pub(super) kept_off: usize,
    /// Targets given up because of near misses.
    pub(super) left_bare: usize,
    /// Clearance of each target, metres.
    pub(super) clearance: Vec<f64>,
}

/// Plans, flies, and plans again until no wind brings the robot too near, [`ROUNDS`] times at most; then what still does is left bare.
///
/// `clearance` of each target to begin with, metres. `None` where nothing can be reached.
pub(super) fn rehearsed_plan(
    targets: &[Target],
    mut clearance: Vec<f64>,
    surface: &PaintSurface,
    robot: &Robot,
    settings: &MissionSettings,
    planner: &paint_planner::Settings,
) -> Result<Option<Rehearsed>, MissionError> {
    let mut seconds = 0.0;
    let mut plan_with = |clearance: &[f64]| {
        let clock = Instant::now();
        let mesh = MeshSurface(&surface.world);
        let obstacles = settings.constraints.around(&mesh);
        let plan = OptimalPlanner::default().plan_with_clearance(targets, clearance, &obstacles, robot, planner);
        seconds += clock.elapsed().as_secs_f64();
        plan
    };
    let mut plan = match plan_with(&clearance) {
        Err(Error::NothingReachable { .. }) => return Ok(None),
        plan => plan?,
    };
    for round in 0..=ROUNDS {
        let missing = missing_clearance(&plan, surface, robot, settings, targets.len())?;
        if missing.iter().all(|missing| *missing == 0.0) {
            break;
        }
        for (k, _) in missing.iter().enumerate().filter(|(_, missing)| **missing > 0.0) {
            let about = k.saturating_sub(NEIGHBOURS)..(k + NEIGHBOURS + 1).min(targets.len());
            clearance[about].iter_mut().for_each(|c| {
                *c = if round < ROUNDS { *c + missing[k] + BEYOND } else { BARE };
            });
        }
        plan = match plan_with(&clearance) {
            Err(Error::NothingReachable { .. }) => return Ok(None),
            plan => plan?,
        };
    }
    let count = |bare: bool| clearance.iter().filter(|c| **c > planner.clearance && (**c >= BARE) == bare).count();
    Ok(Some(Rehearsed { plan, seconds, kept_off: count(false), left_bare: count(true), clearance }))
}

/// How much nearer than [`MARGIN`] the robot comes about each target in the worst of the winds, metres.
fn missing_clearance(
    plan: &Plan,
    surface: &PaintSurface,
    robot: &Robot,
    settings: &MissionSettings,
    targets: usize,
) -> Result<Vec<f64>, MissionError> {
    let mut missing = vec![0.0_f64; targets];
    let mesh = MeshSurface(&surface.world);
    let obstacles = settings.constraints.around(&mesh);
    for wind in 0..WINDS {
        let seed = settings.seed ^ SALT.wrapping_add(wind);
        let log = fly_plan(plan, &surface.world, robot, settings, &flight_settings(plan, robot.tether, seed))?;
        for sample in log.samples.iter().step_by(GAP_STRIDE) {
            let short = MARGIN - gap(robot, &obstacles, sample, MARGIN);
            if short > 0.0 {
                let at = plan.waypoints.partition_point(|w| w.time <= sample.time).clamp(1, plan.waypoints.len());
                let before = plan.waypoints[..at].iter().rev().find_map(|w| w.target);
                let after = plan.waypoints[at..].iter().find_map(|w| w.target);
                for target in before.into_iter().chain(after) {
                    missing[target] = missing[target].max(short);
                }
            }
        }
    }
    Ok(missing)
}

/// Least distance between the robot and what is in its way at a moment of a flight, metres; at most `below`, negative where they overlap.
pub(super) fn gap(robot: &Robot, obstacles: &dyn Surface, sample: &FlightSample, below: f64) -> f64 {
    let joints = Joints { pan: sample.pan_tilt[0], tilt: sample.pan_tilt[1] };
    let mut spheres = Vec::new();
    robot.spheres_at(&sample.world_from_body, &joints, &mut spheres);
    let gap = |(centre, radius): &(_, f64)| obstacles.distance(centre, radius + below) - radius;
    spheres.iter().map(gap).fold(below, f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::test_panel;
    use super::*;
    use ptu_kinematics::Ptu;

    #[test]
    fn what_comes_too_near_in_wind_keeps_off_or_stays_bare() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let (surface, targets) = (test_panel::surface(), test_panel::targets());
        let planner = paint_planner::Settings { clearance: 0.0, ..settings.planner.clone() };
        let rehearse = |robot: &Robot| {
            let clearance = vec![planner.clearance; targets.len()];
            rehearsed_plan(&targets, clearance, &surface, robot, &settings, &planner).unwrap().unwrap()
        };
        let mut robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let roomy = rehearse(&robot);
        assert_eq!((roomy.kept_off, roomy.left_bare), (0, 0));
        // Rotors that reach nearly to the wall while the nozzle is at work.
        robot.body_radius = 0.65;
        let tight = rehearse(&robot);
        assert!(tight.kept_off > 0, "no plan of this comes near enough to be rehearsed");
        let short = missing_clearance(&tight.plan, &surface, &robot, &settings, targets.len()).unwrap();
        assert!(short.iter().all(|short| *short == 0.0), "{short:?}");
    }
}
