use nalgebra::{Matrix3, SMatrix, Vector3};

use super::bends::{Bends, lasting};
use super::covariance::Covariance;
use super::interval::{Interval, Step};
use super::relative::{CameraMotion, LandmarkTransition};
use super::state::{State, at};

/// Rows of the camera's motion.
const MOTION: usize = 6;

/// Memory of [`propagate`], claimed once.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    /// `F P`, of the size of the covariance.
    product: Vec<f64>,
    stride: usize,
    /// The camera's motion errors against all others: `Ξ P`.
    motion: Vec<f64>,
    transitions: Vec<LandmarkTransition>,
    bends: Bends,
}

impl Workspace {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            product: vec![0.0; capacity * capacity],
            stride: capacity,
            motion: vec![0.0; MOTION * capacity],
            transitions: Vec::with_capacity((capacity - at::HEAD) / at::LANDMARK),
            bends: Bends::new((capacity - at::HEAD) / at::LANDMARK),
        }
    }
}

/// Moves state and covariance over an interval: `P ← F P Fᵀ + N`.
///
/// The landmarks depend on the core only through the six errors `ξ = (ψ, τ)` of the camera's motion, so their rows of `F P`
/// are `D_i (Ξ P) + J_i P_i` with a 6-row product that all of them share. A landmark that the camera runs into is dropped;
/// `dropped` is told its slot, from the last to the first.
pub(crate) fn propagate(
    state: &mut State,
    covariance: &mut Covariance,
    (interval, gravity): (&Interval, f64),
    work: &mut Workspace,
    mut dropped: impl FnMut(usize),
) {
    let step = &interval.step(state, gravity);
    let camera = CameraMotion::new(state, &step.start_from_end);
    for slot in (0..state.landmarks.len()).rev() {
        if camera.carry(&state.landmarks[slot]).is_none() {
            state.landmarks.swap_remove(slot);
            covariance.swap_remove(at::landmark(slot), at::LANDMARK);
            dropped(slot);
        }
    }
    work.transitions.clear();
    for landmark in &mut state.landmarks {
        if let Some((carried, transition)) = camera.carry(landmark) {
            *landmark = carried;
            work.transitions.push(transition);
        }
    }
    let start_from_world = state.attitude.inverse();
    let end = step.end(&state.position, &state.attitude);
    (state.position, state.attitude, state.velocity) = (end.translation.vector, end.rotation, step.velocity);

    // ξ by the rows of the head: body motion by the core, then calibration.
    let mut xi = SMatrix::<f64, MOTION, { at::TIME_OFFSET }>::zeros();
    xi.fixed_columns_mut::<{ at::CORE }>(0).copy_from(&(camera.by_motion * step.motion()));
    xi.fixed_columns_mut::<6>(at::CAMERA_POSITION).copy_from(&camera.by_calibration);
    // Noise of the core and of ξ.
    let (core, noise) = (&step.noise, interval.noise(step));
    let xi_core = camera.by_motion * noise.motion_core;
    let xi_xi = camera.by_motion * noise.motion * camera.by_motion.transpose();

    left_product(covariance, step, &xi, work);
    let translation = translation(&xi, &xi_xi, work);
    let lasting = lasting(covariance, &start_from_world, interval.duration);
    work.bends.note(covariance, |row| Vector3::from_fn(|k, _| work.motion[(3 + k) * work.stride + row]));

    // P' = (F P) Fᵀ row by row, lower triangle, with the noise on the way.
    for row in 0..covariance.size() {
        let from = &work.product[row * work.stride..][..covariance.size()];
        let to = covariance.row_mut(row);
        let mut along = [0.0; MOTION];
        for (along, weights) in along.iter_mut().zip(xi.row_iter()) {
            *along = weights.iter().zip(from).map(|(w, p)| w * p).sum();
        }
        for (r, to) in to[..at::CORE.min(row + 1)].iter_mut().enumerate() {
            *to = step.transition.row(r).iter().zip(from).map(|(w, p)| w * p).sum();
        }
        if row < at::CORE {
            for c in 0..=row {
                to[c] += core[(row, c)];
            }
            continue;
        }
        if row < at::HEAD {
            to[at::CORE..=row].copy_from_slice(&from[at::CORE..=row]);
            continue;
        }
        to[at::CORE..at::HEAD].copy_from_slice(&from[at::CORE..at::HEAD]);
        let (slot, component) = ((row - at::HEAD) / at::LANDMARK, (row - at::HEAD) % at::LANDMARK);
        let own = work.transitions[slot].by_motion.row(component);
        let (noise, noise_core) = (own * xi_xi, own * xi_core);
        for (to, noise) in to.iter_mut().zip(noise_core.iter()) {
            *to += noise;
        }
        for (along, noise) in along.iter_mut().zip(noise.iter()) {
            *along += noise;
        }
        for (other, transition) in work.transitions[..=slot].iter().enumerate() {
            let at = at::landmark(other);
            let old = [from[at], from[at + 1], from[at + 2]];
            for c in 0..at::LANDMARK {
                let mut value = 0.0;
                for (k, along) in along.iter().enumerate() {
                    value += transition.by_motion[(c, k)] * along;
                }
                for (k, old) in old.iter().enumerate() {
                    value += transition.by_itself[(c, k)] * old;
                }
                to[at + c] = value;
            }
        }
    }
    work.bends.apply(state, covariance, (&translation, lasting), &work.transitions);
    covariance.mirror();
}

