//! The whole path as one program, re-linearised a few times (ours, after VR paper, Eqs. (2)-(6)).

use super::initial_state::{InitialState, initial_states, tangents};
use super::qp_solver::QpSolver;
use super::quadratic_program::QuadraticProgram;
use super::solution::Nozzles;
use crate::error::Error;
use crate::not_served::NotServed;
use crate::settings::NozzleSettings;
use crate::target::{NozzleState, Target};
use nalgebra::{Matrix2x3, Matrix2x5, Matrix3, Point3, UnitVector3, Vector2, Vector3, Vector5};
use std::f64::consts::{FRAC_PI_4, FRAC_PI_8};

/// Two distance rows, eight incidence rows, two elevation rows.
const HARD_ROWS: usize = 12;
/// Eight rows around the spray cone.
const SOFT_ROWS: usize = 8;
/// Price of leaving the spray cone by one unit of tangent; far above the multipliers of any sane weights.
const PENALTY: f64 = 10.0;
/// A state may move sideways by this fraction of its spray distance per round: the cone rows are linear in the motion
/// only for small angles.
const TRUST_REGION: f64 = 0.1;

/// One re-centred state: the spray axis starts exactly at the target.
struct Linearisation {
    target: Target,
    position: Point3<f64>,
    /// `h0`, the direction to the target.
    axis: Vector3<f64>,
    /// Spray distance `beta0`.
    beta: f64,
    /// `E`, two directions perpendicular to the axis.
    basis: Matrix2x3<f64>,
    /// The target's, with the greatest deviation.
    start: InitialState,
}

impl Linearisation {
    fn new(target: Target, position: Point3<f64>, start: InitialState) -> Self {
        let line = target.point - position;
        let beta = line.norm();
        let axis = line / beta;
        let [e1, e2] = tangents(&axis, &Vector3::z());
        let basis = Matrix2x3::from_rows(&[e1.transpose(), e2.transpose()]);
        Self { target, position, axis, beta, basis, start }
    }
}

/// SQP: build, solve, step, linearise again.
pub(super) fn optimise(
    targets: &[Target],
    initial_states: &[Option<InitialState>],
    linked: &[bool],
    solver: &dyn QpSolver,
    settings: &NozzleSettings,
) -> Result<Nozzles, Error> {
    let indices: Vec<usize> = (0..targets.len()).filter(|&i| initial_states[i].is_some()).collect();
    let mut points: Vec<Linearisation> = initial_states
        .iter()
        .zip(targets)
        .filter_map(|(s, t)| s.map(|s| Linearisation::new(*t, s.state.position, s)))
        .collect();
    let stroke_links: Vec<bool> = indices.windows(2).map(|pair| pair[1] == pair[0] + 1 && linked[pair[0]]).collect();
    let mut result =
        Nozzles { states: vec![Err(NotServed::OutOfReach); targets.len()], rounds: 0, steps: 0, slack: 0.0 };
    for round in 1..=settings.rounds {
        let program = build(&points, &stroke_links, settings);
        let mut x = start_of(&points);
        let outcome = solver.solve(&program, &mut x)?;
        result.rounds = round;
        result.steps += outcome.steps;
        result.slack = outcome.slack;
        let mut moved = 0.0_f64;
        for ((point, x), &index) in points.iter_mut().zip(&x).zip(&indices) {
            let change = Vector3::new(x[0], x[1], x[2]) - point.position.coords;
            let sideways = (point.basis * change).norm();
            // Both ends of the step satisfy the convex hard rows, so every point between does.
            let share = (TRUST_REGION * point.beta / sideways.max(1e-12)).min(1.0);
            moved = moved.max(change.norm() * share);
            let position = point.position + change * share;
            let axis = point.axis + point.basis.tr_mul(&Vector2::new(x[3], x[4])) * share;
            *point = Linearisation::new(point.target, position, point.start);
            let direction = clamp_to_cone(&axis, &point.axis, settings.cone / 2.0);
            result.states[index] = Ok(NozzleState { position, direction });
        }
        if moved < 1e-5 {
            break;
        }
    }
    Ok(result)
}

/// The states that the program of these linearisations starts from: no correction yet.
fn start_of(points: &[Linearisation]) -> Vec<Vector5<f64>> {
    points.iter().map(|c| Vector5::new(c.position.x, c.position.y, c.position.z, 0.0, 0.0)).collect()
}

/// The first of the programs that stage 1 solves for one stroke, and where it starts: for measuring a [`QpSolver`] by itself.
/// Targets that no permitted incidence reaches are left out.
pub fn stroke_program(targets: &[Target], settings: &NozzleSettings) -> (QuadraticProgram, Vec<Vector5<f64>>) {
    let linearised = |(s, t): (&Option<InitialState>, &Target)| s.map(|s| Linearisation::new(*t, s.state.position, s));
    let points: Vec<Linearisation> =
        initial_states(targets, settings).iter().zip(targets).filter_map(linearised).collect();
    let links = vec![true; points.len().saturating_sub(1)];
    (build(&points, &links, settings), start_of(&points))
}

/// Rotates `axis` towards `aim` until the angle between them is at most `half`.
fn clamp_to_cone(axis: &Vector3<f64>, aim: &Vector3<f64>, half: f64) -> UnitVector3<f64> {
    let axis = axis.normalize();
    let aside = axis - aim * aim.dot(&axis);
    let angle = aside.norm().atan2(aim.dot(&axis));
    if angle <= half {
        return UnitVector3::new_normalize(axis);
    }
    UnitVector3::new_normalize(aim * half.cos() + aside.normalize() * half.sin())
}

