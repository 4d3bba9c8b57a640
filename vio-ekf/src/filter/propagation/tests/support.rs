//! A random state, its motion by the nominal model, and derivatives of that by central differences.

use nalgebra::{DMatrix, DVector, Matrix2, Unit, UnitQuaternion, Vector3};

use crate::camera::intrinsics::INTRINSICS;
use crate::filter::propagation::propagate::{Workspace, propagate};
use crate::filter::state::bearing::Bearing;
use crate::filter::state::error_state;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::Landmark;
use crate::filter::state::vio_state::VioState;
use crate::inertial::core_state::CoreState;
use crate::inertial::covariance::Covariance;
use crate::inertial::preintegration::ImuPreintegration;
use crate::lie::so3;
use crate::samples::ImuNoise;
use crate::sim::Rng;
use crate::test_random::{signed, vector};

pub(super) const GRAVITY: f64 = 9.81;

pub(super) fn state(rng: &mut Rng, landmarks: usize) -> VioState {
    VioState {
        core: CoreState {
            position: vector(rng) * 5.0,
            velocity: vector(rng) * 2.0,
            attitude: so3::exp(&(vector(rng) * 2.0)),
            gyro_bias: vector(rng) * 0.05,
            accel_bias: vector(rng) * 0.3,
        },
        camera_position: vector(rng) * 0.2,
        camera_attitude: so3::exp(&(vector(rng) * 2.0)),
        time_offset: 0.01,
        depth_prior: InverseDistance::new(0.3),
        accel_matrix: None,
        row_time: 0.0,
        gyro_scale: Vector3::repeat(1.0),
        lens: None,
        second: None,
        landmarks: (0..landmarks)
            .map(|_| {
                let bearing = Bearing::new(&Unit::new_normalize(Vector3::new(signed(rng), signed(rng), 1.0)));
                Landmark::new(bearing, InverseDistance::new(0.3 + 0.2 * signed(rng)), Matrix2::identity())
            })
            .collect(),
    }
}

/// Rates and forces of some steps of 5 ms, as read by the sensor.
pub(super) fn readings(rng: &mut Rng, count: usize) -> Vec<[Vector3<f64>; 2]> {
    (0..count).map(|_| [vector(rng) * 2.0, vector(rng) * 3.0 + Vector3::z() * 9.81]).collect()
}

pub(super) fn integrate(readings: &[[Vector3<f64>; 2]], state: &VioState, noise: &ImuNoise) -> ImuPreintegration {
    let mut preintegration = ImuPreintegration::default();
    for [gyro, accel] in readings {
        let correction = state.imu_correction();
        let (rate, force) = (correction.rate(gyro), correction.force(accel));
        preintegration.advance_by_calibration((&rate, &force), &[*gyro, *accel], 0.005);
        preintegration.integrate(&rate, &force, 0.005, noise);
    }
    preintegration
}

/// The nominal model of a whole preintegration, without any covariance.
pub(super) fn model(readings: &[[Vector3<f64>; 2]], state: &VioState) -> VioState {
    let preintegration = integrate(readings, state, &ImuNoise::ZERO);
    let mut end = state.clone();
    let capacity = state.landmark_row(state.landmarks.len());
    let mut covariance = Covariance::new(capacity, capacity);
    propagate(
        &mut end,
        &mut covariance,
        (&preintegration, GRAVITY),
        &mut Workspace::new(capacity, state.landmarks.len()),
        |_| panic!("a landmark was lost"),
    );
    end
}

