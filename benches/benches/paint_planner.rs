//! Planning a stroke of 1000 targets on the rock, and the trajectory alone.

use std::error::Error;
use std::f64::consts::TAU;

use nalgebra::Vector4;
use paint_planner::{OptimalPlanner, Planner, SmoothingPlanner, Trajectory};
use paintcopter_benches::{criterion, rock};
use paintcopter_examples::adapters::{MeshSurface, Robot};
use paintcopter_examples::mission::MissionSettings;
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

    // A helix at half a metre per second.
    let knot = |k: usize| {
        let turn = TAU * k as f64 / 100.0;
        Vector4::new(turn.cos(), turn.sin(), 0.01 * k as f64, turn)
    };
    let knots: Vec<Vector4<f64>> = (0..KNOTS).map(knot).collect();
    let durations: Vec<f64> = knots.windows(2).map(|w| (w[1].xyz() - w[0].xyz()).norm() / 0.5).collect();
    let rest: Vec<bool> = (0..KNOTS).map(|k| k == 0 || k == KNOTS - 1).collect();
    let trajectory = Trajectory::minimum_snap(&knots, &durations, &rest)?;
    group.bench_function(format!("minimum snap through {KNOTS} knots"), |b| {
        b.iter(|| Trajectory::minimum_snap(&knots, &durations, &rest));
    });
    group.bench_function(format!("certified extrema of {KNOTS} knots"), |b| b.iter(|| trajectory.extrema()));
    group.finish();
    criterion.final_summary();
    Ok(())
}