/// One linearised program around the states. Constant terms of the cost are dropped.
fn build(points: &[Linearisation], stroke_links: &[bool], settings: &NozzleSettings) -> QuadraticProgram {
    let mut program = QuadraticProgram::new(points.len(), HARD_ROWS, SOFT_ROWS, PENALTY);
    for (i, c) in points.iter().enumerate() {
        let neighbours = f64::from(u8::from(i > 0 && stroke_links[i - 1]))
            + f64::from(u8::from(i < stroke_links.len() && stroke_links[i]));
        let n = c.target.normal.into_inner();
        let (t, p) = (c.target.point.coords, c.position.coords);
        let along = n * n.transpose();
        let across = Matrix3::identity() - along;
        // w = u + E'(p - p0) / beta0 is the tangent of the angle between spray axis and target (cone rows).
        let mut soft_map = Matrix2x5::zeros();
        soft_map.fixed_view_mut::<2, 3>(0, 0).copy_from(&(c.basis / c.beta));
        soft_map[(0, 3)] = 1.0;
        soft_map[(1, 4)] = 1.0;
        let w0 = c.basis * p / c.beta;
        // Eq. (6): smoothness, damping, normal deviation; ours: distance and aim.
        let place = Matrix3::identity() * (neighbours * settings.ca + settings.cc)
            + across * settings.cd
            + along * settings.distance;
        let block = &mut program.hessian.diagonal[i];
        block.fixed_view_mut::<3, 3>(0, 0).copy_from(&place);
        block[(3, 3)] = neighbours * settings.cb;
        block[(4, 4)] = block[(3, 3)];
        *block += soft_map.transpose() * soft_map * settings.aim;
        *block *= 2.0;
        let height = n.dot(&t) + c.target.stand_off_or(settings.stand_off);
        let pull = across * t * settings.cd + n * (settings.distance * height) + p * settings.cc;
        let gradient = &mut program.gradient[i];
        for k in 0..3 {
            gradient[k] -= 2.0 * pull[k];
        }
        *gradient -= soft_map.tr_mul(&w0) * (2.0 * settings.aim);
        push_hard_rows(&mut program, c, settings);
        let room = (settings.cone / 2.0).tan() * FRAC_PI_8.cos();
        for k in 0..SOFT_ROWS {
            let (sin, cos) = (k as f64 * FRAC_PI_4).sin_cos();
            let a = Vector2::new(cos, sin);
            program.push_soft(a, room + a.dot(&w0));
        }
        program.soft_map[i] = soft_map;
    }
    add_smoothness(&mut program, points, stroke_links, settings);
    program
}

/// Smoothness of neighbours: `ca |dp|^2 + cb |dh|^2` with `h = h0 + E u`.
fn add_smoothness(
    program: &mut QuadraticProgram,
    points: &[Linearisation],
    stroke_links: &[bool],
    settings: &NozzleSettings,
) {
    for (i, _) in stroke_links.iter().enumerate().filter(|(_, linked)| **linked) {
        let (a, b) = (&points[i], &points[i + 1]);
        let turn = b.basis * a.basis.transpose();
        let lower = &mut program.hessian.lower[i];
        for k in 0..3 {
            lower[(k, k)] = -2.0 * settings.ca;
        }
        lower.fixed_view_mut::<2, 2>(3, 3).copy_from(&(turn * (-2.0 * settings.cb)));
        let step = b.axis - a.axis;
        let (before, after) = (a.basis * step * (2.0 * settings.cb), b.basis * step * (2.0 * settings.cb));
        for k in 0..2 {
            program.gradient[i][3 + k] -= before[k];
            program.gradient[i + 1][3 + k] += after[k];
        }
    }
}

fn push_hard_rows(program: &mut QuadraticProgram, c: &Linearisation, settings: &NozzleSettings) {
    let n = c.target.normal.into_inner();
    let t = c.target.point.coords;
    // Eq. (2), distances.
    program.push_hard(-n, -(settings.min + n.dot(&t)));
    program.push_hard(n, settings.max + n.dot(&t));
    // Incidence (a cone) or deviation (a cylinder) as an octagon inscribed in the circle, a corner of it uphill, where tilted starts
    // sit.
    let (spread, width) = match c.start.deviation {
        None => (settings.incidence.tan() * FRAC_PI_8.cos(), 0.0),
        Some(deviation) => (0.0, deviation * FRAC_PI_8.cos()),
    };
    for k in 0..8 {
        let (sin, cos) = (FRAC_PI_8 + f64::from(k) * FRAC_PI_4).sin_cos();
        let a = c.start.tangents[0] * cos + c.start.tangents[1] * sin - n * spread;
        program.push_hard(a, width + a.dot(&t));
    }
    // Elevation of the line from nozzle to target. |horizontal part| >= m . (t - p) for every unit m, so the flat row
    // lies inside the true cone.
    let flat = Vector3::new(c.axis.x, c.axis.y, 0.0);
    let m = flat.try_normalize(1e-9).unwrap_or_default() * settings.max_elevation.tan();
    for up in [Vector3::z(), -Vector3::z()] {
        let a = m - up;
        program.push_hard(a, a.dot(&t));
    }
}