/// `a ⊟ b` in the filter's error coordinates.
pub(super) fn difference(a: &VioState, b: &VioState) -> DVector<f64> {
    let mut d = DVector::zeros(a.landmark_row(a.landmarks.len()));
    let rotation = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>| so3::log(&(a * b.inverse()));
    d.fixed_rows_mut::<3>(error_state::POSITION).copy_from(&(a.core.position - b.core.position));
    d.fixed_rows_mut::<3>(error_state::VELOCITY).copy_from(&(a.core.velocity - b.core.velocity));
    d.fixed_rows_mut::<3>(error_state::ATTITUDE).copy_from(&rotation(&a.core.attitude, &b.core.attitude));
    d.fixed_rows_mut::<3>(error_state::GYRO_BIAS).copy_from(&(a.core.gyro_bias - b.core.gyro_bias));
    d.fixed_rows_mut::<3>(error_state::ACCEL_BIAS).copy_from(&(a.core.accel_bias - b.core.accel_bias));
    d.fixed_rows_mut::<3>(error_state::CAMERA_POSITION).copy_from(&(a.camera_position - b.camera_position));
    d.fixed_rows_mut::<3>(error_state::CAMERA_ATTITUDE).copy_from(&rotation(&a.camera_attitude, &b.camera_attitude));
    d[error_state::TIME_OFFSET] = a.time_offset - b.time_offset;
    d[error_state::DEPTH_PRIOR] = a.depth_prior.value - b.depth_prior.value;
    let matrix = (a.accel_matrix() - b.accel_matrix()).transpose();
    d.rows_mut(error_state::ACCEL_MATRIX, error_state::MATRIX_SIZE).copy_from_slice(matrix.as_slice());
    if let (Some(lens), Some(other)) = (&a.lens, &b.lens) {
        d.rows_mut(error_state::INTRINSICS, INTRINSICS).copy_from_slice(&lens.intrinsics_less(other));
        d[error_state::ROW_TIME] = a.row_time - b.row_time;
        d.fixed_rows_mut::<3>(error_state::GYRO_SCALE).copy_from(&(a.gyro_scale - b.gyro_scale));
    }
    let head = a.head();
    for (slot, (a, b)) in a.landmarks.iter().zip(&b.landmarks).enumerate() {
        let row = error_state::landmark(head, slot);
        d.fixed_rows_mut::<2>(row).copy_from(&a.bearing.boxminus(&b.bearing));
        d[row + 2] = a.inverse_distance.value - b.inverse_distance.value;
    }
    d
}

/// The transition `F` by central differences.
pub(super) fn transition(readings: &[[Vector3<f64>; 2]], state: &VioState) -> DMatrix<f64> {
    let (n, h) = (state.landmark_row(state.landmarks.len()), 1e-5);
    let middle = model(readings, state);
    let mut f = DMatrix::zeros(n, n);
    for column in 0..n {
        let moved = [h, -h].map(|h| {
            let mut state = state.clone();
            // Corrections of an inverse distance agree with sums only to first order.
            let further = |distance: &mut InverseDistance| *distance = InverseDistance::new(distance.value + h);
            if column == error_state::DEPTH_PRIOR {
                further(&mut state.depth_prior);
            } else if let Some(slot) = (0..state.landmarks.len()).find(|&slot| state.landmark_row(slot) + 2 == column) {
                further(&mut state.landmarks[slot].inverse_distance);
            } else {
                let mut delta = vec![0.0; n];
                delta[column] = h;
                state.correct(&delta);
            }
            difference(&model(readings, &state), &middle)
        });
        f.set_column(column, &((&moved[0] - &moved[1]) / (2.0 * h)));
    }
    f
}

pub(super) fn random_covariance(rng: &mut Rng, n: usize) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |_, _| signed(rng));
    &a * a.transpose()
}

pub(super) fn filled(matrix: &DMatrix<f64>) -> Covariance {
    let n = matrix.nrows();
    let mut covariance = Covariance::new(n, n);
    for row in 0..n {
        for column in 0..n {
            covariance.row_mut(row)[column] = matrix[(row, column)];
        }
    }
    covariance
}

pub(super) fn dense(covariance: &Covariance) -> DMatrix<f64> {
    DMatrix::from_fn(covariance.size(), covariance.size(), |r, c| covariance.row(r)[c])
}
