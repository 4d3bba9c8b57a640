//! What an image saw, and what the samples did between two of them.

use nalgebra::Vector3;

use crate::samples::Imu;
use crate::stamp::Stamp;

/// Least points that two images, or a window of them, must share.
pub(super) const MIN_POINTS: usize = 8;

/// An image: its time by the inertial sensor's clock, and the directions of points in body axes, by rising ids.
pub(super) struct SeenImage {
    pub(super) stamp: Stamp,
    pub(super) points: Vec<(u64, Vector3<f64>)>,
}

impl SeenImage {
    pub(super) fn direction(&self, id: u64) -> Option<Vector3<f64>> {
        self.points.iter().find(|point| point.0 == id).map(|point| point.1)
    }
}

/// Readings from one time to another, both included, linear between samples.
pub(super) fn between(samples: &[Imu], from: Stamp, to: Stamp) -> Vec<Imu> {
    let at = |stamp: Stamp| {
        let after = samples.partition_point(|sample| sample.stamp < stamp).clamp(1, samples.len() - 1);
        let (a, b) = (&samples[after - 1], &samples[after]);
        let share = (stamp.secs_since(a.stamp) / b.stamp.secs_since(a.stamp)).clamp(0.0, 1.0);
        Imu { stamp, gyro: a.gyro.lerp(&b.gyro, share), accel: a.accel.lerp(&b.accel, share) }
    };
    let inside = samples.partition_point(|s| s.stamp <= from)..samples.partition_point(|s| s.stamp < to);
    std::iter::once(at(from)).chain(samples[inside].iter().copied()).chain([at(to)]).collect()
}
