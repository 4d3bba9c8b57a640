//! The two time allocations of the VR letter, its Fig. 4 (thesis, Fig. 7.4): a hand that speeds up leaves less and less paint.

use std::error::Error;

use paint_planner::timing::TimingPolicy;
use paint_planner::{OptimalPlanner, Plan, Planner, Target};
use paintcopter::adapters::{MeshSurface, Robot};
use paintcopter::mission::MissionSettings;
use ptu_kinematics::Ptu;

use super::table::{Table, number};
use crate::rock;

/// Speed of the hand at the beginning and at the end of its stroke, m/s (ours: the letter says "increasing").
const HAND: [f64; 2] = [0.1, 1.0];
/// What it sprays, m³/s.
const FLOW: f64 = 2e-7;
/// Targets of the stroke, 2.5 cm apart; the row of the wall is longer.
const TARGETS: usize = 120;
/// Length over which paint is counted, m, and step of the count, s.
const CELL: f64 = 0.1;
const STEP: f64 = 1e-4;

/// Paint on each cell of a stroke, millilitres per metre.
fn density(plan: &Plan, length: f64) -> Vec<f64> {
    let mut cells = vec![0.0; (length / CELL).ceil() as usize];
    let (mut arc_length, mut before) = (0.0, plan.setpoint(0.0));
    for k in 1..=(plan.trajectory.duration() / STEP) as usize {
        let here = plan.setpoint(k as f64 * STEP);
        arc_length += (here.aim - before.aim).norm();
        let cell = ((arc_length / CELL) as usize).min(cells.len() - 1);
        cells[cell] += 0.5 * (here.flow + before.flow) * STEP * 1e6 / CELL;
        before = here;
    }
    cells
}

/// The table, and the curves.
///
/// # Errors
/// What the planner refuses.
pub fn tables() -> Result<Vec<Table>, Box<dyn Error>> {
    let MissionSettings { planner: settings, ptu, .. } = MissionSettings::default();
    let surface = rock::rock()?;
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&surface.world));
    let mut targets = rock::stroke(&surface, TARGETS);
    let steps: Vec<f64> = targets.windows(2).map(|pair| (pair[1].point - pair[0].point).norm()).collect();
    let length: f64 = steps.iter().sum();
    let speed = |arc_length: f64| HAND[0] + (HAND[1] - HAND[0]) * arc_length / length;
    let (mut arc_length, mut time) = (0.0, 0.0);
    for (target, step) in targets.iter_mut().zip(steps.iter().copied().chain([0.0])) {
        let duration = step / speed(arc_length + 0.5 * step);
        // Paint per metre.
        (target.time, target.dose) = (Some(time), FLOW / speed(arc_length));
        (arc_length, time) = (arc_length + step, time + duration);
    }
    let plan = |targets: &[Target], policy| {
        let mut settings = settings.clone();
        settings.timing.policy = policy;
        OptimalPlanner::default().plan(targets, &wall, &robot, &settings)
    };
    // As much paint in all.
    let even = |target: &Target| Target { dose: FLOW * time / length, time: None, ..*target };
    let even: Vec<Target> = targets.iter().map(even).collect();
    let gradient = plan(&targets, TimingPolicy::GradientPreserving)?;
    let uniform = plan(&even, TimingPolicy::Uniform { speed: 0.4 })?;
    let densities = [&uniform, &gradient].map(|plan| density(plan, length));
    let hand: Vec<f64> = (0..densities[0].len())
        .map(|k| {
            // The mean of FLOW over speed on the cell: the speed is linear on the way.
            let [from, to] = [k as f64 * CELL, ((k + 1) as f64 * CELL).min(length)];
            let slope = (HAND[1] - HAND[0]) / length;
            1e6 * FLOW * (speed(to) / speed(from)).ln() / slope / CELL
        })
        .collect();
    Ok(vec![table(&hand, &densities, [&uniform, &gradient], time), curves(&hand, &densities)])
}

fn table(hand: &[f64], [uniform, gradient]: &[Vec<f64>; 2], plans: [&Plan; 2], time: f64) -> Table {
    let mut table = Table::new("time_allocation", &["paint; ml/m", "hand", "uniform", "gradient preserving"]);
    let whole = hand.len() - 1;
    for (name, k) in [("first 10 cm", 0), ("middle", whole / 2), ("last whole 10 cm", whole - 1)] {
        table.row([name.into(), number(hand[k], 3), number(uniform[k], 3), number(gradient[k], 3)]);
    }
    let off = |cells: &[f64]| {
        let pairs = hand.iter().zip(cells).take(whole);
        number(100.0 * pairs.map(|(hand, cell)| (cell / hand - 1.0).abs()).fold(0.0, f64::max), 1)
    };
    table.row(["off the hand's; largest; %".into(), "0".into(), off(uniform), off(gradient)]);
    let [a, b] = plans.map(|plan| number(plan.trajectory.duration(), 1));
    table.row(["time of the stroke; s".into(), number(time, 1), a, b]);
    table.row([
        "stretch of all times; cut of the flow".into(),
        "1".into(),
        "-".into(),
        number(plans[1].report.stretch, 2),
    ]);
    table
}

fn curves(hand: &[f64], [uniform, gradient]: &[Vec<f64>; 2]) -> Table {
    let mut table = Table::new("fig_7_4", &["arc_length_m", "hand_ml_m", "uniform_ml_m", "gradient_ml_m"]);
    for k in 0..hand.len() - 1 {
        let [a, b, c] = [hand[k], uniform[k], gradient[k]].map(|density| number(density, 4));
        table.row([number((k as f64 + 0.5) * CELL, 2), a, b, c]);
    }
    table
}
