//! Two inertial sensors on one body.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use vio_ekf::fusion::ImuPairSettings;
use vio_ekf::sim::{ImuModel, ImuRecording};
use vio_ekf::{ImuNoise, Stamp, nalgebra};

/// Two sensors of different make, not in step, on one body.
pub(crate) fn models() -> [ImuModel; 2] {
    let noise = ImuNoise { gyro_density: 3e-4, gyro_walk: 6e-5, accel_density: 3e-3, accel_walk: 2e-3 };
    let body_from_imu = Isometry3::new(Vector3::new(-0.15, 0.08, 0.1), Vector3::new(0.4, -0.8, 1.2));
    [ImuModel::default(), ImuModel { rate_hz: 200.0, noise, body_from_imu, ..ImuModel::default() }]
}

pub(crate) fn settings([first, second]: &[ImuModel; 2]) -> ImuPairSettings {
    ImuPairSettings {
        first: first.noise,
        second: second.noise,
        body_from_second: second.body_from_imu,
        ..ImuPairSettings::default()
    }
}

/// Bias of the pair: `b₁ − κ (b₁ − R b₂)`.
pub(crate) fn bias(
    recordings: &[ImuRecording; 2],
    turn: &UnitQuaternion<f64>,
    shares: [f64; 2],
    at: Stamp,
) -> [Vector3<f64>; 2] {
    let ((g1, a1), (g2, a2)) = (recordings[0].biases_at(at), recordings[1].biases_at(at));
    [g1 - (g1 - turn * g2) * shares[0], a1 - (a1 - turn * a2) * shares[1]]
}
