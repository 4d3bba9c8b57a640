//! The stationary body as a measurement: its mean rate is the gyroscope's bias, its mean force gravity and the accelerometer's.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::measurement::{Measurement, Trial};
use super::update::ungated_update;
use crate::filter::estimator::Estimator;
use crate::filter::settings::Settings;
use crate::filter::state::error_state;
use crate::filter::stationary::detector::StationaryMean;
use crate::inertial::iterated_update::Linearization;

/// The mean rate, of which all is bias.
#[derive(Debug, Clone, Copy)]
struct MeanRate {
    rate: Vector3<f64>,
    variance: f64,
}

impl Measurement<3, 3> for MeanRate {
    fn rows(&self) -> [usize; 3] {
        [error_state::GYRO_BIAS, error_state::GYRO_BIAS + 1, error_state::GYRO_BIAS + 2]
    }

    fn linearize(&self, trial: &Trial<'_, 3>) -> Option<Linearization<3, 3>> {
        // What errors of the scale are of a bias is nothing.
        let residual = trial.state().imu_correction().rate(&self.rate);
        Some(Linearization { residual, jacobian: Matrix3::identity(), noise: Matrix3::identity() * self.variance })
    }
}

/// The mean specific force, `Rᵀ(0, 0, g) + b_a`.
#[derive(Debug, Clone, Copy)]
struct MeanForce {
    force: Vector3<f64>,
    gravity: f64,
    variance: f64,
}

impl Measurement<3, 15> for MeanForce {
    fn rows(&self) -> [usize; 15] {
        std::array::from_fn(|k| match k {
            0..3 => error_state::ATTITUDE + k,
            3..6 => error_state::ACCEL_BIAS + k - 3,
            _ => error_state::ACCEL_MATRIX + k - 6,
        })
    }

    /// `A f̃ = Rᵀ(0, 0, g) + b_a`; where the matrix is not estimated its rows have no variance.
    fn linearize(&self, trial: &Trial<'_, 15>) -> Option<Linearization<3, 15>> {
        let core = trial.core();
        let up = Vector3::new(0.0, 0.0, self.gravity);
        let body_from_world = core.attitude.inverse();
        let mut jacobian = SMatrix::<f64, 3, 15>::zeros();
        // d(Rᵀ a)/dθ = Rᵀ hat(a) for the world-side error.
        let tilt = body_from_world.to_rotation_matrix().into_inner() * up.cross_matrix();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&tilt);
        jacobian.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        for axis in 0..3 {
            jacobian.fixed_view_mut::<1, 3>(axis, 6 + 3 * axis).copy_from(&-self.force.transpose());
        }
        let force = trial.state().accel_matrix.map_or(self.force, |matrix| matrix * self.force);
        let residual = force - body_from_world * up - core.accel_bias;
        Some(Linearization { residual, jacobian, noise: Matrix3::identity() * self.variance })
    }
}

/// Updates biases and tilt with the means of a stationary body; a rotation by `angle` may be undetected over their time.
pub(crate) fn stationary_update(estimator: &mut Estimator, mean: &StationaryMean, angle: f64, settings: &Settings) {
    // A sensor that is worse than its data sheet tells its biases worse, too.
    let white = |sheet: f64, measured: f64| {
        let density = if measured > settings.imu.noise_inflation * sheet { measured } else { sheet };
        density * density / mean.duration
    };
    let [gyro, accel] = mean.noise;
    let variance = (angle / mean.duration).powi(2) + white(estimator.noise.gyro_density, gyro);
    ungated_update(estimator, &MeanRate { rate: mean.rate, variance });
    let variance = settings.stationary.force_sigma.powi(2) + white(estimator.noise.accel_density, accel);
    let gravity = estimator.gravity;
    ungated_update(estimator, &MeanForce { force: mean.force, gravity, variance });
}
