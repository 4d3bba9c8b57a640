//! The planner beside general solvers: its programs in a form that they read, and its own figures.

mod segments;
#[path = "../../paint-planner/tests/it/walls.rs"]
#[allow(dead_code, reason = "the tests' wall stands for itself")]
mod walls;

use std::error::Error;
use std::f64::consts::TAU;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3, Vector4, Vector5};
use paint_planner::heading::{HeadingSettings, HeadingTable};
use paint_planner::nozzle::{
    Clarabel, InteriorPoint, NozzleSettings, PrimalDualActiveSet, QpSolver, StandardForm, stroke_program,
};
use paint_planner::stroke_order::{StrokeEnds, order_strokes, transit_lower_bound};
use paint_planner::timing::TimingPolicy;
use paint_planner::trajectory::Trajectory;
use paint_planner::{OptimalPlanner, Plan, Planner, Settings, Target};
use paintcopter::adapters::{MeshSurface, Robot};
use paintcopter::mission::MissionSettings;
use ptu_kinematics::Ptu;
use serde_json::json;

use crate::cpu::median_seconds;
use crate::npy::save;
use crate::{Rng, rock, state_programs};
use segments::segments;
use walls::{Arm, Wall};

/// States of the paths; the shortest is for solvers of dense programs.
const STATES: [usize; 3] = [20, 2000, 20_000];
/// Distance of the targets, metres, and the spread of their normals.
const SPACING: f64 = 0.01;
const NORMAL_NOISE: f64 = 0.12;
/// Knots of the bare trajectory.
const KNOTS: usize = 1000;
/// Turns of the scene, and paths over the rock.
const TURNS: usize = 200;
const PATHS: usize = 1000;
/// A limit of the joints' rates that most of these paths would exceed, rad/s.
const SLOW_JOINTS: f64 = 0.2;
/// Sets of strokes ordered.
const ORDERS: u64 = 20;

type AnyError = Box<dyn Error>;
/// Measures a figure and prints it.
type Figure<'a> = dyn Fn() -> Result<(), AnyError> + 'a;

/// A long stroke over a displaced wall, its normals noisy.
fn targets(count: usize) -> Vec<Target> {
    let mut rng = Rng::new(count as u64);
    let mut noise = || NORMAL_NOISE * (rng.unit() + rng.unit() + rng.unit() - 1.5) * 2.0;
    let mut target = |k: usize| {
        let s = SPACING * k as f64;
        let point = Point3::new(0.05 * (TAU * s / 1.6).sin(), s, 2.0 + 0.2 * (TAU * s / 2.3).cos());
        let normal = UnitVector3::new_normalize(Vector3::new(-1.0, noise(), noise()));
        Target { point, normal, dose: 2e-6, time: None, stand_off: None }
    };
    (0..count).map(&mut target).collect()
}

/// Writes the programs of stage 1 as `NumPy` arrays: the upper triangle of P and A as rows, columns and values, q, b, the number of
/// states' variables and the penalty.
///
/// # Errors
/// Files that cannot be written.
pub fn write(folder: &Path) -> Result<(), AnyError> {
    for count in STATES {
        let folder = folder.join(format!("path_{count}"));
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let (program, _) = stroke_program(&targets(count), &NozzleSettings::default());
        let form = StandardForm::new(&program);
        for (name, triplets) in [("p", &form.p), ("a", &form.a)] {
            save(&folder, &format!("{name}_row"), triplets.iter().map(|t| t.0 as f64))?;
            save(&folder, &format!("{name}_column"), triplets.iter().map(|t| t.1 as f64))?;
            save(&folder, &format!("{name}_value"), triplets.iter().map(|t| t.2))?;
        }
        save(&folder, "q", form.q.iter().copied())?;
        save(&folder, "b", form.b.iter().copied())?;
        save(&folder, "states", std::iter::once(form.states as f64))?;
    }
    state_programs::write(&folder.join("states"))
}

