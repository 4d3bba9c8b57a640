//! Stage 1 in the printed variables: position, azimuth and polar angle, nine rows per state, Jacobi iterations
//! (VR paper, Eqs. (1)-(6)).
//!
//! Kept for comparison, and not quite the print: where the surface has no triangles, an equilateral one of
//! [`NozzleSettings::facet`] stands for theirs in Eq. (2); azimuths are unwrapped along the path before their differences are
//! squared; and the heading rows are soft, because Eq. (5) rejects even the initial state where `sin psi1` vanishes.

use super::initial_state::{InitialState, tangents};
use super::qp_solver::QpSolver;
use super::quadratic_program::QuadraticProgram;
use super::solution::Nozzles;
use crate::angle::nearest_equivalent;
use crate::error::Error;
use crate::not_served::NotServed;
use crate::settings::NozzleSettings;
use crate::target::{NozzleState, Target};
use nalgebra::{Matrix3, Point3, UnitVector3, Vector2, Vector3, Vector5};
use std::f64::consts::{FRAC_PI_3, TAU};

const HARD_ROWS: usize = 5;
const SOFT_ROWS: usize = 4;
const PENALTY: f64 = 10.0;

pub(super) fn optimise(
    targets: &[Target],
    initial_states: &[Option<InitialState>],
    linked: &[bool],
    solver: &dyn QpSolver,
    settings: &NozzleSettings,
) -> Result<Nozzles, Error> {
    let indices: Vec<usize> = (0..targets.len()).filter(|&i| initial_states[i].is_some()).collect();
    let place = |(s, t): (&Option<InitialState>, &Target)| {
        s.map(|s| Place { target: *t, facet: s.facet.unwrap_or_else(|| equilateral(t, &s.tangents, settings.facet)) })
    };
    let chosen: Vec<Place> = initial_states.iter().zip(targets).filter_map(place).collect();
    let stroke_links: Vec<bool> = indices.windows(2).map(|pair| pair[1] == pair[0] + 1 && linked[pair[0]]).collect();
    let mut states: Vec<Vector5<f64>> = Vec::with_capacity(chosen.len());
    for Place { target, .. } in &chosen {
        let mut state = initial(target, target.stand_off_or(settings.stand_off));
        if let Some(before) = states.last() {
            state[3] = nearest_equivalent(state[3], before[3]);
        }
        states.push(state);
    }
    let mut result =
        Nozzles { states: vec![Err(NotServed::OutOfReach); targets.len()], rounds: 0, steps: 0, slack: 0.0 };
    for _ in 0..settings.iterations {
        // Jacobi: every neighbour is the one of the previous iteration, so the states decouple.
        let program = build(&chosen, &states, &stroke_links, settings);
        let outcome = solver.solve(&program, &mut states)?;
        result.rounds += 1;
        result.steps += outcome.steps;
        result.slack = outcome.slack;
    }
    for (&index, s) in indices.iter().zip(&states) {
        let direction = Vector3::new(s[4].sin() * s[3].cos(), s[4].sin() * s[3].sin(), s[4].cos());
        let position = Point3::new(s[0], s[1], s[2]);
        result.states[index] = Ok(NozzleState { position, direction: UnitVector3::new_normalize(direction) });
    }
    Ok(result)
}

/// Eq. (1).
fn initial(target: &Target, stand_off: f64) -> Vector5<f64> {
    let n = &target.normal;
    let p = target.point + n.into_inner() * stand_off;
    Vector5::new(p.x, p.y, p.z, (-n.y).atan2(-n.x).rem_euclid(TAU), (-n.z).clamp(-1.0, 1.0).acos())
}

/// The programs of one Jacobi iteration of the paper-exact mode, one for each target and independent of each other, about given states (position,
/// azimuth, polar angle): for measuring a [`QpSolver`] by itself. All targets are one stroke; as many states as targets.
pub fn state_programs(
    targets: &[Target],
    states: &[Vector5<f64>],
    settings: &NozzleSettings,
) -> (QuadraticProgram, Vec<Vector5<f64>>) {
    let count = targets.len().min(states.len());
    let place = |target: &Target| Place {
        target: *target,
        facet: equilateral(target, &tangents(&target.normal, &Vector3::z()), settings.facet),
    };
    let chosen: Vec<Place> = targets[..count].iter().map(place).collect();
    let program = build(&chosen, &states[..count], &vec![true; count.saturating_sub(1)], settings);
    (program, states[..count].to_vec())
}

