//! Pose and velocity of the robot from noisy poses and, where there is one, an inertial sensor: Kalman filters of constant acceleration, one for the place and one for the
//! rotation. One of constant velocity would lag behind a hand that turns round, by the same way in each sweep.

use nalgebra::{Isometry3, Matrix4, Vector3, Vector4};

use super::filter_state::{FilterState, measure};
use super::robot_motion::RobotMotion;
use crate::error::Error;
use crate::gravity::GRAVITY;

/// Part of its standard deviation by which a bias walks in a second: it turns with the robot.
const BIAS_WALK: f64 = 0.2;
/// Standard deviations that no noise exceeds.
const JUMP: f64 = 10.0;

/// Noise of the measurements and of the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct PoseFilterSettings {
    /// Standard deviation of a measured coordinate, m (default 2 mm).
    pub position_sigma: f64,
    /// Standard deviation of a measured rotation about each axis, rad (default 0.2 degrees).
    pub rotation_sigma: f64,
    /// Standard deviation of the change of the hand's acceleration from one measurement to the next, m/s^2 per root second (default 3).
    pub acceleration_walk: f64,
    /// The same of its angular acceleration, rad/s^2 per root second (default 3).
    pub angular_acceleration_walk: f64,
    /// Standard deviation of an acceleration from the inertial sensor, m/s^2 (default 0.06).
    pub accelerometer_sigma: f64,
    /// Standard deviation of its bias, the tilt's error included, m/s^2 (default 0.05).
    pub force_bias: f64,
    /// Standard deviation of an angular velocity from the inertial sensor, rad/s (default 0.006).
    pub gyroscope_sigma: f64,
    /// Standard deviation of its bias, rad/s (default 0.005).
    pub rate_bias: f64,
}

impl Default for PoseFilterSettings {
    fn default() -> Self {
        let rotation_sigma = 0.2_f64.to_radians();
        Self {
            position_sigma: 2e-3,
            rotation_sigma,
            acceleration_walk: 3.0,
            angular_acceleration_walk: 3.0,
            accelerometer_sigma: 0.06,
            force_bias: 0.05,
            gyroscope_sigma: 0.006,
            rate_bias: 0.005,
        }
    }
}

/// One step of the filter: what it expected, and what it believes with the measurements.
#[derive(Debug, Clone, Copy)]
pub(super) struct FilterStep {
    pub(super) dt: f64,
    /// Whether it begins anew: nothing is known of the step before.
    pub(super) begins: bool,
    pub(super) predicted: FilterState,
    pub(super) filtered: FilterState,
}

/// The filter. It starts with the first measurement.
#[derive(Debug, Clone)]
pub struct PoseFilter {
    settings: PoseFilterSettings,
    step: Option<FilterStep>,
    restarts: usize,
}

