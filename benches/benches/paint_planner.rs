//! Planning a stroke of 1000 targets on the rock, its quadratic program by two solvers, and the trajectory alone.

use std::error::Error;
use std::f64::consts::TAU;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT};
use nalgebra::Vector4;
use paint_planner::{OptimalPlanner, Planner, SmoothingPlanner, StageOneProgram, StandardForm, Trajectory};
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

    // The first program of stage 1: block-tridiagonal by the crate's own method, and as a general sparse one.
    let program = StageOneProgram::new(&targets, &settings.nozzle);
    let own = program.solve()?;
    group.bench_function("nozzle program, own interior point", |b| b.iter(|| program.solve()));
    let form = program.standard_form();
    let general = by_clarabel(&form)?;
    for (k, value) in general.iter().enumerate() {
        if (own[k / 5][k % 5] - value).abs() > 1e-5 {
            return Err("the two solvers disagree".into());
        }
    }
    group.bench_function("nozzle program, Clarabel", |b| b.iter(|| by_clarabel(&form)));

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

/// Clarabel at its own tolerances, from the triplets: what a caller would wait for.
fn by_clarabel(form: &StandardForm) -> Result<Vec<f64>, Box<dyn Error>> {
    let matrix = |rows: usize, triplets: &[(usize, usize, f64)]| {
        let (r, (c, v)): (Vec<usize>, (Vec<usize>, Vec<f64>)) = triplets.iter().map(|&(r, c, v)| (r, (c, v))).unzip();
        CscMatrix::new_from_triplets(rows, form.variables, r, c, v)
    };
    let (p, a) = (matrix(form.variables, &form.p), matrix(form.b.len(), &form.a));
    let cones = [NonnegativeConeT(form.b.len())];
    let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
    let mut solver = DefaultSolver::new(&p, &form.q, &a, &form.b, &cones, settings)?;
    solver.solve();
    Ok(solver.solution.x[..form.states].to_vec())
}
