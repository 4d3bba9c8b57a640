//! A filter from the outcome of the initialization in motion, with all correlations.

use nalgebra::{Isometry3, Matrix2, SVector, Translation3, Vector2};

use super::dynamic::result::InitialMotion;
use super::dynamic::window::ERRORS;
use crate::camera::model::CameraModel;
use crate::filter::depth_prior;
use crate::filter::estimator::Estimator;
use crate::filter::frontend::patch::Patch;
use crate::filter::landmarks;
use crate::filter::settings::Settings;
use crate::filter::state::bearing::Bearing;
use crate::filter::state::error_state;
use crate::filter::state::landmark::unproject;
use crate::filter::tracking_state::{LandmarkTrack, TrackingState};
use crate::inertial::initial_state::{InitialSigma, InitialState};
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;

/// A filter from the motion at the time of an image, and the samples until now. `observe` gives the pixel of a point, by its id,
/// in that image, and its patch.
pub(crate) fn from_initialization(
    (cameras, noise, settings): ((&dyn CameraModel, Option<&dyn CameraModel>), ImuNoise, &Settings),
    stamp: Stamp,
    motion: &InitialMotion,
    samples: &[Imu],
    mut observe: impl FnMut(u64) -> Option<(Vector2<f64>, Option<Patch>)>,
) -> Option<TrackingState> {
    let after = samples.partition_point(|sample| sample.stamp <= stamp).max(1);
    let before = samples.get(after - 1)?;
    let initial = InitialState {
        stamp,
        world_from_body: Isometry3::from_parts(Translation3::identity(), motion.attitude),
        velocity_in_body: motion.velocity,
        gyro_bias: motion.gyro_bias,
        accel_bias: motion.accel_bias,
        sigma: InitialSigma::default(),
    };
    let camera = cameras.0;
    let estimator = Estimator::new(cameras, noise, settings, &initial, *before);
    let mut tracking = TrackingState::new(estimator, settings.landmarks.max_count, &settings.imu);
    let TrackingState { estimator, tracks, .. } = &mut tracking;
    let pixel_sigma = settings.dynamic_initialization.pixel_sigma;
    set_core_covariance(estimator, motion);
    insert_landmarks(estimator, motion, |id| {
        let (pixel, patch) = observe(id)?;
        let (bearing, warp) = unproject(camera, &pixel)?;
        tracks.push(LandmarkTrack::new(id, patch));
        Some((bearing, warp, warp * warp.transpose() * (pixel_sigma * pixel_sigma)))
    });
    depth_prior::reset_to_mean(&mut estimator.state, &mut estimator.covariance, &settings.landmarks);
    for sample in &samples[after..] {
        estimator.imu(*sample);
    }
    Some(tracking)
}

/// The covariance of the window's solution, and what that took for none: the gyroscope's noise over the window, and how biases went.
fn set_core_covariance(estimator: &mut Estimator, motion: &InitialMotion) {
    let core = motion.core * motion.covariance * motion.core.transpose();
    for r in 0..error_state::CORE {
        estimator.covariance.row_mut(r)[..error_state::CORE].copy_from_slice(core.column(r).as_slice());
    }
    let (time, noise) = (motion.duration, estimator.noise);
    let tilt = motion.gyro_density.powi(2) * time;
    let velocity = estimator.gravity.powi(2) * tilt * time * time / 3.0;
    for (row, variance) in [
        (error_state::VELOCITY, velocity),
        (error_state::ATTITUDE, tilt),
        (error_state::GYRO_BIAS, noise.gyro_walk.powi(2) * time),
        (error_state::ACCEL_BIAS, noise.accel_walk.powi(2) * time),
    ] {
        // The yaw defines the world, and is exact.
        let rows = if row == error_state::ATTITUDE { 2 } else { 3 };
        (row..row + rows).for_each(|row| estimator.covariance.inflate(row, variance));
    }
}

/// Inserts the landmarks with their correlations: were the distances entered as independent, the scale would seem to be known many
/// times over.
fn insert_landmarks(
    estimator: &mut Estimator,
    motion: &InitialMotion,
    mut observe: impl FnMut(u64) -> Option<(Bearing, Matrix2<f64>, Matrix2<f64>)>,
) {
    let mut entered: Vec<(usize, SVector<f64, ERRORS>)> = Vec::with_capacity(motion.landmarks.len());
    for distance in &motion.landmarks {
        if estimator.covariance.size() + error_state::LANDMARK_SIZE > estimator.covariance.capacity() {
            break;
        }
        let Some((bearing, warp, covariance)) = observe(distance.id) else { continue };
        let value = (distance.inverse_distance, distance.variance);
        landmarks::insert(estimator, bearing, warp, &covariance, value);
        let row = estimator.covariance.size() - 1;
        let spread = motion.covariance * distance.gradient;
        let with_core = motion.core * spread;
        for (other, value) in with_core.iter().enumerate() {
            estimator.covariance.set_covariance(row, other, *value);
        }
        for (other, gradient) in &entered {
            estimator.covariance.set_covariance(row, *other, spread.dot(gradient));
        }
        estimator.covariance.inflate(row, spread.dot(&distance.gradient));
        entered.push((row, distance.gradient));
    }
}
