//! What the pose filter believes at one moment: means and covariances, and how they go on.

use nalgebra::{Isometry3, Matrix4, Matrix4x3, UnitQuaternion, Vector3, Vector4};

use super::robot_motion::RobotMotion;

/// Belief of place and rotation with their derivatives and the biases of the inertial sensor. The covariances are those of (value, rate,
/// acceleration, bias), the same for each axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct FilterState {
    pub(super) motion: RobotMotion,
    pub(super) acceleration: Vector3<f64>,
    pub(super) angular_acceleration: Vector3<f64>,
    /// In the world, as all of it.
    pub(super) force_bias: Vector3<f64>,
    pub(super) rate_bias: Vector3<f64>,
    pub(super) position: Matrix4<f64>,
    pub(super) rotation: Matrix4<f64>,
}

impl FilterState {
    /// At rest at a pose.
    pub(super) fn still(pose: &Isometry3<f64>, position: Matrix4<f64>, rotation: Matrix4<f64>) -> Self {
        let zero = Vector3::zeros();
        let motion = RobotMotion { world_from_robot: *pose, velocity: zero, angular_velocity: zero };
        Self {
            motion,
            acceleration: zero,
            angular_acceleration: zero,
            force_bias: zero,
            rate_bias: zero,
            position,
            rotation,
        }
    }

    /// After `dt` seconds in which acceleration and bias of place and rotation walk at random by these much per root second.
    pub(super) fn predicted(&self, [place_walks, rotation_walks]: [[f64; 2]; 2], dt: f64) -> Self {
        let mut next = *self;
        let motion = &mut next.motion;
        // Half of the change of a velocity acts over the step.
        motion.velocity += self.acceleration * (0.5 * dt);
        motion.angular_velocity += self.angular_acceleration * (0.5 * dt);
        motion.world_from_robot = motion.after(dt);
        motion.velocity += self.acceleration * (0.5 * dt);
        motion.angular_velocity += self.angular_acceleration * (0.5 * dt);
        next.position = predicted(&self.position, place_walks, dt);
        next.rotation = predicted(&self.rotation, rotation_walks, dt);
        next
    }

    /// Adds a change of the place's states: rows are value, rate, acceleration and bias.
    pub(super) fn shift(&mut self, change: &Matrix4x3<f64>) {
        let row = |k: usize| change.row(k).transpose();
        self.motion.world_from_robot.translation.vector += row(0);
        self.motion.velocity += row(1);
        self.acceleration += row(2);
        self.force_bias += row(3);
    }

    /// Adds a change of the rotation's states: rows are rotation vector in the world, rate, acceleration and bias.
    pub(super) fn turn(&mut self, change: &Matrix4x3<f64>) {
        let row = |k: usize| change.row(k).transpose();
        let turned = UnitQuaternion::from_scaled_axis(row(0)) * self.motion.world_from_robot.rotation;
        self.motion.world_from_robot = Isometry3::from_parts(self.motion.world_from_robot.translation, turned);
        self.motion.angular_velocity += row(1);
        self.angular_acceleration += row(2);
        self.rate_bias += row(3);
    }

    /// What has to be added to `other` to become this: place, rotation; rows as in [`Self::shift`] and [`Self::turn`].
    pub(super) fn minus(&self, other: &Self) -> [Matrix4x3<f64>; 2] {
        let (a, b) = (&self.motion, &other.motion);
        let place = a.world_from_robot.translation.vector - b.world_from_robot.translation.vector;
        let turned = (a.world_from_robot.rotation * b.world_from_robot.rotation.inverse()).scaled_axis();
        let rows = |rows: [Vector3<f64>; 4]| Matrix4x3::from_rows(&rows.map(|row| row.transpose()));
        [
            rows([
                place,
                a.velocity - b.velocity,
                self.acceleration - other.acceleration,
                self.force_bias - other.force_bias,
            ]),
            rows([
                turned,
                a.angular_velocity - b.angular_velocity,
                self.angular_acceleration - other.angular_acceleration,
                self.rate_bias - other.rate_bias,
            ]),
        ]
    }
}

/// The linear step of (value, rate, acceleration, bias) over `dt` seconds.
pub(super) fn transition(dt: f64) -> Matrix4<f64> {
    let mut step = Matrix4::identity();
    (step[(0, 1)], step[(0, 2)], step[(1, 2)]) = (dt, 0.5 * dt * dt, dt);
    step
}

/// Covariance after `dt` seconds in which acceleration and bias walk at random.
fn predicted(covariance: &Matrix4<f64>, [walk, bias_walk]: [f64; 2], dt: f64) -> Matrix4<f64> {
    let step = transition(dt);
    let mut after = step * covariance * step.transpose();
    after[(2, 2)] += walk * walk * dt;
    after[(3, 3)] += bias_walk * bias_walk * dt;
    after
}

/// Takes a measurement of the states summed by `row` into the covariance and returns the gain.
pub(super) fn measure(covariance: &mut Matrix4<f64>, row: &Vector4<f64>, sigma: f64) -> Vector4<f64> {
    let projected = *covariance * row;
    let gain = projected / (row.dot(&projected) + sigma * sigma);
    *covariance -= gain * projected.transpose();
    gain
}
