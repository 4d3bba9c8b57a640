//! Covariance propagation that uses the structure of the transition.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::core::covariance::Covariance;
use crate::core::preintegration::{ImuPreintegration, StateTransition};
use crate::filter::propagation::camera_motion::{CameraMotion, LandmarkTransition};
use crate::filter::propagation::second_order_terms::{SecondOrderTerms, correlation_factor};
use crate::filter::state::error_state;
use crate::filter::state::vio_state::VioState;

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
    second_order: SecondOrderTerms,
}

impl Workspace {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            product: vec![0.0; capacity * capacity],
            stride: capacity,
            motion: vec![0.0; MOTION * capacity],
            transitions: Vec::with_capacity((capacity - error_state::FIRST_LANDMARK) / error_state::LANDMARK_SIZE),
            second_order: SecondOrderTerms::new((capacity - error_state::FIRST_LANDMARK) / error_state::LANDMARK_SIZE),
        }
    }
}

/// Propagates state and covariance over an interval: `P ← F P Fᵀ + N`.
///
/// The landmarks depend on the core only through the six errors `ξ = (ψ, τ)` of the camera's motion, so their rows of `F P`
/// are `D_i (Ξ P) + J_i P_i` with a 6-row product that all of them share. A landmark that the camera runs into is dropped;
/// `dropped` is told its slot, from the last to the first.
pub(crate) fn propagate(
    state: &mut VioState,
    covariance: &mut Covariance,
    (preintegration, gravity): (&ImuPreintegration, f64),
    workspace: &mut Workspace,
    mut dropped: impl FnMut(usize),
) {
    let body = &preintegration.transition(&state.core.velocity, &state.core.attitude, gravity);
    let camera = CameraMotion::new(state, &body.start_from_end);
    for slot in (0..state.landmarks.len()).rev() {
        if camera.transform(&state.landmarks[slot]).is_none() {
            state.landmarks.swap_remove(slot);
            covariance.swap_remove(error_state::landmark(slot), error_state::LANDMARK_SIZE);
            dropped(slot);
        }
    }
    workspace.transitions.clear();
    for landmark in &mut state.landmarks {
        if let Some((transformed, transition)) = camera.transform(landmark) {
            *landmark = transformed;
            workspace.transitions.push(transition);
        }
    }
    let start_from_world = state.core.attitude.inverse();
    let end = body.end(&state.core.position, &state.core.attitude);
    (state.core.position, state.core.attitude) = (end.translation.vector, end.rotation);
    state.core.velocity = body.velocity;

    // ξ by the rows of the head: body motion by the core, then calibration.
    let mut xi = SMatrix::<f64, MOTION, { error_state::TIME_OFFSET }>::zeros();
    xi.fixed_columns_mut::<{ error_state::CORE }>(0).copy_from(&(camera.by_motion * body.motion()));
    xi.fixed_columns_mut::<6>(error_state::CAMERA_POSITION).copy_from(&camera.by_calibration);
    // Noise of the core and of ξ.
    let (core_noise, noise) = (&body.noise, preintegration.noise(body));
    let xi_core = camera.by_motion * noise.motion_core;
    let xi_xi = camera.by_motion * noise.motion * camera.by_motion.transpose();

    left_product(covariance, body, &xi, workspace);
    let translation = translation(&xi, &xi_xi, workspace);
    let correlation_factor = correlation_factor(covariance, &start_from_world, preintegration.duration);
    workspace
        .second_order
        .record(covariance, |row| Vector3::from_fn(|k, _| workspace.motion[(3 + k) * workspace.stride + row]));

    // P' = (F P) Fᵀ row by row, lower triangle, with the noise on the way.
    for row in 0..covariance.size() {
        let from = &workspace.product[row * workspace.stride..][..covariance.size()];
        let to = covariance.row_mut(row);
        let mut along = [0.0; MOTION];
        for (along, weights) in along.iter_mut().zip(xi.row_iter()) {
            *along = weights.iter().zip(from).map(|(w, p)| w * p).sum();
        }
        for (r, to) in to[..error_state::CORE.min(row + 1)].iter_mut().enumerate() {
            *to = body.transition.row(r).iter().zip(from).map(|(w, p)| w * p).sum();
        }
        if row < error_state::CORE {
            for c in 0..=row {
                to[c] += core_noise[(row, c)];
            }
            continue;
        }
        if row < error_state::FIRST_LANDMARK {
            to[error_state::CORE..=row].copy_from_slice(&from[error_state::CORE..=row]);
            continue;
        }
        to[error_state::CORE..error_state::FIRST_LANDMARK]
            .copy_from_slice(&from[error_state::CORE..error_state::FIRST_LANDMARK]);
        let (slot, component) = (
            (row - error_state::FIRST_LANDMARK) / error_state::LANDMARK_SIZE,
            (row - error_state::FIRST_LANDMARK) % error_state::LANDMARK_SIZE,
        );
        let own = workspace.transitions[slot].by_motion.row(component);
        let (noise, noise_core) = (own * xi_xi, own * xi_core);
        for (to, noise) in to.iter_mut().zip(noise_core.iter()) {
            *to += noise;
        }
        for (along, noise) in along.iter_mut().zip(noise.iter()) {
            *along += noise;
        }
        for (other, transition) in workspace.transitions[..=slot].iter().enumerate() {
            let at = error_state::landmark(other);
            let old = [from[at], from[at + 1], from[at + 2]];
            for c in 0..error_state::LANDMARK_SIZE {
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
    workspace.second_order.apply(state, covariance, (&translation, correlation_factor), &workspace.transitions);
    covariance.mirror();
}

/// Covariance of the camera's translation.
fn translation(
    xi: &SMatrix<f64, MOTION, { error_state::TIME_OFFSET }>,
    noise: &SMatrix<f64, MOTION, MOTION>,
    workspace: &Workspace,
) -> Matrix3<f64> {
    let mut translation = noise.fixed_view::<3, 3>(3, 3).into_owned();
    for r in 0..3 {
        for c in 0..3 {
            let row = &workspace.motion[(3 + r) * workspace.stride..][..error_state::TIME_OFFSET];
            translation[(r, c)] += xi.row(3 + c).iter().zip(row).map(|(w, p)| w * p).sum::<f64>();
        }
    }
    translation
}

/// `F P` into the workspace.
fn left_product(
    covariance: &Covariance,
    body: &StateTransition,
    xi: &SMatrix<f64, MOTION, { error_state::TIME_OFFSET }>,
    workspace: &mut Workspace,
) {
    let (n, stride) = (covariance.size(), workspace.stride);
    for r in 0..error_state::CORE {
        let target = &mut workspace.product[r * stride..][..n];
        target.fill(0.0);
        for c in 0..error_state::CORE {
            add(target, body.transition[(r, c)], covariance.row(c));
        }
    }
    for r in error_state::CORE..error_state::FIRST_LANDMARK {
        workspace.product[r * stride..][..n].copy_from_slice(covariance.row(r));
    }
    workspace.motion.fill(0.0);
    for r in 0..MOTION {
        let target = &mut workspace.motion[r * stride..][..n];
        for c in 0..error_state::TIME_OFFSET {
            add(target, xi[(r, c)], covariance.row(c));
        }
    }
    for (slot, transition) in workspace.transitions.iter().enumerate() {
        let at = error_state::landmark(slot);
        for r in 0..error_state::LANDMARK_SIZE {
            let target = &mut workspace.product[(at + r) * stride..][..n];
            target.fill(0.0);
            for c in 0..MOTION {
                add(target, transition.by_motion[(r, c)], &workspace.motion[c * stride..][..n]);
            }
            for c in 0..error_state::LANDMARK_SIZE {
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
