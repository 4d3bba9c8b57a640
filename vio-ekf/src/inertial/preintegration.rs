//! Preintegration of inertial samples, and the state transition that follows from it.

use nalgebra::{Isometry3, Matrix3, SMatrix, Translation3, UnitQuaternion, Vector3, Vector6};

use super::core_state::CoreCovariance;
use super::error_state;
use crate::lie::so3;
use crate::samples::ImuNoise;

/// Rows of the relative motion: rotation, velocity, position.
const MOTION: usize = 9;
/// Entries of the accelerometer's matrix.
const MATRIX: usize = 9;
/// These, and the scales of the gyroscope's axes.
pub(crate) const CALIBRATION: usize = MATRIX + 3;

/// Motion between two times as the inertial samples tell it, independent of the state at the first (Forster et al. 2017).
///
/// In the body axes of the first time, with biases removed: rotation `γ`, velocity `β` and position `α` without the part of
/// gravity and of the initial velocity. Their errors are `(φ, δβ, δα)`. Unlike the paper's, the error of the rotation is on the
/// side of the first time, `γ_true = Exp(φ) γ`, because the filter's attitude error is on the world's side as well.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ImuPreintegration {
    pub(crate) duration: f64,
    pub(crate) rotation: UnitQuaternion<f64>,
    velocity: Vector3<f64>,
    position: Vector3<f64>,
    /// Derivative by the biases of gyroscope and accelerometer.
    bias_jacobian: SMatrix<f64, MOTION, 6>,
    /// Derivative by the entries of the accelerometer's matrix, row by row, and by the gyroscope's scales; zero where neither is
    /// estimated.
    calibration_jacobian: SMatrix<f64, MOTION, CALIBRATION>,
    /// Of the motion's errors, from noise.
    covariance: SMatrix<f64, MOTION, MOTION>,
    /// Between the motion's errors and the walk of the biases.
    walk_covariance: SMatrix<f64, MOTION, 6>,
    /// Variances of that walk, gyroscope and accelerometer.
    walk: [f64; 2],
}

impl Default for ImuPreintegration {
    fn default() -> Self {
        Self {
            duration: 0.0,
            rotation: UnitQuaternion::identity(),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            bias_jacobian: SMatrix::zeros(),
            calibration_jacobian: SMatrix::zeros(),
            covariance: SMatrix::zeros(),
            walk_covariance: SMatrix::zeros(),
            walk: [0.0; 2],
        }
    }
}

/// Propagation of the core over an interval: the nominal end, `F` and the noise.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StateTransition {
    /// Position and attitude of the body's end in the axes of its start.
    pub(crate) start_from_end: (Vector3<f64>, UnitQuaternion<f64>),
    /// Velocity at the end, in the body axes of the end.
    pub(crate) velocity: Vector3<f64>,
    /// Core errors at the end by core errors at the start.
    pub(crate) transition: CoreCovariance,
    /// Covariance of the core's noise at the end.
    pub(crate) noise: CoreCovariance,
    /// Errors of the relative motion (rotation, velocity, position, in the start's axes) by core errors at the start.
    relative: SMatrix<f64, MOTION, { error_state::CORE }>,
    /// Core errors at the end by those of the relative motion.
    compose: SMatrix<f64, { error_state::CORE }, MOTION>,
}

/// Covariance of the noise of an interval.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TransitionNoise {
    /// Of `start_from_end`.
    pub(crate) motion: SMatrix<f64, 6, 6>,
    /// Between that and the core at the end.
    pub(crate) motion_core: SMatrix<f64, 6, { error_state::CORE }>,
}

impl ImuPreintegration {
    /// Integrates `dt` seconds with the mean rate and specific force of that time, biases removed.
    #[cfg(test)]
    pub(crate) fn integrate(&mut self, rate: &Vector3<f64>, force: &Vector3<f64>, dt: f64, noise: &ImuNoise) {
        self.integrate_with_densities(rate, force, dt, noise, &[[noise.gyro_density; 3], [noise.accel_density; 3]]);
    }

