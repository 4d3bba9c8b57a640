//! Covariance propagation that uses the structure of the transition.

use nalgebra::{SMatrix, Vector3};

use crate::filter::propagation::camera_motion::{CameraMotion, LandmarkTransition};
use crate::filter::propagation::second_order_terms::{SecondOrderTerms, correlation_factor};
use crate::filter::state::error_state;
use crate::filter::state::vio_state::VioState;
use crate::inertial::core_state::CoreCovariance;
use crate::inertial::covariance::Covariance;
use crate::inertial::preintegration::{CALIBRATION, ImuPreintegration, StateTransition};

/// Rows of the camera's motion.
const MOTION: usize = 6;

/// Rows before the first landmark, at most.
const MAX_HEAD: usize = error_state::MAX_HEAD;

/// Memory of [`propagate`], claimed once: six rows each of the size of the covariance.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    stride: usize,
    /// The camera's motion errors against all others, before: `Ξ P`.
    motion: Vec<f64>,
    /// Against the landmarks as they turn, `W_j = (Ξ P)_j J_jᵀ`, and with what they have of the motion, `V_j = W_j + B D_jᵀ`.
    turned: Vec<f64>,
    moved: Vec<f64>,
    /// `D_jᵀ`.
    by_motion: Vec<f64>,
    /// Three rows of a landmark.
    rows: Vec<f64>,
    transitions: Vec<LandmarkTransition>,
    second_order: SecondOrderTerms,
}

impl Workspace {
    pub(crate) fn new(capacity: usize, landmarks: usize) -> Self {
        let six = || vec![0.0; MOTION * capacity];
        Self {
            stride: capacity,
            motion: six(),
            turned: six(),
            moved: six(),
            by_motion: six(),
            rows: vec![0.0; error_state::LANDMARK_SIZE * capacity],
            transitions: Vec::with_capacity(landmarks),
            second_order: SecondOrderTerms::new(landmarks),
        }
    }
}

/// Propagates state and covariance over an interval: `P ← F P Fᵀ + N`.
///
/// The landmarks depend on the core only through the six errors `ξ = (ψ, τ)` of the camera's motion. With `B` the covariance of
/// these, `P'_ij = D_i (B D_jᵀ + W_j) + W_iᵀ D_jᵀ + J_i P_ij J_jᵀ`: twelve rows that all landmarks share, and a block each.
/// A landmark that the camera runs into is dropped; `dropped` is told its slot, from the last to the first.
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
            covariance.swap_remove(state.landmark_row(slot), error_state::LANDMARK_SIZE);
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
    let by_imu = state.imu_correction().is_scaled().then(|| {
        let (core, motion) = preintegration.by_calibration::<CALIBRATION>(body);
        let count = if state.lens.is_some() { CALIBRATION } else { error_state::MATRIX_SIZE };
        ByImuCalibration { core, xi: camera.by_motion * motion, count }
    });
    // Noise of the core and of ξ.
    let (core_noise, noise) = (&body.noise, preintegration.noise(body));
    let xi_core = camera.by_motion * noise.motion_core;
    let xi_xi = camera.by_motion * noise.motion * camera.by_motion.transpose();

    let head = HeadTransition { size: state.head(), body, by_imu: by_imu.as_ref() };
    motion_product(covariance, (&xi, by_imu.as_ref()), workspace);
    let motion_covariance = motion_covariance((&xi, by_imu.as_ref()), workspace) + xi_xi;
    let translation = motion_covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let correlation_factor = correlation_factor(covariance, &start_from_world, preintegration.duration);
    workspace.second_order.record((covariance, head.size), |row| {
        Vector3::from_fn(|k, _| workspace.motion[(3 + k) * workspace.stride + row])
    });

    turn_motion_product(&motion_covariance, head.size, workspace);
    propagate_head(covariance, &head, core_noise);
    propagate_landmarks(covariance, &head, &xi_core, workspace);
    workspace.second_order.apply(state, covariance, (&translation, correlation_factor), &workspace.transitions);
    covariance.mirror();
}

