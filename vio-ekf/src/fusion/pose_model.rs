//! The model of a pose: prediction, Jacobian and residual (Weiss and Siegwart 2011).

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

use super::pose_measurement::PoseMeasurement;
use crate::inertial::core_state::{CoreState, block, rotated};
use crate::inertial::error_state::{ACCEL_BIAS, ATTITUDE, CORE, GYRO_BIAS, POSITION, VELOCITY};
use crate::inertial::iterated_update::Linearization;
use crate::lie::so3;
use crate::samples::Imu;

/// Rows of a source.
pub(crate) const SOURCE: usize = 14;
/// Rows that a pose depends on: the core, and those of its source.
pub(crate) const LOCAL: usize = CORE + SOURCE;

/// Rows of a source's blocks, from its first row.
pub(crate) mod source_rows {
    /// Position of the world in the source's frame.
    pub(crate) const ALIGNMENT_POSITION: usize = 0;
    /// Attitude of the world in the source's frame, error on the source's side.
    pub(crate) const ALIGNMENT_ATTITUDE: usize = 3;
    /// Position of the sensor on the body.
    pub(crate) const SENSOR_POSITION: usize = 6;
    /// Attitude of the sensor on the body, error on the body's side.
    pub(crate) const SENSOR_ATTITUDE: usize = 9;
    /// Logarithm of the scale.
    pub(crate) const SCALE: usize = 12;
    /// Error of the nominal time offset, s.
    pub(crate) const TIME_OFFSET: usize = 13;
}

/// The state of one source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SourceState {
    /// `source_from_world`.
    pub(crate) alignment: (Vector3<f64>, UnitQuaternion<f64>),
    /// `body_from_sensor`.
    pub(crate) sensor: (Vector3<f64>, UnitQuaternion<f64>),
    pub(crate) scale: f64,
    /// Error of the nominal time offset, s.
    pub(crate) time_offset_error: f64,
}

impl SourceState {
    /// `x ⊞ δ`.
    pub(crate) fn corrected(&self, delta: &[f64]) -> Self {
        let moved = |pose: &(Vector3<f64>, UnitQuaternion<f64>), position: usize, attitude: usize| {
            (pose.0 + block(delta, position), rotated(&block(delta, attitude), &pose.1))
        };
        Self {
            alignment: moved(&self.alignment, source_rows::ALIGNMENT_POSITION, source_rows::ALIGNMENT_ATTITUDE),
            sensor: moved(&self.sensor, source_rows::SENSOR_POSITION, source_rows::SENSOR_ATTITUDE),
            scale: self.scale * delta[source_rows::SCALE].exp(),
            time_offset_error: self.time_offset_error + delta[source_rows::TIME_OFFSET],
        }
    }
}

/// The pose of a sensor that is predicted, and its derivative: errors of position and attitude in the source's axes.
pub(crate) struct Prediction {
    pub(crate) position: Vector3<f64>,
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) jacobian: SMatrix<f64, 6, LOCAL>,
}

