//! Inertial samples and noise out of messages.

use vio_ekf::{Imu, ImuNoise};

use crate::mcap_messages::cdr;

/// A sample of `sensor_msgs/Imu`, and its frame.
pub(super) fn imu(data: &[u8]) -> Option<(Imu, String)> {
    let message: cdr::Imu = cdr::decode(data)?;
    let (gyro, accel) = (message.angular_velocity.into(), message.linear_acceleration.into());
    Some((Imu { stamp: message.header.stamp(), gyro, accel }, message.header.frame_id))
}

/// Noise, rate and offset of the camera's clock from our own message.
pub(super) fn noise(text: &str) -> Option<(ImuNoise, f64, f64)> {
    let value: serde_json::Value = serde_json::from_str(text).ok()?;
    let number = |key: &str| value.get(key)?.as_f64();
    let noise = ImuNoise {
        gyro_density: number("gyroscope_noise_density")?,
        gyro_walk: number("gyroscope_random_walk")?,
        accel_density: number("accelerometer_noise_density")?,
        accel_walk: number("accelerometer_random_walk")?,
    };
    noise.check().ok()?;
    Some((noise, number("rate_hz")?, number("timeshift_cam_imu").unwrap_or(0.0)))
}