/// Covariance of the camera's translation.
fn translation(
    xi: &SMatrix<f64, MOTION, { at::TIME_OFFSET }>,
    noise: &SMatrix<f64, MOTION, MOTION>,
    work: &Workspace,
) -> Matrix3<f64> {
    let mut translation = noise.fixed_view::<3, 3>(3, 3).into_owned();
    for r in 0..3 {
        for c in 0..3 {
            let row = &work.motion[(3 + r) * work.stride..][..at::TIME_OFFSET];
            translation[(r, c)] += xi.row(3 + c).iter().zip(row).map(|(w, p)| w * p).sum::<f64>();
        }
    }
    translation
}

/// `F P` into the workspace.
fn left_product(
    covariance: &Covariance,
    step: &Step,
    xi: &SMatrix<f64, MOTION, { at::TIME_OFFSET }>,
    work: &mut Workspace,
) {
    let (n, stride) = (covariance.size(), work.stride);
    for r in 0..at::CORE {
        let target = &mut work.product[r * stride..][..n];
        target.fill(0.0);
        for c in 0..at::CORE {
            add(target, step.transition[(r, c)], covariance.row(c));
        }
    }
    for r in at::CORE..at::HEAD {
        work.product[r * stride..][..n].copy_from_slice(covariance.row(r));
    }
    work.motion.fill(0.0);
    for r in 0..MOTION {
        let target = &mut work.motion[r * stride..][..n];
        for c in 0..at::TIME_OFFSET {
            add(target, xi[(r, c)], covariance.row(c));
        }
    }
    for (slot, transition) in work.transitions.iter().enumerate() {
        let at = at::landmark(slot);
        for r in 0..at::LANDMARK {
            let target = &mut work.product[(at + r) * stride..][..n];
            target.fill(0.0);
            for c in 0..MOTION {
                add(target, transition.by_motion[(r, c)], &work.motion[c * stride..][..n]);
            }
            for c in 0..at::LANDMARK {
                add(target, transition.by_itself[(r, c)], covariance.row(at + c));
            }
        }
    }
}

/// `target += weight · row`; many weights are zero.
fn add(target: &mut [f64], weight: f64, row: &[f64]) {
    if weight != 0.0 {
        for (target, value) in target.iter_mut().zip(row) {
            *target += weight * value;
        }
    }
}