    /// The same with white noise of another density on each axis of gyroscope and accelerometer.
    pub(crate) fn integrate_with_densities(
        &mut self,
        rate: &Vector3<f64>,
        force: &Vector3<f64>,
        dt: f64,
        noise: &ImuNoise,
        densities: &[[f64; 3]; 2],
    ) {
        let middle = (self.rotation * so3::exp(&(rate * (0.5 * dt)))).to_rotation_matrix().into_inner();
        let acceleration = middle * force;

        // Bias errors act like the opposite input over the whole transition.
        let mut by_bias = SMatrix::<f64, MOTION, 6>::zeros();
        let turned = acceleration.cross_matrix() * middle;
        by_bias.fixed_view_mut::<3, 3>(0, 0).copy_from(&(middle * -dt));
        by_bias.fixed_view_mut::<3, 3>(3, 0).copy_from(&(turned * (0.5 * dt * dt)));
        by_bias.fixed_view_mut::<3, 3>(6, 0).copy_from(&(turned * (0.25 * dt * dt * dt)));
        by_bias.fixed_view_mut::<3, 3>(3, 3).copy_from(&(middle * -dt));
        by_bias.fixed_view_mut::<3, 3>(6, 3).copy_from(&(middle * (-0.5 * dt * dt)));

        advance(&mut self.bias_jacobian, &acceleration, dt);
        self.bias_jacobian += by_bias;

        // Within the transition the walk is negligible against the white noise: it acts from the next one on.
        advance(&mut self.covariance, &acceleration, dt);
        self.covariance = self.covariance.transpose();
        advance(&mut self.covariance, &acceleration, dt);
        advance(&mut self.walk_covariance, &acceleration, dt);
        let mut driven = by_bias;
        for (k, mut column) in driven.column_iter_mut().enumerate() {
            let density = densities[k / 3][k % 3];
            column *= 0.5 * (density * density / dt + self.walk[k / 3]);
        }
        let cross = (self.walk_covariance + driven) * by_bias.transpose();
        self.covariance += cross + cross.transpose();
        let mut walked = by_bias;
        scale(&mut walked, self.walk);
        self.walk_covariance += walked;
        self.walk[0] += noise.gyro_walk * noise.gyro_walk * dt;
        self.walk[1] += noise.accel_walk * noise.accel_walk * dt;

        self.position += self.velocity * dt + acceleration * (0.5 * dt * dt);
        self.velocity += acceleration * dt;
        self.rotation = UnitQuaternion::new_normalize((self.rotation * so3::exp(&(rate * dt))).into_inner());
        self.duration += dt;
    }

    /// The derivatives by the accelerometer's matrix and the gyroscope's scales over `dt` seconds with this mean rate and force, and
    /// these readings of gyroscope and accelerometer; before the integration over that time.
    pub(crate) fn advance_by_calibration(
        &mut self,
        (rate, force): (&Vector3<f64>, &Vector3<f64>),
        [turning, reading]: &[Vector3<f64>; 2],
        dt: f64,
    ) {
        let middle = (self.rotation * so3::exp(&(rate * (0.5 * dt)))).to_rotation_matrix().into_inner();
        let acceleration = middle * force;
        let jacobian = &mut self.calibration_jacobian;
        advance(jacobian, &acceleration, dt);
        for row in 0..3 {
            for column in 0..3 {
                let driven = middle.column(row) * (reading[column] * dt);
                for axis in 0..3 {
                    jacobian[(3 + axis, 3 * row + column)] += driven[axis];
                    jacobian[(6 + axis, 3 * row + column)] += 0.5 * dt * driven[axis];
                }
            }
        }
        for axis in 0..3 {
            let turned = middle.column(axis) * (turning[axis] * dt);
            let swung = acceleration.cross(&turned) * (-0.5 * dt);
            let mut column = jacobian.column_mut(MATRIX + axis);
            for k in 0..3 {
                column[k] += turned[k];
                column[3 + k] += swung[k];
                column[6 + k] += 0.5 * dt * swung[k];
            }
        }
    }

    /// Derivatives by the first entries of the accelerometer's matrix and the gyroscope's scales: of the core at the end, and of the motion
    /// (position, rotation on the start's side) from start to end.
    pub(crate) fn by_calibration<const N: usize>(
        &self,
        transition: &StateTransition,
    ) -> (SMatrix<f64, { error_state::CORE }, N>, SMatrix<f64, 6, N>) {
        let jacobian = self.calibration_jacobian.fixed_columns::<N>(0).into_owned();
        (transition.compose * jacobian, reordered(&jacobian))
    }

