//! Pose and velocity of the robot from noisy poses and, where there is one, an inertial sensor: Kalman filters of constant acceleration, one for the place and one for the
//! rotation. One of constant velocity would lag behind a hand that turns round, by the same way in each sweep.

use nalgebra::{Isometry3, Matrix4, Translation3, UnitQuaternion, Vector3, Vector4};

use crate::error::Error;

/// Part of its standard deviation by which a bias walks in a second: it turns with the robot.
const BIAS_WALK: f64 = 0.2;
/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.80665;

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

/// Pose and velocities as they are believed to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotMotion {
    /// Pose.
    pub world_from_robot: Isometry3<f64>,
    /// Velocity of the robot's origin in the world, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity in the world, rad/s.
    pub angular_velocity: Vector3<f64>,
}

/// The filter. It starts with the first measurement.
#[derive(Debug, Clone)]
pub struct PoseFilter {
    settings: PoseFilterSettings,
    motion: Option<RobotMotion>,
    acceleration: Vector3<f64>,
    angular_acceleration: Vector3<f64>,
    /// Biases of the inertial sensor, in the world.
    force_bias: Vector3<f64>,
    rate_bias: Vector3<f64>,
    /// Covariances of (value, rate, acceleration, bias of the inertial sensor), the same for each axis.
    position: Matrix4<f64>,
    rotation: Matrix4<f64>,
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
        let (zero, unknown) = (Vector3::zeros(), Matrix4::zeros());
        Ok(Self {
            settings,
            motion: None,
            acceleration: zero,
            angular_acceleration: zero,
            force_bias: zero,
            rate_bias: zero,
            position: unknown,
            rotation: unknown,
        })
    }

    /// Pose and velocities; `None` before the first measurement.
    pub fn motion(&self) -> Option<&RobotMotion> {
        self.motion.as_ref()
    }

    /// Standard deviation of each coordinate of the place, m; infinite before the first measurement.
    pub fn position_sigma(&self) -> f64 {
        self.motion.map_or(f64::INFINITY, |_| self.position[(0, 0)].sqrt())
    }

    /// Lets `dt` seconds pass, then takes in a pose; `None` while the markers are lost.
    pub fn update(&mut self, measured: Option<&Isometry3<f64>>, dt: f64) {
        if let Some(motion) = &mut self.motion {
            // Half of the change of a velocity acts over the step.
            motion.velocity += self.acceleration * (0.5 * dt);
            motion.angular_velocity += self.angular_acceleration * (0.5 * dt);
            motion.world_from_robot = motion.after(dt);
            motion.velocity += self.acceleration * (0.5 * dt);
            motion.angular_velocity += self.angular_acceleration * (0.5 * dt);
            self.position =
                predicted(&self.position, self.settings.acceleration_walk, BIAS_WALK * self.settings.force_bias, dt);
            self.rotation = predicted(
                &self.rotation,
                self.settings.angular_acceleration_walk,
                BIAS_WALK * self.settings.rate_bias,
                dt,
            );
        }
        let Some(pose) = measured else { return };
        let Some(motion) = &mut self.motion else {
            // A hand is slower than a metre and than three radians per second, and takes no second to get there.
            let (p, r) = (self.settings.position_sigma, self.settings.rotation_sigma);
            self.position = Matrix4::from_diagonal(&Vector4::new(p * p, 1.0, 4.0, self.settings.force_bias.powi(2)));
            self.rotation = Matrix4::from_diagonal(&Vector4::new(r * r, 9.0, 36.0, self.settings.rate_bias.powi(2)));
            (self.acceleration, self.angular_acceleration) = (Vector3::zeros(), Vector3::zeros());
            (self.force_bias, self.rate_bias) = (Vector3::zeros(), Vector3::zeros());
            let (velocity, angular_velocity) = (Vector3::zeros(), Vector3::zeros());
            self.motion = Some(RobotMotion { world_from_robot: *pose, velocity, angular_velocity });
            return;
        };
        let gain = measure(&mut self.position, &VALUE, self.settings.position_sigma);
        let error = pose.translation.vector - motion.world_from_robot.translation.vector;
        let place = motion.world_from_robot.translation.vector + error * gain.x;
        motion.velocity += error * gain.y;
        self.acceleration += error * gain.z;
        self.force_bias += error * gain.w;
        let gain = measure(&mut self.rotation, &VALUE, self.settings.rotation_sigma);
        let error = (pose.rotation * motion.world_from_robot.rotation.inverse()).scaled_axis();
        let rotation = UnitQuaternion::from_scaled_axis(error * gain.x) * motion.world_from_robot.rotation;
        motion.angular_velocity += error * gain.y;
        self.angular_acceleration += error * gain.z;
        self.rate_bias += error * gain.w;
        motion.world_from_robot = Isometry3::from_parts(Translation3::from(place), rotation);
    }

    /// Takes in what an inertial sensor at the robot's origin says, in the robot's frame: specific force, m/s^2, and angular velocity, rad/s.
    pub fn inertial(&mut self, specific_force: &Vector3<f64>, angular_velocity: &Vector3<f64>) {
        let Some(motion) = &mut self.motion else { return };
        let attitude = motion.world_from_robot.rotation;
        let gain = measure(&mut self.position, &FORCE, self.settings.accelerometer_sigma);
        let error = attitude * specific_force - Vector3::z() * GRAVITY - self.acceleration - self.force_bias;
        motion.world_from_robot.translation.vector += error * gain.x;
        motion.velocity += error * gain.y;
        self.acceleration += error * gain.z;
        self.force_bias += error * gain.w;
        let gain = measure(&mut self.rotation, &RATE, self.settings.gyroscope_sigma);
        let error = attitude * angular_velocity - motion.angular_velocity - self.rate_bias;
        motion.world_from_robot.rotation = UnitQuaternion::from_scaled_axis(error * gain.x) * attitude;
        motion.angular_velocity += error * gain.y;
        self.angular_acceleration += error * gain.z;
        self.rate_bias += error * gain.w;
    }
}