/// The transition of the rows before the landmarks: of the core; the others stay.
struct HeadTransition<'a> {
    /// How many there are.
    size: usize,
    body: &'a StateTransition,
    by_imu: Option<&'a ByImuCalibration>,
}

impl HeadTransition<'_> {
    /// `F x`, for the core, of a column of errors before.
    fn core(&self, before: &[f64]) -> [f64; error_state::CORE] {
        let transition = &self.body.transition;
        let mut after = [0.0; error_state::CORE];
        for (column, &value) in transition.column_iter().zip(before) {
            after.iter_mut().zip(column.iter()).for_each(|(after, weight)| *after += weight * value);
        }
        if let Some(by_imu) = self.by_imu {
            for (k, column) in by_imu.core.column_iter().take(by_imu.count).enumerate() {
                let value = before[error_state::imu_calibration(k)];
                after.iter_mut().zip(column.iter()).for_each(|(after, weight)| *after += weight * value);
            }
        }
        after
    }
}

/// `F P Fᵀ + N` of the rows before the landmarks.
fn propagate_head(covariance: &mut Covariance, head: &HeadTransition, core_noise: &CoreCovariance) {
    let size = head.size;
    let mut product = SMatrix::<f64, MAX_HEAD, MAX_HEAD>::zeros();
    for column in 0..size {
        let before = &covariance.row(column)[..size];
        let mut after = product.column_mut(column);
        after.as_mut_slice()[..size].copy_from_slice(before);
        after.as_mut_slice()[..error_state::CORE].copy_from_slice(&head.core(before));
    }
    for row in 0..size {
        let mut from = [0.0; MAX_HEAD];
        from.iter_mut().zip(product.row(row).iter()).for_each(|(from, value)| *from = *value);
        let core = head.core(&from[..size]);
        from[..error_state::CORE].copy_from_slice(&core);
        if row < error_state::CORE {
            from.iter_mut().zip(core_noise.row(row).iter()).for_each(|(from, noise)| *from += noise);
        }
        covariance.row_mut(row)[..=row].copy_from_slice(&from[..=row]);
    }
}

/// The rows of the landmarks, lower triangle: a block needs what was in its own place.
fn propagate_landmarks(
    covariance: &mut Covariance,
    head: &HeadTransition,
    xi_core: &SMatrix<f64, MOTION, { error_state::CORE }>,
    workspace: &mut Workspace,
) {
    const SIZE: usize = error_state::LANDMARK_SIZE;
    let Workspace { stride, motion, turned, moved, by_motion, rows, transitions, .. } = workspace;
    let (stride, size) = (*stride, head.size);
    for (slot, transition) in transitions.iter().enumerate() {
        let at = error_state::landmark(size, slot);
        let count = at + SIZE;
        // J_i P_i.
        for r in 0..SIZE {
            let target = &mut rows[r * stride..][..count];
            let weights: [f64; SIZE] = std::array::from_fn(|k| transition.by_itself[(r, k)]);
            let [a, b, c]: [&[f64]; SIZE] = std::array::from_fn(|k| &covariance.row(at + k)[..count]);
            for (((target, a), b), c) in target.iter_mut().zip(a).zip(b).zip(c) {
                *target = weights[0] * a + weights[1] * b + weights[2] * c;
            }
        }
        let noise = transition.by_motion * xi_core;
        for r in 0..SIZE {
            let from = &mut rows[r * stride..][..count];
            for k in 0..MOTION {
                add(&mut from[..size], transition.by_motion[(r, k)], &motion[k * stride..][..size]);
            }
            let core = head.core(&from[..size]);
            from[..error_state::CORE].copy_from_slice(&core);
            from.iter_mut().zip(noise.row(r).iter()).for_each(|(from, noise)| *from += noise);
            for (other, own) in from[size..].chunks_exact_mut(SIZE).zip(transitions.iter()) {
                let j = &own.by_itself;
                let old = [other[0], other[1], other[2]];
                for c in 0..SIZE {
                    other[c] = j[(c, 0)] * old[0] + j[(c, 1)] * old[1] + j[(c, 2)] * old[2];
                }
            }
            for k in (0..MOTION).step_by(2) {
                let [a, b] =
                    [0, 1].map(|i| (transition.by_motion[(r, k + i)], &moved[(k + i) * stride..][size..count]));
                let [c, d] =
                    [0, 1].map(|i| (turned[(k + i) * stride + at + r], &by_motion[(k + i) * stride..][size..count]));
                let others = a.1.iter().zip(b.1).zip(c.1).zip(d.1);
                for (target, (((va, vb), vc), vd)) in from[size..].iter_mut().zip(others) {
                    *target += (a.0 * va + b.0 * vb) + (c.0 * vc + d.0 * vd);
                }
            }
        }
        for r in 0..SIZE {
            covariance.row_mut(at + r)[..=at + r].copy_from_slice(&rows[r * stride..][..=at + r]);
        }
    }
}

