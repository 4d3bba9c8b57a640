use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

use super::PoseMeasurement;
use crate::filter::state::at::{ACCEL_BIAS, ATTITUDE, CORE, GYRO_BIAS, POSITION, VELOCITY};
use crate::filter::update::Linearised;
use crate::{Imu, so3};

/// Rows of what belongs to a source.
pub(crate) const FRAME: usize = 14;
/// Rows that a pose depends on: the core, and those of its source.
pub(crate) const LOCAL: usize = CORE + FRAME;

/// Rows of a source's blocks, from its first row.
pub(crate) mod frame {
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
    /// What is not known of the time offset, s.
    pub(crate) const LATE: usize = 13;
}

/// The moving part of the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Core {
    pub(crate) position: Vector3<f64>,
    /// In body axes.
    pub(crate) velocity: Vector3<f64>,
    /// `world_from_body`, error on the world's side.
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) gyro_bias: Vector3<f64>,
    pub(crate) accel_bias: Vector3<f64>,
}

/// What is believed of one source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    /// `source_from_world`.
    pub(crate) alignment: (Vector3<f64>, UnitQuaternion<f64>),
    /// `body_from_sensor`.
    pub(crate) sensor: (Vector3<f64>, UnitQuaternion<f64>),
    pub(crate) scale: f64,
    /// Time by which the poses are later than the nominal offset says, s.
    pub(crate) late: f64,
}

fn turned(delta: Vector3<f64>, rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize((so3::exp(&delta) * rotation).into_inner())
}

fn block(delta: &[f64], row: usize) -> Vector3<f64> {
    Vector3::new(delta[row], delta[row + 1], delta[row + 2])
}

impl Core {
    /// `x ⊞ δ`.
    pub(crate) fn corrected(&self, delta: &[f64]) -> Self {
        Self {
            position: self.position + block(delta, POSITION),
            velocity: self.velocity + block(delta, VELOCITY),
            attitude: turned(block(delta, ATTITUDE), &self.attitude),
            gyro_bias: self.gyro_bias + block(delta, GYRO_BIAS),
            accel_bias: self.accel_bias + block(delta, ACCEL_BIAS),
        }
    }
}

impl Frame {
    /// `x ⊞ δ`.
    pub(crate) fn corrected(&self, delta: &[f64]) -> Self {
        let moved = |pose: &(Vector3<f64>, UnitQuaternion<f64>), position: usize, attitude: usize| {
            (pose.0 + block(delta, position), turned(block(delta, attitude), &pose.1))
        };
        Self {
            alignment: moved(&self.alignment, frame::ALIGNMENT_POSITION, frame::ALIGNMENT_ATTITUDE),
            sensor: moved(&self.sensor, frame::SENSOR_POSITION, frame::SENSOR_ATTITUDE),
            scale: self.scale * delta[frame::SCALE].exp(),
            late: self.late + delta[frame::LATE],
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
pub(crate) fn predict(core: &Core, source: &Frame, reading: &Imu, gravity: f64) -> Prediction {
    let (late, half) = (source.late, 0.5 * source.late * source.late);
    let (rate, force) = (reading.gyro - core.gyro_bias, reading.accel - core.accel_bias);
    let down = Vector3::new(0.0, 0.0, -gravity);
    let world_from_body = core.attitude.to_rotation_matrix().into_inner();
    // Where the body is when the source sees it.
    let shift = core.velocity * late + force * half;
    let swing = rate * late;
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
    set(VELOCITY, world_from_body * late, zero);
    set(ATTITUDE, -(world_from_body * shift).cross_matrix(), one);
    set(GYRO_BIAS, zero, world_from_body * so3::left_jacobian(&swing) * -late);
    set(ACCEL_BIAS, world_from_body * -half, zero);

    let sensor_in_source = rotation * attitude.to_rotation_matrix().into_inner();
    let at = |row: usize| CORE + row;
    jacobian.fixed_view_mut::<3, 3>(0, at(frame::ALIGNMENT_POSITION)).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(0, at(frame::ALIGNMENT_ATTITUDE)).copy_from(&-seen.cross_matrix());
    jacobian.fixed_view_mut::<3, 3>(3, at(frame::ALIGNMENT_ATTITUDE)).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(0, at(frame::SENSOR_POSITION)).copy_from(&(sensor_in_source * source.scale));
    jacobian.fixed_view_mut::<3, 3>(3, at(frame::SENSOR_ATTITUDE)).copy_from(&sensor_in_source);
    jacobian.fixed_view_mut::<3, 1>(0, at(frame::SCALE)).copy_from(&seen);
    let velocity = core.attitude * (core.velocity + force * late) + down * late;
    let rate = core.attitude * rate;
    jacobian.fixed_view_mut::<3, 1>(0, at(frame::LATE)).copy_from(&(stretched * (velocity + rate.cross(&lever))));
    jacobian.fixed_view_mut::<3, 1>(3, at(frame::LATE)).copy_from(&(rotation * rate));

    Prediction { position: seen + offset, attitude: turn * attitude * source.sensor.1, jacobian }
}

/// What a pose says at a trial state, in units of its own deviations.
pub(crate) fn linearise(
    prediction: &Prediction,
    measured: &PoseMeasurement,
    whitener: &Matrix6<f64>,
) -> Linearised<6, LOCAL> {
    let pose = &measured.source_from_sensor;
    let shift = pose.translation.vector - prediction.position;
    let turn = so3::log(&(pose.rotation * prediction.attitude.inverse()));
    let residual = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    // Log(Z Ẑ⁻¹ Exp(−e)) = y − J_r⁻¹(y) e.
    let mut jacobian = prediction.jacobian;
    let turned = so3::right_jacobian_inverse(&turn) * jacobian.fixed_rows::<3>(3);
    jacobian.fixed_rows_mut::<3>(3).copy_from(&turned);
    Linearised { residual: whitener * residual, jacobian: whitener * jacobian, noise: Matrix6::identity() }
}

/// The rows of a source among all, after those of the core.
pub(crate) fn rows(source: usize) -> [usize; LOCAL] {
    std::array::from_fn(|k| if k < CORE { k } else { first_row(source) + k - CORE })
}

/// The first row of a source.
pub(crate) const fn first_row(source: usize) -> usize {
    CORE + FRAME * source
}

/// Core and source with a trial step, for the rows of [`rows`].
pub(crate) fn trial(core: &Core, source: &Frame, delta: &SVector<f64, LOCAL>) -> (Core, Frame) {
    let (first, rest) = delta.as_slice().split_at(CORE);
    (core.corrected(first), source.corrected(rest))
}
