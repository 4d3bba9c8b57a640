//! The bias of a gyroscope that was at rest for a while.

use nalgebra::Vector3;

use crate::samples::Imu;

/// A sensor that turns no faster, rad/s, and as steadily, over this time, s, is at rest, and reads its bias: over a window the bias
/// would turn it by more than a radian.
const REST: (f64, f64, f64) = (0.2, 0.02, 1.0);

/// Mean rate of the steadiest second if the sensor was at rest, and zero if it never was.
pub(crate) fn bias_at_rest(samples: &[Imu]) -> Vector3<f64> {
    let (slow, steady, length) = REST;
    let mut best = (f64::INFINITY, Vector3::zeros());
    let mut first = 0;
    while first < samples.len() {
        let inside = |sample: &&Imu| sample.stamp.secs_since(samples[first].stamp) < length;
        let second = &samples[first..first + samples[first..].iter().take_while(inside).count()];
        let count = second.len() as f64;
        let mean = second.iter().map(|sample| sample.gyro).sum::<Vector3<f64>>() / count;
        let variance = second.iter().map(|sample| (sample.gyro - mean).norm_squared()).sum::<f64>() / count;
        let whole = samples.get(first + second.len()).is_some();
        if whole && variance < best.0 && variance < steady * steady && mean.norm() < slow {
            best = (variance, mean);
        }
        first += second.len();
    }
    best.1
}