/// Derivatives by the accelerometer's matrix and the gyroscope's scales.
struct ByImuCalibration {
    /// Of the core at the end.
    core: SMatrix<f64, { error_state::CORE }, CALIBRATION>,
    /// Of the camera's motion.
    xi: SMatrix<f64, MOTION, CALIBRATION>,
    /// Columns that have a row in the error state.
    count: usize,
}

/// Covariance of the camera's motion, `Ξ P Ξᵀ`.
fn motion_covariance(
    (xi, by_imu): (&SMatrix<f64, MOTION, { error_state::TIME_OFFSET }>, Option<&ByImuCalibration>),
    workspace: &Workspace,
) -> SMatrix<f64, MOTION, MOTION> {
    SMatrix::from_fn(|r, c| {
        let row = &workspace.motion[r * workspace.stride..];
        let by_head: f64 = xi.row(c).iter().zip(row).map(|(w, p)| w * p).sum();
        let imu =
            |by: &ByImuCalibration| (0..by.count).map(|k| by.xi[(c, k)] * row[error_state::imu_calibration(k)]).sum();
        by_head + by_imu.map_or(0.0, imu)
    })
}

/// `Ξ P` into the workspace.
fn motion_product(
    covariance: &Covariance,
    (xi, by_imu): (&SMatrix<f64, MOTION, { error_state::TIME_OFFSET }>, Option<&ByImuCalibration>),
    workspace: &mut Workspace,
) {
    let n = covariance.size();
    for r in 0..MOTION {
        let target = &mut workspace.motion[r * workspace.stride..][..n];
        target.fill(0.0);
        for c in 0..error_state::TIME_OFFSET {
            add(target, xi[(r, c)], covariance.row(c));
        }
        if let Some(by_imu) = by_imu {
            for c in 0..by_imu.count {
                add(target, by_imu.xi[(r, c)], covariance.row(error_state::imu_calibration(c)));
            }
        }
    }
}

/// The rows that all landmarks share.
fn turn_motion_product(motion_covariance: &SMatrix<f64, MOTION, MOTION>, head: usize, workspace: &mut Workspace) {
    let Workspace { stride, motion, turned, moved, by_motion, transitions, .. } = workspace;
    for (slot, transition) in transitions.iter().enumerate() {
        let at = error_state::landmark(head, slot);
        let before = SMatrix::<f64, MOTION, 3>::from_fn(|r, c| motion[r * *stride + at + c]);
        let w = before * transition.by_itself.transpose();
        let v = w + motion_covariance * transition.by_motion.transpose();
        for r in 0..MOTION {
            for c in 0..3 {
                turned[r * *stride + at + c] = w[(r, c)];
                moved[r * *stride + at + c] = v[(r, c)];
                by_motion[r * *stride + at + c] = transition.by_motion[(c, r)];
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
