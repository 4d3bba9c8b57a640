//! Our pose for the autopilot's estimator.

use mavlink::dialects::common::{MavEstimatorType, MavFrame, MavMessage, ODOMETRY_DATA};
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::frames;

/// Where the robot takes itself to be, in our frames (ENU, FLU).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Odometry {
    /// The pose.
    pub world_from_body: Isometry3<f64>,
    /// Velocity, world frame, m/s; `None` where only poses are known.
    pub velocity: Option<Vector3<f64>>,
    /// Covariance of the position, world frame, m^2; infinite where it is not known.
    pub position_covariance: Matrix3<f64>,
    /// Covariance of the attitude about the body's axes, rad^2.
    pub attitude_covariance: Matrix3<f64>,
    /// Covariance of the velocity, world frame, m^2/s^2; not read without a velocity.
    pub velocity_covariance: Matrix3<f64>,
    /// Whether the world's y points north; otherwise the zero of the heading is arbitrary.
    pub north: bool,
    /// Counts the jumps of the pose (relocalisation): the autopilot's estimator follows one that is counted and fights any other.
    pub resets: u8,
}

impl Odometry {
    /// The message at a time in seconds.
    pub fn message(&self, now: f64) -> MavMessage {
        let world_from_body = &self.world_from_body;
        let p = frames::world(&world_from_body.translation.vector).cast::<f32>();
        let in_body = |v: &Vector3<f64>| frames::body(&world_from_body.rotation.inverse_transform_vector(v));
        let v = self.velocity.map_or(Vector3::repeat(f32::NAN), |v| in_body(&v).cast::<f32>());
        let turned = |covariance: &Matrix3<f64>, turn: &dyn Fn(&Vector3<f64>) -> Vector3<f64>| {
            let matrix = Matrix3::from_columns(&[Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| turn(&axis)));
            matrix * covariance * matrix.transpose()
        };
        let position = turned(&self.position_covariance, &frames::world);
        let attitude = turned(&self.attitude_covariance, &frames::body);
        let velocity = turned(&self.velocity_covariance, &in_body);
        let mut pose_covariance = upper_triangle(&position, &attitude);
        if !position[(0, 0)].is_finite() {
            // Unknown.
            pose_covariance[0] = f32::NAN;
        }
        let mut velocity_covariance = upper_triangle(&velocity, &Matrix3::zeros());
        if self.velocity.is_none() {
            // Unknown.
            velocity_covariance[0] = f32::NAN;
        }
        MavMessage::ODOMETRY(ODOMETRY_DATA {
            time_usec: (now * 1e6).round() as u64,
            x: p.x,
            y: p.y,
            z: p.z,
            q: frames::quaternion(&frames::attitude(&world_from_body.rotation)),
            vx: v.x,
            vy: v.y,
            vz: v.z,
            rollspeed: f32::NAN,
            pitchspeed: f32::NAN,
            yawspeed: f32::NAN,
            pose_covariance,
            velocity_covariance,
            frame_id: if self.north { MavFrame::MAV_FRAME_LOCAL_NED } else { MavFrame::MAV_FRAME_LOCAL_FRD },
            child_frame_id: MavFrame::MAV_FRAME_BODY_FRD,
            reset_counter: self.resets,
            estimator_type: MavEstimatorType::MAV_ESTIMATOR_TYPE_VISION,
            quality: 0,
        })
    }
}

/// The upper right triangle, row by row, of a covariance of six numbers without correlation between the two threes.
fn upper_triangle(first: &Matrix3<f64>, second: &Matrix3<f64>) -> [f32; 21] {
    let at = |row: usize, column: usize| match (row < 3, column < 3) {
        (true, true) => first[(row, column)],
        (false, false) => second[(row - 3, column - 3)],
        _ => 0.0,
    };
    let mut values = (0..6).flat_map(|row| (row..6).map(move |column| at(row, column) as f32));
    std::array::from_fn(|_| values.next().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn pose_velocity_and_covariance_are_turned() {
        // Facing north, two metres east, one up, flying north.
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let sent = Odometry {
            world_from_body: Isometry3::from_parts(Vector3::new(2.0, 0.0, 1.0).into(), rotation),
            velocity: Some(Vector3::new(0.0, 0.5, 0.0)),
            position_covariance: Matrix3::new(1.0, 0.5, 0.1, 0.5, 4.0, 0.0, 0.1, 0.0, 9.0),
            attitude_covariance: Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.3)),
            velocity_covariance: Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.03)),
            north: false,
            resets: 3,
        };
        let MavMessage::ODOMETRY(message) = sent.message(0.25) else { panic!("another message") };
        assert_eq!([message.x, message.y, message.z], [0.0, 2.0, -1.0]);
        assert!((message.vx - 0.5).abs() < 1e-6 && message.vy.abs() < 1e-6, "{message:?}");
        assert!((message.q[0] - 1.0).abs() < 1e-6);
        // Row by row: xx xy xz x.. | yy yz .. | zz .. with north first and down positive.
        let c = message.pose_covariance;
        assert_eq!((c[0], c[1], c[2], c[6], c[7], c[11]), (4.0, 0.5, 0.0, 1.0, -0.1, 9.0));
        assert_eq!((c[15], c[18], c[20]), (0.1, 0.2, 0.3));
        let v = message.velocity_covariance;
        // The body's x is the world's y.
        assert!((v[0] - 0.02).abs() < 1e-6 && (v[6] - 0.01).abs() < 1e-6 && (v[11] - 0.03).abs() < 1e-6);
        assert_eq!((message.time_usec, message.reset_counter), (250_000, 3));
        // What is not known is said by its first number.
        let unknown = Odometry { position_covariance: Matrix3::from_diagonal_element(f64::INFINITY), ..sent };
        let MavMessage::ODOMETRY(message) = unknown.message(0.25) else { panic!("another message") };
        assert!(message.pose_covariance[0].is_nan() && message.x == 0.0 && message.y == 2.0);
        assert_eq!((message.frame_id as u32, message.child_frame_id as u32), (20, 12));
        let MavMessage::ODOMETRY(poses) = Odometry { velocity: None, ..sent }.message(0.0) else { panic!("another") };
        assert!(poses.vx.is_nan() && poses.velocity_covariance[0].is_nan());
    }
}
