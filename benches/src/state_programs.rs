//! The programs of single states (VR paper, Eqs. (2)-(6), as printed): five variables and nine rows each.

use std::error::Error;
use std::path::Path;

use nalgebra::{DMatrix, DVector, Matrix5, Point3, UnitVector3, Vector3, Vector5};
use paint_planner::Target;
use paint_planner::nozzle::{GaussSeidel, NozzleSettings, QpSolver, QuadraticProgram, StandardForm, state_programs};
use serde_json::json;

use crate::Rng;
use crate::cpu::median_seconds;
use crate::npy::save;

/// Programs, and rows of each.
const COUNT: usize = 100_000;
const ROWS: usize = 9;
/// Excess of a row that counts as none.
const HOLDS: f64 = 1e-9;

/// One program: minimise `x'Hx/2 + g'x` under `a . x <= b`; a row with a penalty may be exceeded at that price.
struct StateProgram {
    h: Matrix5<f64>,
    g: Vector5<f64>,
    rows: Vec<(Vector5<f64>, f64, Option<f64>)>,
}

/// A stroke over a displaced wall that faces -y (Eq. (5) degenerates where the spray looks along x), targets 1 cm apart, normals off by
/// 0.12; the states that the programs are made about lie 2 cm and 0.1 rad off.
fn programs() -> (QuadraticProgram, Vec<Vector5<f64>>) {
    let mut rng = Rng::new(5);
    let mut normal = || (rng.unit() + rng.unit() + rng.unit() - 1.5) * 2.0;
    let settings = NozzleSettings { min: 0.07, max: 0.13, ..NozzleSettings::default() };
    let (mut targets, mut states) = (Vec::with_capacity(COUNT), Vec::with_capacity(COUNT));
    for k in 0..COUNT {
        let s = 0.01 * (k % 1000) as f64;
        let n = UnitVector3::new_normalize(Vector3::new(0.12 * normal(), -1.0, 0.12 * normal()));
        let point = Point3::new(s, 0.05 * (3.9 * s).sin(), 2.0 + 0.2 * (2.7 * s).cos());
        let p = point + n.into_inner() * settings.stand_off;
        let off = 0.02 / 3.0_f64.sqrt();
        states.push(Vector5::new(
            p.x + off * normal(),
            p.y + off * normal(),
            p.z + off * normal(),
            (-n.y).atan2(-n.x) + 0.1 * normal(),
            (-n.z).acos() + 0.1 * normal(),
        ));
        targets.push(Target { point, normal: n, dose: 2e-6, time: None, stand_off: None });
    }
    state_programs(&targets, &states, &settings)
}

/// Each program by itself.
fn parts(program: &QuadraticProgram) -> Vec<StateProgram> {
    let form = StandardForm::new(program);
    let count = form.states / 5;
    let one = |i: usize| StateProgram {
        h: Matrix5::zeros(),
        g: Vector5::from_column_slice(&form.q[5 * i..5 * i + 5]),
        rows: (0..ROWS).map(|k| (Vector5::zeros(), form.b[ROWS * i + k], None)).collect(),
    };
    let mut parts: Vec<StateProgram> = (0..count).map(one).collect();
    for &(row, column, value) in form.p.iter().filter(|(row, column, _)| row / 5 == column / 5) {
        parts[row / 5].h[(row % 5, column % 5)] = value;
        parts[row / 5].h[(column % 5, row % 5)] = value;
    }
    for &(row, column, value) in form.a.iter().filter(|(row, ..)| *row < ROWS * count) {
        let place = &mut parts[row / ROWS].rows[row % ROWS];
        if column < form.states {
            place.0[column % 5] = value;
        } else {
            place.2 = Some(form.q[column]);
        }
    }
    parts
}

/// How far a state is from the conditions of an optimum: excess of hard rows, and the slope that multipliers of the rows which are just
/// held cannot balance, rows that are exceeded pulling with their penalty.
fn residual(program: &StateProgram, x: &Vector5<f64>) -> f64 {
    let mut slope = program.h * x + program.g;
    let (mut worst, mut held) = (0.0_f64, Vec::new());
    for (a, b, penalty) in &program.rows {
        let excess = a.dot(x) - b;
        match penalty {
            Some(penalty) if excess > HOLDS => slope += a * *penalty,
            _ if excess.abs() <= HOLDS => held.push((*a, penalty.unwrap_or(f64::INFINITY))),
            _ => worst = worst.max(excess),
        }
    }
    if held.is_empty() {
        return worst.max(slope.amax());
    }
    let normals =
        DMatrix::from_columns(&held.iter().map(|(a, _)| DVector::from_column_slice(a.as_slice())).collect::<Vec<_>>());
    let right = DVector::from_column_slice((-slope).as_slice());
    let Ok(multipliers) = normals.clone().svd(true, true).solve(&right, 1e-12) else { return f64::INFINITY };
    let beyond = multipliers.iter().zip(&held).map(|(z, (_, limit))| (-z).max(z - limit).max(0.0)).fold(0.0, f64::max);
    worst.max((normals * multipliers - right).amax()).max(beyond)
}

/// Prints time and residual of our solver on all programs.
///
/// # Errors
/// What the solver refuses.
pub fn run(runs: usize) -> Result<(), Box<dyn Error>> {
    let (program, start) = programs();
    let solve = || -> Result<Vec<Vector5<f64>>, paint_planner::Error> {
        let mut states = start.clone();
        GaussSeidel::default().solve(&program, &mut states)?;
        Ok(states)
    };
    let states = solve()?;
    let parts = parts(&program);
    let worst = parts.iter().zip(&states).map(|(part, x)| residual(part, x)).fold(0.0, f64::max);
    let exceeded = parts.iter().zip(&states).filter(|(part, x)| !keeps_all(part, x)).count();
    let cpu_us = 1e6 * median_seconds(runs, solve) / COUNT as f64;
    println!(
        "{}",
        json!({
            "fig": "state_programs", "peer": "paint-planner", "programs": COUNT, "rows": ROWS, "cpu_us": cpu_us, "kkt_residual": worst,
            "soft_rows_exceeded_share": exceeded as f64 / COUNT as f64,
        })
    );
    Ok(())
}

fn keeps_all(program: &StateProgram, x: &Vector5<f64>) -> bool {
    program.rows.iter().all(|(a, b, _)| a.dot(x) - b <= HOLDS)
}

/// Writes the programs whose rows can all be held as `NumPy` arrays: `h`, `g`, `a`, `b`, one after the other, and our `x`.
///
/// # Errors
/// Files that cannot be written.
pub fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let (program, mut states) = programs();
    GaussSeidel::default().solve(&program, &mut states)?;
    let parts = parts(&program);
    let kept: Vec<(&StateProgram, &Vector5<f64>)> =
        parts.iter().zip(&states).filter(|(part, x)| keeps_all(part, x)).collect();
    save(folder, "h", kept.iter().flat_map(|(part, _)| part.h.iter().copied()))?;
    save(folder, "g", kept.iter().flat_map(|(part, _)| part.g.iter().copied()))?;
    let rows = || kept.iter().flat_map(|(part, _)| &part.rows);
    save(folder, "rows", rows().flat_map(|(a, ..)| a.iter().copied().collect::<Vec<f64>>()))?;
    save(folder, "bounds", rows().map(|(_, b, _)| *b))?;
    save(folder, "x", kept.iter().flat_map(|(_, x)| x.iter().copied()))
}