/// Prints our figures on the same programs, and those of the rest of a plan: those whose name contains `only`.
///
/// # Errors
/// What the planner refuses.
pub fn run(runs: usize, only: &str) -> Result<(), AnyError> {
    let figures: [(&str, &Figure<'_>); 13] = [
        ("state_programs", &|| state_programs::run(runs)),
        ("path_20", &|| path(STATES[0], runs)),
        ("path_2000", &|| path(STATES[1], runs)),
        ("path_20000", &|| path(STATES[2], runs)),
        ("heading_by_dp", &|| headings(runs)),
        ("minimum_snap", &|| trajectory(runs)),
        ("plan_of_1000_targets", &|| whole_plan(runs)),
        ("transits_over_lower_bound", &stroke_orders),
        ("volume_per_mm", &preserved_gradients),
        ("segment_of_0.5_m", &|| segments(0.5)),
        ("segment_of_1_m", &|| segments(1.0)),
        ("turned_scenes", &turned_scenes),
        ("limits_over_random_paths", &random_paths),
    ];
    figures.into_iter().filter(|(name, _)| name.contains(only)).try_for_each(|(_, figure)| figure())
}

fn path(count: usize, runs: usize) -> Result<(), AnyError> {
    let (program, start) = stroke_program(&targets(count), &NozzleSettings::default());
    let form = StandardForm::new(&program);
    let solved = |solver: &dyn QpSolver| -> Result<(Vec<Vector5<f64>>, usize), paint_planner::Error> {
        let mut states = start.clone();
        let outcome = solver.solve(&program, &mut states)?;
        Ok((states, outcome.steps))
    };
    let (own, steps) = solved(&PrimalDualActiveSet)?;
    let (_, interior_steps) = solved(&InteriorPoint)?;
    let (exact, _) = solved(&Clarabel::default())?;
    let off = own.iter().zip(&exact).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
    let (objective, violation) = quality(&form, &own);
    let cpu_ms = 1e3 * median_seconds(runs, || solved(&PrimalDualActiveSet));
    let interior_ms = 1e3 * median_seconds(runs, || solved(&InteriorPoint));
    println!(
        "{}",
        json!({
            "fig": format!("path_{count}"), "peer": "paint-planner", "cpu_ms": cpu_ms, "steps": steps, "objective": objective,
            "violation": violation, "off_clarabel_1e-12": off, "interior_point_cpu_ms": interior_ms,
            "interior_point_steps": interior_steps,
        })
    );
    Ok(())
}

/// Cost with every soft row relaxed as far as it is exceeded, and the largest excess of a hard one.
fn quality(form: &StandardForm, states: &[Vector5<f64>]) -> (f64, f64) {
    let x: Vec<f64> = states.iter().flat_map(|s| s.iter().copied()).collect();
    let mut excess: Vec<f64> = form.b.iter().map(|b| -b).collect();
    let mut relaxation = vec![None; form.b.len()];
    for &(row, column, value) in &form.a {
        match x.get(column) {
            Some(x) => excess[row] += value * x,
            None => relaxation[row] = Some(column),
        }
    }
    let rows = excess.len() - (form.variables - form.states);
    let mut objective: f64 = form.q.iter().zip(&x).map(|(q, x)| q * x).sum();
    for &(row, column, value) in &form.p {
        objective += if row == column { 0.5 } else { 1.0 } * value * x[row] * x[column];
    }
    let mut violation = 0.0_f64;
    for (excess, relaxation) in excess[..rows].iter().zip(&relaxation) {
        match relaxation {
            Some(column) => objective += form.q[*column] * excess.max(0.0),
            None => violation = violation.max(*excess),
        }
    }
    (objective, violation)
}

/// A helix at half a metre per second: knots (metres, and the heading in radians), seconds between them, and where it rests.
pub fn helix(count: usize) -> (Vec<Vector4<f64>>, Vec<f64>, Vec<bool>) {
    let knot = |k: usize| {
        let turn = TAU * k as f64 / 100.0;
        Vector4::new(turn.cos(), turn.sin(), 0.01 * k as f64, turn)
    };
    let knots: Vec<Vector4<f64>> = (0..count).map(knot).collect();
    let durations = knots.windows(2).map(|w| (w[1].xyz() - w[0].xyz()).norm() / 0.5).collect();
    (knots, durations, (0..count).map(|k| k == 0 || k + 1 == count).collect())
}

/// Headings of 2000 nozzle states over the rock in steps of a degree: the optimum, and the paper's choice one after the other.
fn headings(runs: usize) -> Result<(), AnyError> {
    let MissionSettings { planner: settings, ptu, .. } = MissionSettings::default();
    let surface = rock::rock()?;
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&surface.world));
    let targets = rock::stroke(&surface, 2000);
    let nozzles = OptimalPlanner::default().plan(&targets, &wall, &robot, &settings)?.nozzle;
    // As wide a window as with bins of five degrees.
    let heading = HeadingSettings { bins: 360, window: 5 * settings.heading.window, ..settings.heading };
    let table = HeadingTable::new(&nozzles, &wall, &robot, settings.clearance, heading.bins)?;
    let (best, greedy) = (table.optimum(&heading), table.one_after_the_other(&heading));
    let mut never = true;
    for from in (0..nozzles.len() - 40).step_by(40) {
        let part = HeadingTable::new(&nozzles[from..from + 40], &wall, &robot, settings.clearance, heading.bins)?;
        never &= part.optimum(&heading).cost <= part.one_after_the_other(&heading).cost;
    }
    let cpu_ms = 1e3 * median_seconds(runs, || Ok::<_, paint_planner::Error>(table.optimum(&heading)));
    println!(
        "{}",
        json!({
            "fig": "heading_by_dp", "peer": "paint-planner", "states": nozzles.len(), "bins": heading.bins, "cpu_ms": cpu_ms,
            "cost": best.cost, "cost_one_after_the_other": greedy.cost, "never_costlier": never && best.cost <= greedy.cost,
        })
    );
    Ok(())
}