    /// Specific force integrated over the time, in the body axes of the end, m/s.
    pub(crate) fn impulse(&self) -> Vector3<f64> {
        self.rotation.inverse() * self.velocity
    }

    /// The transition of the core from a start with this velocity and attitude, which is all that it depends on.
    pub(crate) fn transition(
        &self,
        velocity: &Vector3<f64>,
        attitude: &UnitQuaternion<f64>,
        gravity: f64,
    ) -> StateTransition {
        let start_from_world = attitude.inverse();
        let (time, half) = (self.duration, 0.5 * self.duration * self.duration);
        let down = start_from_world * Vector3::new(0.0, 0.0, -gravity);
        let moved = velocity * time + down * half + self.position;
        let velocity_in_start = velocity + down * time + self.velocity;
        let end_from_start = self.rotation.inverse().to_rotation_matrix().into_inner();
        let world_from_start = attitude.to_rotation_matrix().into_inner();

        // d(Rᵀ g)/dθ = Rᵀ hat(g) for the world-side error.
        let tilt = world_from_start.transpose() * Vector3::new(0.0, 0.0, -gravity).cross_matrix();
        // Errors of rotation, velocity and position in the start's axes, by the core errors at the start.
        let mut relative = SMatrix::<f64, MOTION, { error_state::CORE }>::zeros();
        relative.fixed_view_mut::<MOTION, 6>(0, error_state::GYRO_BIAS).copy_from(&self.bias_jacobian);
        relative.fixed_view_mut::<3, 3>(3, error_state::VELOCITY).fill_with_identity();
        relative.fixed_view_mut::<3, 3>(3, error_state::ATTITUDE).copy_from(&(tilt * time));
        relative.fixed_view_mut::<3, 3>(6, error_state::VELOCITY).fill_diagonal(time);
        relative.fixed_view_mut::<3, 3>(6, error_state::ATTITUDE).copy_from(&(tilt * half));

        // From there to the core at the end.
        let mut compose = SMatrix::<f64, { error_state::CORE }, MOTION>::zeros();
        compose.fixed_view_mut::<3, 3>(error_state::POSITION, 6).copy_from(&world_from_start);
        compose.fixed_view_mut::<3, 3>(error_state::VELOCITY, 3).copy_from(&end_from_start);
        let swing: Matrix3<f64> = end_from_start * velocity_in_start.cross_matrix();
        compose.fixed_view_mut::<3, 3>(error_state::VELOCITY, 0).copy_from(&swing);
        compose.fixed_view_mut::<3, 3>(error_state::ATTITUDE, 0).copy_from(&world_from_start);

        let mut transition = compose * relative;
        for row in [error_state::POSITION, error_state::ATTITUDE, error_state::GYRO_BIAS, error_state::ACCEL_BIAS] {
            for k in row..row + 3 {
                transition[(k, k)] += 1.0;
            }
        }
        let lever = (world_from_start * moved).cross_matrix();
        let mut corner = transition.fixed_view_mut::<3, 3>(error_state::POSITION, error_state::ATTITUDE);
        corner -= lever;

        StateTransition {
            start_from_end: (moved, self.rotation),
            velocity: end_from_start * velocity_in_start,
            transition,
            noise: self.core_noise(&compose),
            relative,
            compose,
        }
    }

    /// Rotation, velocity and position parts with biases that differ from those it was made with.
    pub(crate) fn with_biases(&self, change: &Vector6<f64>) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
        let part = |row: usize| self.by_biases(row) * change;
        (so3::exp(&part(0)) * self.rotation, self.velocity + part(3), self.position + part(6))
    }

    /// Derivatives by the biases: of the rotation (0), the velocity (3) or the position (6).
    pub(crate) fn by_biases(&self, row: usize) -> SMatrix<f64, 3, 6> {
        self.bias_jacobian.fixed_view::<3, 6>(row, 0).into_owned()
    }

    /// Covariance of the core's noise at the end.
    fn core_noise(&self, compose: &SMatrix<f64, { error_state::CORE }, MOTION>) -> CoreCovariance {
        let mut noise = sandwich(compose, &self.covariance);
        let walked = compose * self.walk_covariance;
        let mut columns = noise.fixed_columns_mut::<6>(error_state::GYRO_BIAS);
        columns += walked;
        let mut rows = noise.fixed_rows_mut::<6>(error_state::GYRO_BIAS);
        rows += walked.transpose();
        for k in 0..3 {
            noise[(error_state::GYRO_BIAS + k, error_state::GYRO_BIAS + k)] += self.walk[0];
            noise[(error_state::ACCEL_BIAS + k, error_state::ACCEL_BIAS + k)] += self.walk[1];
        }
        noise
    }

    /// The noise of the motion from start to end, and what it has in common with the core's.
    pub(crate) fn noise(&self, transition: &StateTransition) -> TransitionNoise {
        let both = self.covariance * transition.compose.transpose();
        let mut motion_core = reordered(&both);
        let mut walk = motion_core.fixed_columns_mut::<6>(error_state::GYRO_BIAS);
        walk += reordered(&self.walk_covariance);
        TransitionNoise { motion: reordered(&reordered(&self.covariance).transpose()), motion_core }
    }
}