impl PoseFilter {
    /// A filter that has seen nothing.
    ///
    /// # Errors
    /// Standard deviations that are not positive.
    pub fn new(settings: PoseFilterSettings) -> Result<Self, Error> {
        for (name, value) in [
            ("pose_filter.position_sigma", settings.position_sigma),
            ("pose_filter.rotation_sigma", settings.rotation_sigma),
            ("pose_filter.acceleration_walk", settings.acceleration_walk),
            ("pose_filter.angular_acceleration_walk", settings.angular_acceleration_walk),
            ("pose_filter.accelerometer_sigma", settings.accelerometer_sigma),
            ("pose_filter.force_bias", settings.force_bias),
            ("pose_filter.gyroscope_sigma", settings.gyroscope_sigma),
            ("pose_filter.rate_bias", settings.rate_bias),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::Setting { name, value, requirement: "finite and greater than 0" });
            }
        }
        Ok(Self { settings, step: None, restarts: 0 })
    }

    /// Pose and velocities; `None` before the first measurement.
    pub fn motion(&self) -> Option<&RobotMotion> {
        self.step.as_ref().map(|step| &step.filtered.motion)
    }

    /// Standard deviation of each coordinate of the place, m; infinite before the first measurement.
    pub fn position_sigma(&self) -> f64 {
        self.step.map_or(f64::INFINITY, |step| step.filtered.position[(0, 0)].sqrt())
    }

    /// How often it began anew because a pose was farther from the expected one than ten of its standard deviations: the tracking jumped.
    pub fn restarts(&self) -> usize {
        self.restarts
    }

    /// The latest step, if there was one.
    pub(super) fn step(&self) -> Option<&FilterStep> {
        self.step.as_ref()
    }

    /// Lets `dt` seconds pass, then takes in a pose; `None` while the markers are lost.
    pub fn update(&mut self, measured: Option<&Isometry3<f64>>, dt: f64) {
        let settings = &self.settings;
        let begin = |pose: &Isometry3<f64>| {
            let first = settings.first(pose);
            FilterStep { dt, begins: true, predicted: first, filtered: first }
        };
        let Some(step) = &mut self.step else {
            self.step = measured.map(begin);
            return;
        };
        let predicted = step.filtered.predicted(settings.walks(), dt);
        *step = FilterStep { dt, begins: false, predicted, filtered: predicted };
        let Some(pose) = measured else { return };
        if settings.jumped(&predicted, pose) {
            *step = begin(pose);
            self.restarts += 1;
            return;
        }
        let state = &mut step.filtered;
        let believed = state.motion.world_from_robot;
        let gain = measure(&mut state.position, &VALUE, settings.position_sigma);
        state.shift(&(gain * (pose.translation.vector - believed.translation.vector).transpose()));
        let gain = measure(&mut state.rotation, &VALUE, settings.rotation_sigma);
        state.turn(&(gain * (pose.rotation * believed.rotation.inverse()).scaled_axis().transpose()));
    }

    /// Takes in what an inertial sensor at the robot's origin says, in the robot's frame: specific force, m/s^2, and angular velocity, rad/s.
    pub fn inertial(&mut self, specific_force: &Vector3<f64>, angular_velocity: &Vector3<f64>) {
        let Some(FilterStep { filtered: state, .. }) = &mut self.step else { return };
        let attitude = state.motion.world_from_robot.rotation;
        let gain = measure(&mut state.position, &FORCE, self.settings.accelerometer_sigma);
        let error = attitude * specific_force - Vector3::z() * GRAVITY - state.acceleration - state.force_bias;
        state.shift(&(gain * error.transpose()));
        let gain = measure(&mut state.rotation, &RATE, self.settings.gyroscope_sigma);
        let error = attitude * angular_velocity - state.motion.angular_velocity - state.rate_bias;
        state.turn(&(gain * error.transpose()));
    }
}

impl PoseFilterSettings {
    /// What is believed after the first pose.
    fn first(&self, pose: &Isometry3<f64>) -> FilterState {
        // A hand is slower than a metre and than three radians per second, and takes no second to get there.
        let squares = |[value, rate, acceleration, bias]: [f64; 4]| {
            Matrix4::from_diagonal(&Vector4::new(value, rate, acceleration, bias).map(|sigma| sigma * sigma))
        };
        let position = squares([self.position_sigma, 1.0, 2.0, self.force_bias]);
        FilterState::still(pose, position, squares([self.rotation_sigma, 3.0, 6.0, self.rate_bias]))
    }

    /// Whether no noise explains how far a pose is from the expected one.
    fn jumped(&self, expected: &FilterState, pose: &Isometry3<f64>) -> bool {
        let believed = &expected.motion.world_from_robot;
        let far = |error: f64, variance: f64, sigma: f64| error > JUMP * (variance + sigma * sigma).sqrt();
        let place = (pose.translation.vector - believed.translation.vector).norm();
        far(place, expected.position[(0, 0)], self.position_sigma)
            || far(pose.rotation.angle_to(&believed.rotation), expected.rotation[(0, 0)], self.rotation_sigma)
    }

    /// Random walks of acceleration and bias, of the place and of the rotation.
    fn walks(&self) -> [[f64; 2]; 2] {
        [
            [self.acceleration_walk, BIAS_WALK * self.force_bias],
            [self.angular_acceleration_walk, BIAS_WALK * self.rate_bias],
        ]
    }
}

/// The value is measured by poses; acceleration and bias, or rate and bias, together by the inertial sensor.
const VALUE: Vector4<f64> = Vector4::new(1.0, 0.0, 0.0, 0.0);
const FORCE: Vector4<f64> = Vector4::new(0.0, 0.0, 1.0, 1.0);
const RATE: Vector4<f64> = Vector4::new(0.0, 1.0, 0.0, 1.0);