fn trajectory(runs: usize) -> Result<(), AnyError> {
    let (knots, durations, rest) = helix(KNOTS);
    Trajectory::minimum_snap(&knots, &durations, &rest)?;
    let cpu_ms = 1e3 * median_seconds(runs, || Trajectory::minimum_snap(&knots, &durations, &rest));
    println!("{}", json!({ "fig": "minimum_snap_1000_knots_4_axes", "peer": "paint-planner", "cpu_ms": cpu_ms }));
    Ok(())
}

fn whole_plan(runs: usize) -> Result<(), AnyError> {
    let MissionSettings { planner: settings, ptu, .. } = MissionSettings::default();
    let surface = rock::rock()?;
    let targets = rock::stroke(&surface, 1000);
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&surface.world));
    OptimalPlanner::default().plan(&targets, &wall, &robot, &settings)?;
    let cpu_ms = 1e3 * median_seconds(runs, || OptimalPlanner::default().plan(&targets, &wall, &robot, &settings));
    println!("{}", json!({ "fig": "plan_of_1000_targets", "peer": "paint-planner", "cpu_ms": cpu_ms }));
    Ok(())
}

/// Strokes of up to a metre on a wall of five: time of the transits over the lower bound of any order.
fn stroke_orders() -> Result<(), AnyError> {
    let settings = Settings::default();
    let mut over = Vec::new();
    for seed in 0..ORDERS {
        let mut rng = Rng::new(seed);
        let end = |y: f64, z: f64| Target {
            point: Point3::new(0.0, y, z),
            normal: -Vector3::x_axis(),
            dose: 0.0,
            time: None,
            stand_off: None,
        };
        let stroke = |_| {
            let (y, z) = (rng.between(0.0, 5.0), rng.between(0.0, 5.0));
            StrokeEnds { first: end(y, z), last: end(y + rng.unit(), z + rng.unit() - 0.5) }
        };
        let strokes: Vec<StrokeEnds> = (0..120).map(stroke).collect();
        let order = order_strokes(&strokes, None, &settings)?;
        over.push(order.transit_time / transit_lower_bound(&strokes, None, &settings, 300)?);
    }
    let (mean, largest) = (over.iter().sum::<f64>() / over.len() as f64, over.iter().copied().fold(0.0, f64::max));
    println!(
        "{}",
        json!({
            "fig": "transits_over_lower_bound", "peer": "paint-planner", "orders": ORDERS, "strokes": 120, "mean": mean,
            "largest": largest,
        })
    );
    Ok(())
}