/// `z_p = λ A (p + R t) + a`, `z_R = A R C`, with the body's motion extrapolated by what is not known of the offset.
pub(crate) fn predict(core: &CoreState, source: &SourceState, reading: &Imu, gravity: f64) -> Prediction {
    let (time_offset_error, half) =
        (source.time_offset_error, 0.5 * source.time_offset_error * source.time_offset_error);
    let (rate, force) = (reading.gyro - core.gyro_bias, reading.accel - core.accel_bias);
    let down = Vector3::new(0.0, 0.0, -gravity);
    let world_from_body = core.attitude.to_rotation_matrix().into_inner();
    // Where the body is when the source sees it.
    let shift = core.velocity * time_offset_error + force * half;
    let swing = rate * time_offset_error;
    let attitude = core.attitude * so3::exp(&swing);
    let lever = attitude * source.sensor.0;
    let point = core.position + core.attitude * shift + down * half + lever;

    let (offset, turn) = source.alignment;
    let rotation = turn.to_rotation_matrix().into_inner();
    let stretched = rotation * source.scale;
    let seen = stretched * point;

    let mut jacobian = SMatrix::<f64, 6, LOCAL>::zeros();
    // By the point and by the attitude, both at the time of the pose.
    let mut set = |row: usize, by_point: Matrix3<f64>, by_turn: Matrix3<f64>| {
        let position = stretched * (by_point - lever.cross_matrix() * by_turn);
        jacobian.fixed_view_mut::<3, 3>(0, row).copy_from(&position);
        jacobian.fixed_view_mut::<3, 3>(3, row).copy_from(&(rotation * by_turn));
    };
    let (zero, one) = (Matrix3::zeros(), Matrix3::identity());
    set(POSITION, one, zero);
    set(VELOCITY, world_from_body * time_offset_error, zero);
    set(ATTITUDE, -(world_from_body * shift).cross_matrix(), one);
    set(GYRO_BIAS, zero, world_from_body * so3::left_jacobian(&swing) * -time_offset_error);
    set(ACCEL_BIAS, world_from_body * -half, zero);

    let sensor_in_source = rotation * attitude.to_rotation_matrix().into_inner();
    let at = |row: usize| CORE + row;
    jacobian.fixed_view_mut::<3, 3>(0, at(source_rows::ALIGNMENT_POSITION)).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(0, at(source_rows::ALIGNMENT_ATTITUDE)).copy_from(&-seen.cross_matrix());
    jacobian.fixed_view_mut::<3, 3>(3, at(source_rows::ALIGNMENT_ATTITUDE)).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(0, at(source_rows::SENSOR_POSITION)).copy_from(&(sensor_in_source * source.scale));
    jacobian.fixed_view_mut::<3, 3>(3, at(source_rows::SENSOR_ATTITUDE)).copy_from(&sensor_in_source);
    jacobian.fixed_view_mut::<3, 1>(0, at(source_rows::SCALE)).copy_from(&seen);
    let velocity = core.attitude * (core.velocity + force * time_offset_error) + down * time_offset_error;
    let rate = core.attitude * rate;
    jacobian
        .fixed_view_mut::<3, 1>(0, at(source_rows::TIME_OFFSET))
        .copy_from(&(stretched * (velocity + rate.cross(&lever))));
    jacobian.fixed_view_mut::<3, 1>(3, at(source_rows::TIME_OFFSET)).copy_from(&(rotation * rate));

    Prediction { position: seen + offset, attitude: turn * attitude * source.sensor.1, jacobian }
}

/// The residual of a pose at a trial state, in units of its own deviations.
pub(crate) fn linearize(
    prediction: &Prediction,
    measured: &PoseMeasurement,
    whitener: &Matrix6<f64>,
) -> Linearization<6, LOCAL> {
    let pose = &measured.source_from_sensor;
    let shift = pose.translation.vector - prediction.position;
    let turn = so3::log(&(pose.rotation * prediction.attitude.inverse()));
    let residual = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    // Log(Z Ẑ⁻¹ Exp(−e)) = y − J_r⁻¹(y) e.
    let mut jacobian = prediction.jacobian;
    let turned = so3::right_jacobian_inverse(&turn) * jacobian.fixed_rows::<3>(3);
    jacobian.fixed_rows_mut::<3>(3).copy_from(&turned);
    Linearization { residual: whitener * residual, jacobian: whitener * jacobian, noise: Matrix6::identity() }
}

/// The rows of a source among all, after those of the core.
pub(crate) fn rows(source: usize) -> [usize; LOCAL] {
    std::array::from_fn(|k| if k < CORE { k } else { first_row(source) + k - CORE })
}

/// The first row of a source.
pub(crate) const fn first_row(source: usize) -> usize {
    CORE + SOURCE * source
}

/// Core and source with a trial step, for the rows of [`rows`].
pub(crate) fn trial(core: &CoreState, source: &SourceState, delta: &SVector<f64, LOCAL>) -> (CoreState, SourceState) {
    let (first, rest) = delta.as_slice().split_at(CORE);
    (core.corrected(first), source.corrected(rest))
}

/// A pose on its way into the filter, with the square root of its information.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WhitenedPose {
    pub(crate) measurement: PoseMeasurement,
    pub(crate) whitener: Matrix6<f64>,
}