fn build(
    chosen: &[Place],
    states: &[Vector5<f64>],
    stroke_links: &[bool],
    settings: &NozzleSettings,
) -> QuadraticProgram {
    let mut program = QuadraticProgram::new(chosen.len(), HARD_ROWS, SOFT_ROWS, PENALTY);
    let weights = Vector5::new(settings.ca, settings.ca, settings.ca, settings.cb, settings.cb);
    for (i, (Place { target, facet }, s)) in chosen.iter().zip(states).enumerate() {
        let n = target.normal.into_inner();
        // Eq. (6).
        let mut diagonal = Vector5::repeat(settings.cc);
        let mut pull = s * settings.cc;
        let before = (i > 0 && stroke_links[i - 1]).then(|| states[i - 1]);
        let after = (i < stroke_links.len() && stroke_links[i]).then(|| states[i + 1]);
        for neighbour in before.iter().chain(&after) {
            diagonal += weights;
            pull += weights.component_mul(neighbour);
        }
        let across = (Matrix3::identity() - n * n.transpose()) * settings.cd;
        let block = &mut program.hessian.diagonal[i];
        block.set_diagonal(&diagonal);
        let mut corner = block.fixed_view_mut::<3, 3>(0, 0);
        corner += across;
        *block *= 2.0;
        let anchored = across * target.point.coords;
        for k in 0..3 {
            pull[k] += anchored[k];
        }
        program.gradient[i] = pull * -2.0;
        push_planes(&mut program, target, facet, settings);
        push_headings(&mut program, i, target, s, settings);
    }
    program
}

/// A target with the corners of its triangle, counter-clockwise as seen from outside.
struct Place {
    target: Target,
    facet: [Point3<f64>; 3],
}

/// The triangle around a target whose edges are `inradius` away.
fn equilateral(target: &Target, tangents: &[Vector3<f64>; 2], inradius: f64) -> [Point3<f64>; 3] {
    [0.0, 1.0, 2.0].map(|k| {
        let (sin, cos) = (k * 2.0 * FRAC_PI_3).sin_cos();
        target.point + (tangents[0] * cos + tangents[1] * sin) * (2.0 * inradius)
    })
}

/// Eq. (2) with `n_i = m_i cos(th) + n sin(th)` on the edges of the triangle, `m_i` inward.
fn push_planes(program: &mut QuadraticProgram, target: &Target, facet: &[Point3<f64>; 3], settings: &NozzleSettings) {
    let n = target.normal.into_inner();
    let t = target.point.coords;
    program.push_hard(-n, -(settings.min + n.dot(&t)));
    program.push_hard(n, settings.max + n.dot(&t));
    for k in 0..3 {
        let (from, to) = (facet[k], facet[(k + 1) % 3]);
        // An edge of no length bounds nothing.
        let inward = n.cross(&(to - from)).try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
        let plane = inward * settings.incidence.cos() + n * settings.incidence.sin();
        program.push_hard(-plane, -plane.dot(&from.coords));
    }
}

/// Eqs. (3)-(5): component x bounds the azimuth, component z the polar angle.
fn push_headings(
    program: &mut QuadraticProgram,
    i: usize,
    target: &Target,
    s: &Vector5<f64>,
    settings: &NozzleSettings,
) {
    let line = target.point.coords - Vector3::new(s[0], s[1], s[2]);
    let beta = line.norm();
    let (sine, cosine) = (settings.cone / 2.0).sin_cos();
    for (row, (component, angle)) in [(0, s[3]), (2, s[4])].into_iter().enumerate() {
        let scale = cosine / beta;
        program.soft_map[i][(row, component)] = scale;
        program.soft_map[i][(row, 3 + row)] = -angle.sin();
        let gamma = angle.cos() + angle * angle.sin();
        let alpha = (1.0 - (line[component] / beta).powi(2)).max(0.0).sqrt() * sine;
        let middle = target.point[component] * scale - gamma;
        let axis = if row == 0 { Vector2::x() } else { Vector2::y() };
        program.push_soft(axis, middle + alpha);
        program.push_soft(-axis, alpha - middle);
    }
}