/// Time stamps up to four times too fast: how far the volume on a millimetre of the stroke is from the dose.
fn preserved_gradients() -> Result<(), AnyError> {
    let MissionSettings { planner: mut settings, ptu, .. } = MissionSettings::default();
    settings.timing.policy = TimingPolicy::GradientPreserving;
    let surface = rock::rock()?;
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&surface.world));
    for speed in [0.3, 0.5, 0.75, 1.0] {
        let mut time = 0.0;
        let mut targets = rock::stroke(&surface, 100);
        for k in 0..targets.len() {
            targets[k].time = Some(time);
            let step = targets.get(k + 1).map_or(0.0, |next| (next.point - targets[k].point).norm());
            time += step / (speed * (1.0 + 0.3 * (0.2 * k as f64).sin()));
        }
        let plan = OptimalPlanner::default().plan(&targets, &wall, &robot, &settings)?;
        let (mut worst, mut length, mut volume) = (0.0_f64, 0.0, 0.0);
        let steps = (plan.trajectory.duration() / 2e-5) as usize;
        let mut before = plan.setpoint(0.0);
        for k in 1..=steps {
            let here = plan.setpoint(k as f64 * 2e-5);
            length += (here.aim - before.aim).norm();
            volume += 0.5 * (here.flow + before.flow) * 2e-5;
            if length >= 1e-3 {
                worst = worst.max((volume / (rock::DOSE * length) - 1.0).abs());
                (length, volume) = (0.0, 0.0);
            }
            before = here;
        }
        println!(
            "{}",
            json!({
                "fig": "volume_per_mm", "peer": "paint-planner", "asked_m_s": speed, "slowdown": plan.report.stretch,
                "largest_error": worst,
            })
        );
    }
    Ok(())
}

/// The same scene turned about the vertical: how far the plans, turned back, lie apart.
fn turned_scenes() -> Result<(), AnyError> {
    let plan = |turn: f64| {
        let wall = Wall { turn, ..Wall::bumpy(0.12) };
        OptimalPlanner::default().plan(&wall.rows(1.0, 2, 0.2), &wall, &Arm::default(), &Settings::default())
    };
    let mut rng = Rng::new(7);
    let straight = plan(0.0)?;
    let mut apart = 0.0_f64;
    for _ in 0..TURNS {
        let turn = rng.between(0.0, TAU);
        let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -turn);
        let back = Isometry3::from_parts(Translation3::identity(), back);
        let turned = plan(turn)?;
        for (a, b) in straight.nozzle.iter().zip(&turned.nozzle) {
            apart = apart.max((back * b.position - a.position).norm());
            apart = apart.max((back * b.direction.into_inner() - a.direction.into_inner()).norm());
        }
    }
    println!(
        "{}",
        json!({ "fig": "turned_scenes", "peer": "paint-planner", "turns": TURNS, "largest_difference_m": apart })
    );
    Ok(())
}

