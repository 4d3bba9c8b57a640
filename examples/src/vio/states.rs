//! Every estimate of a run as a table: pose, velocity, biases, covariance.

use std::fmt::Write as _;

use vio_ekf::run::{Estimate, Segment};

/// The parts of the error state, three rows each, in the order of the covariance.
const PARTS: [&str; 5] = ["p", "v", "r", "bg", "ba"];

/// One row per image, or sample where there are no images: time, segment, landmarks used, whether inertial samples alone tell it, pose (world from body, scalar last),
/// velocity in body axes, biases of gyroscope and accelerometer, and the upper triangle of the covariance, row by row: errors of
/// position (world axes), velocity (body axes), attitude (rotation vector in world axes) and biases. SI units.
pub(super) fn states_csv(segments: &[Segment]) -> String {
    let mut text = String::from("t,segment,used,dead_reckoned,px,py,pz,qx,qy,qz,qw,vx,vy,vz,bgx,bgy,bgz,bax,bay,baz");
    let name = |row: usize| format!("{}{}", PARTS[row / 3], ["x", "y", "z"][row % 3]);
    for row in 0..3 * PARTS.len() {
        for column in row..3 * PARTS.len() {
            // Writing to a String cannot fail.
            let _ = write!(text, ",cov_{}_{}", name(row), name(column));
        }
    }
    text.push('\n');
    for (number, segment) in segments.iter().enumerate() {
        for Estimate { odometry: o, used, dead_reckoned } in &segment.estimates {
            let _ = write!(text, "{},{},{},{}", o.stamp, number + 1, used, u8::from(*dead_reckoned));
            let pose = &o.world_from_body;
            let vectors = [o.velocity_in_body, o.gyro_bias, o.accel_bias];
            let pose = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
            for value in pose.chain(vectors.iter().flatten()) {
                let _ = write!(text, ",{value}");
            }
            for row in 0..3 * PARTS.len() {
                for column in row..3 * PARTS.len() {
                    let _ = write!(text, ",{}", o.covariance[(row, column)]);
                }
            }
            text.push('\n');
        }
    }
    text
}
