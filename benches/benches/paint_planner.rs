//! Planning a stroke of 1000 targets on the rock, its quadratic program by two solvers, and the trajectory alone.

use std::error::Error;

use nalgebra::Vector5;
use paint_planner::nozzle::{Clarabel, InteriorPoint, PrimalDualActiveSet, QpSolver, stroke_program};
use paint_planner::plan::SmoothingPlanner;
use paint_planner::trajectory::Trajectory;
use paint_planner::{OptimalPlanner, Planner};
use paintcopter::adapters::{MeshSurface, Robot};
use paintcopter::mission::MissionSettings;
use paintcopter_benches::planner::helix;
use paintcopter_benches::{criterion, rock};
use ptu_kinematics::Ptu;

/// Targets of the stroke.
const TARGETS: usize = 1000;
/// Knots of the bare trajectory.
const KNOTS: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let MissionSettings { planner: settings, ptu, .. } = MissionSettings::default();
    let surface = rock::rock()?;
    let targets = rock::stroke(&surface, TARGETS);
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&surface.world));

    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("paint-planner");
    let planners: [&dyn Planner; 2] = [&OptimalPlanner::default(), &SmoothingPlanner];
    for planner in planners {
        planner.plan(&targets, &wall, &robot, &settings)?;
        group.bench_function(format!("{} plan of {} targets", planner.name(), targets.len()), |b| {
            b.iter(|| planner.plan(&targets, &wall, &robot, &settings));
        });
    }

    // The first program of stage 1: with the structure of its Hessian, and as a general sparse one at Clarabel's own tolerance.
    let (program, start) = stroke_program(&targets, &settings.nozzle);
    let general = Clarabel { tolerance: 1e-8, ..Clarabel::default() };
    let solvers: [(&str, &dyn QpSolver); 3] =
        [("active set", &PrimalDualActiveSet), ("interior point", &InteriorPoint), ("Clarabel", &general)];
    let mut answers = Vec::new();
    for (name, solver) in solvers {
        let mut states = start.clone();
        solver.solve(&program, &mut states)?;
        answers.push(states);
        group.bench_function(format!("nozzle program, {name}"), |b| {
            b.iter(|| solver.solve(&program, &mut start.clone()));
        });
    }
    let apart = |others: &Vec<Vector5<f64>>| answers[0].iter().zip(others).any(|(a, b)| (a - b).amax() > 1e-5);
    if answers[1..].iter().any(apart) {
        return Err("the solvers disagree".into());
    }

    let (knots, durations, rest) = helix(KNOTS);
    let trajectory = Trajectory::minimum_snap(&knots, &durations, &rest)?;
    group.bench_function(format!("minimum snap through {KNOTS} knots"), |b| {
        b.iter(|| Trajectory::minimum_snap(&knots, &durations, &rest));
    });
    group.bench_function(format!("certified extrema of {KNOTS} knots"), |b| b.iter(|| trajectory.extrema()));
    group.finish();
    criterion.final_summary();
    Ok(())
}