/// Random walks over the rock: moments at which a sampled trajectory exceeds a limit, and time against that at the speed asked for. Each is
/// planned once more for slow joints, whose limit binds.
fn random_paths() -> Result<(), AnyError> {
    let MissionSettings { planner: settings, ptu, .. } = MissionSettings::default();
    let surface = rock::rock()?;
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&surface.world));
    let mut rng = Rng::new(11);
    let mut slow = settings.clone();
    slow.timing.max_joint_rate = SLOW_JOINTS;
    let (mut planned, mut refused) = (0, 0);
    // As usual, and with slow joints.
    let (mut moments, mut violations, mut joint_rate) = ([0_u64; 2], [0_u64; 2], [0.0_f64; 2]);
    let mut ratios = Vec::new();
    for _ in 0..PATHS {
        let mut at =
            [rng.between(20.0, surface.width() as f64 - 20.0), rng.between(20.0, surface.height() as f64 - 20.0)];
        let mut course = rng.between(0.0, TAU);
        let mut targets = Vec::new();
        for _ in 0..40 {
            targets.extend(surface.lift(at[0], at[1]).map(|(point, normal)| Target {
                point,
                normal,
                dose: rock::DOSE,
                time: None,
                stand_off: None,
            }));
            course += rng.between(-0.6, 0.6);
            at = [at[0] + 2.0 * course.cos(), at[1] + 2.0 * course.sin()];
        }
        let plan = |settings: &Settings| OptimalPlanner::default().plan(&targets, &wall, &robot, settings);
        let (Ok(usual), Ok(slowed)) = (plan(&settings), plan(&slow)) else {
            refused += 1;
            continue;
        };
        planned += 1;
        for (k, (plan, settings)) in [(&usual, &settings), (&slowed, &slow)].into_iter().enumerate() {
            let (all, beyond) = beyond_limits(plan, settings);
            moments[k] += all;
            violations[k] += beyond;
            joint_rate[k] = joint_rate[k].max(plan.report.joint_rate);
        }
        ratios.extend(against_uniform_scaling(&usual, &settings)?);
    }
    println!(
        "{}",
        json!({
            "fig": "limits_over_random_paths", "peer": "paint-planner", "planned": planned, "nothing_reachable": refused,
            "moments": moments[0], "violations": violations[0], "joint_rate": joint_rate[0], "moments_slow_joints": moments[1],
            "violations_slow_joints": violations[1], "joint_rate_slow_joints": joint_rate[1], "time_over_uniform_scaling": ratios.iter().sum::<f64>() / ratios.len() as f64,
            "compared": ratios.len(),
        })
    );
    Ok(())
}

/// Time of a plan over that of its path at one speed, all times stretched by one factor until the limits hold (thesis, section 7.5).
/// `None` where the plan flies between strokes.
fn against_uniform_scaling(plan: &Plan, settings: &Settings) -> Result<Option<f64>, AnyError> {
    let timing = &settings.timing;
    let TimingPolicy::Uniform { speed } = timing.policy else { return Ok(None) };
    if plan.waypoints.iter().any(|w| w.target.is_none()) {
        return Ok(None);
    }
    let mut knots: Vec<Vector4<f64>> = Vec::new();
    for (k, waypoint) in plan.waypoints.iter().enumerate() {
        let p = waypoint.state.position;
        let here = Vector4::new(p.x, p.y, p.z, waypoint.state.heading);
        let far = knots.last().is_none_or(|last| (here.xyz() - last.xyz()).norm() >= timing.knot_spacing);
        if far || k + 1 == plan.waypoints.len() {
            knots.push(here);
        }
    }
    let durations: Vec<f64> = knots.windows(2).map(|w| ((w[1].xyz() - w[0].xyz()).norm() / speed).max(1e-2)).collect();
    let curve = Trajectory::minimum_snap(&knots, &durations, &vec![false; knots.len()])?;
    let most = curve.extrema();
    let factor = (most.speed / timing.max_speed)
        .max((most.acceleration / timing.max_acceleration).sqrt())
        .max(most.heading_rate / timing.max_heading_rate)
        .max(1.0);
    Ok(Some(plan.trajectory.duration() / (factor * curve.duration())))
}

/// Moments looked at, every 5 ms, and those beyond a limit of speed, acceleration, heading rate or joint rate.
fn beyond_limits(plan: &Plan, settings: &Settings) -> (u64, u64) {
    let timing = &settings.timing;
    let steps = (plan.trajectory.duration() / 0.005) as u64;
    let beyond = |k: &u64| {
        let (setpoint, next) = (plan.setpoint(*k as f64 * 0.005), plan.setpoint((*k + 1) as f64 * 0.005));
        let (s, joints) = (setpoint.sample, (next.pan - setpoint.pan).abs().max((next.tilt - setpoint.tilt).abs()));
        s.velocity.norm() > timing.max_speed * (1.0 + 1e-9)
            || s.acceleration.norm() > timing.max_acceleration * (1.0 + 1e-9)
            || s.heading_rate.abs() > timing.max_heading_rate * (1.0 + 1e-9)
            || joints > 0.005 * timing.max_joint_rate * (1.0 + 1e-9)
    };
    (steps + 1, (0..=steps).filter(beyond).count() as u64)
}