impl RobotMotion {
    /// Pose after `time` seconds at these velocities.
    pub fn after(&self, time: f64) -> Isometry3<f64> {
        let turned = UnitQuaternion::from_scaled_axis(self.angular_velocity * time) * self.world_from_robot.rotation;
        let place = self.world_from_robot.translation.vector + self.velocity * time;
        Isometry3::from_parts(Translation3::from(place), turned)
    }
}

/// The value is measured by poses; acceleration and bias, or rate and bias, together by the inertial sensor.
const VALUE: Vector4<f64> = Vector4::new(1.0, 0.0, 0.0, 0.0);
const FORCE: Vector4<f64> = Vector4::new(0.0, 0.0, 1.0, 1.0);
const RATE: Vector4<f64> = Vector4::new(0.0, 1.0, 0.0, 1.0);

/// Covariance after `dt` seconds in which acceleration and bias walk at random.
fn predicted(covariance: &Matrix4<f64>, walk: f64, bias_walk: f64, dt: f64) -> Matrix4<f64> {
    let mut step = Matrix4::identity();
    (step[(0, 1)], step[(0, 2)], step[(1, 2)]) = (dt, 0.5 * dt * dt, dt);
    let mut after = step * covariance * step.transpose();
    after[(2, 2)] += walk * walk * dt;
    after[(3, 3)] += bias_walk * bias_walk * dt;
    after
}

/// Takes a measurement of the states summed by `row` into the covariance and returns the gain.
fn measure(covariance: &mut Matrix4<f64>, row: &Vector4<f64>, sigma: f64) -> Vector4<f64> {
    let projected = *covariance * row;
    let gain = projected / (row.dot(&projected) + sigma * sigma);
    *covariance -= gain * projected.transpose();
    gain
}
