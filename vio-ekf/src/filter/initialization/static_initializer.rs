//! Initialization at rest: attitude from gravity, gyroscope's bias from the mean rate.

use nalgebra::{Isometry3, Translation3, Unit, Vector3};

use crate::camera::model::CameraModel;
use crate::filter::report::InitializationStatus;
use crate::filter::settings::Settings;
use crate::filter::state::bearing::Bearing;
use crate::filter::stationary::detector::{StationaryDetector, StationaryMean};
use crate::inertial::initial_state::{InitialSigma, InitialState};
use crate::stamp::Stamp;

/// Standard deviation of roll and pitch before the mean force is weighed against the accelerometer's bias, rad.
const TILT_SIGMA: f64 = 0.1;

/// What the static initialization waits for.
pub(crate) fn status(detector: &StationaryDetector, now: Stamp, settings: &Settings) -> InitializationStatus {
    let is_gravity =
        |force: Vector3<f64>| (force.norm() - settings.gravity).abs() <= settings.stationary.gravity_tolerance;
    if !detector.is_imu_stationary(now) {
        InitializationStatus::WaitingForSteadyImu
    } else if detector.force().is_some_and(|force| !is_gravity(force)) {
        InitializationStatus::GravityMismatch
    } else {
        InitializationStatus::WaitingForStationaryImages
    }
}

/// The state of a body that has been stationary for long enough, and the means to update it with.
pub(crate) fn initial_state(
    detector: &mut StationaryDetector,
    now: Stamp,
    camera: &dyn CameraModel,
    settings: &Settings,
) -> Option<(InitialState, StationaryMean)> {
    if !detector.may_be_stationary(now) {
        return None;
    }
    let mean = detector.take_mean()?;
    let undetected = detector.undetected_speed(camera, settings.landmarks.inverse_distance);
    let velocity = settings.stationary.velocity_sigma.hypot(undetected);
    let sigma = InitialSigma { velocity, tilt: TILT_SIGMA, ..InitialSigma::default() };
    // Only the direction of the force is used here; the stationary update weighs its length against the bias.
    let attitude = Bearing::new(&Unit::new_normalize(mean.force)).level();
    let initial = InitialState {
        stamp: now,
        world_from_body: Isometry3::from_parts(Translation3::identity(), attitude),
        velocity_in_body: Vector3::zeros(),
        gyro_bias: mean.rate,
        accel_bias: Vector3::zeros(),
        sigma,
    };
    Some((initial, mean))
}