/// Position and rotation, in this order, of rows of the relative motion.
fn reordered<const C: usize>(rows: &SMatrix<f64, MOTION, C>) -> SMatrix<f64, 6, C> {
    let mut out = SMatrix::<f64, 6, C>::zeros();
    out.fixed_rows_mut::<3>(0).copy_from(&rows.fixed_rows::<3>(6));
    out.fixed_rows_mut::<3>(3).copy_from(&rows.fixed_rows::<3>(0));
    out
}

/// `F P Fᵀ` of a symmetric `P` and an `F` of which most is zero.
fn sandwich<const R: usize, const C: usize>(f: &SMatrix<f64, R, C>, p: &SMatrix<f64, C, C>) -> SMatrix<f64, R, R> {
    // F P = (P Fᵀ)ᵀ, and the same once more.
    times_transposed(&times_transposed(p, f).transpose(), f)
}

/// `A Fᵀ`.
fn times_transposed<const A: usize, const R: usize, const C: usize>(
    a: &SMatrix<f64, A, C>,
    f: &SMatrix<f64, R, C>,
) -> SMatrix<f64, A, R> {
    let mut out = SMatrix::<f64, A, R>::zeros();
    for c in 0..C {
        for r in 0..R {
            let weight = f[(r, c)];
            if weight != 0.0 {
                for k in 0..A {
                    out[(k, r)] += a[(k, c)] * weight;
                }
            }
        }
    }
    out
}

impl StateTransition {
    /// `F P Fᵀ + N`: covariance of the core at the end, symmetric to the last bit, from that at the start.
    pub(crate) fn propagate_covariance(&self, core: &CoreCovariance) -> CoreCovariance {
        let covariance = sandwich(&self.transition, core) + self.noise;
        (covariance + covariance.transpose()) * 0.5
    }

    /// Errors of `start_from_end` (position, rotation on the start's side) by core errors at the start.
    pub(crate) fn motion(&self) -> SMatrix<f64, 6, { error_state::CORE }> {
        reordered(&self.relative)
    }

    /// Position and attitude at the end, from those at the start.
    pub(crate) fn end(&self, position: &Vector3<f64>, attitude: &UnitQuaternion<f64>) -> Isometry3<f64> {
        let (moved, rotation) = self.start_from_end;
        let end = UnitQuaternion::new_normalize((attitude * rotation).into_inner());
        Isometry3::from_parts(Translation3::from(position + attitude * moved), end)
    }
}

/// The transition of the relative motion's errors over one transition, applied to columns of such errors.
fn advance<const C: usize>(columns: &mut SMatrix<f64, MOTION, C>, acceleration: &Vector3<f64>, dt: f64) {
    for mut column in columns.column_iter_mut() {
        let turned = acceleration.cross(&Vector3::new(column[0], column[1], column[2])) * dt;
        for k in 0..3 {
            column[6 + k] += (column[3 + k] - 0.5 * turned[k]) * dt;
            column[3 + k] -= turned[k];
        }
    }
}

/// The columns of the gyroscope and of the accelerometer, each times its factor.
fn scale(columns: &mut SMatrix<f64, MOTION, 6>, [gyro, accel]: [f64; 2]) {
    let mut first = columns.fixed_columns_mut::<3>(0);
    first *= gyro;
    let mut second = columns.fixed_columns_mut::<3>(3);
    second *= accel;
}
