//! Two inertial sensors on one body as one.

use nalgebra::{Isometry3, Vector3};

use crate::error::Error;
use crate::error::{all_not_negative, invalid};
use crate::samples::{Imu, ImuNoise};
use crate::trajectory::is_finite;

/// Samples of each sensor that wait for the other at most.
const MAX_PENDING: usize = 64;

/// How two inertial sensors on one body are joined.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ImuPairSettings {
    /// Noise of the first sensor, whose axes and place are the body's.
    pub first: ImuNoise,
    /// Noise of the second.
    pub second: ImuNoise,
    /// Pose of the second sensor on the body; identity.
    pub body_from_second: Isometry3<f64>,
    /// Standard deviation of the difference of the gyroscopes' biases at the start, rad/s per axis; ours: 0.02.
    pub gyro_bias_sigma: f64,
    /// Standard deviation of the difference of the accelerometers' biases at the start, m/s² per axis; ours: 0.2.
    pub accel_bias_sigma: f64,
    /// A sensor that is this much later than the other, or silent for so long, is done without, s; ours: 0.02.
    pub timeout_s: f64,
}

impl Default for ImuPairSettings {
    fn default() -> Self {
        Self {
            first: ImuNoise::default(),
            second: ImuNoise::default(),
            body_from_second: Isometry3::identity(),
            gyro_bias_sigma: 0.02,
            accel_bias_sigma: 0.2,
            timeout_s: 0.02,
        }
    }
}

/// Joins two inertial sensors of one body into one that is better than either.
///
/// With `y₁ = u + b₁ + n₁` and `y₂ = u + b₂ + n₂` in the same axes, the difference `d = b₁ − b₂` of the biases is measured at
/// every sample, whatever the motion, by a Kalman filter of one state per axis. What the pair reads is
///
/// ```text
/// y = w₁ (y₁ − κ d̂) + w₂ (y₂ + (1 − κ) d̂) = u + (b₁ − κ d) + w₁ n₁ + w₂ n₂ + (w₂ − κ) (d̂ − d)
/// w₂ = σ₁² / (σ₁² + σ₂²) = 1 − w₁        κ = q₁² / (q₁² + q₂²)
/// ```
///
/// with densities σ of the white noise and q of the walks. These weights make the noise of `y` independent of what `d` is
/// measured with, and the walk of its bias `b₁ − κ d` independent of that of `d`: nothing is left in the difference that an
/// estimator with both biases in its state could still use. White noise and walk of the pair are `σ₁σ₂/√(σ₁² + σ₂²)` and
/// `q₁q₂/√(q₁² + q₂²)`, see [`noise`](Self::noise). The bias of the pair stays the same when either sensor falls silent: the other goes on alone,
/// the second at its own times.
///
/// The force at a lever arm r is moved to the body: `f₁ = f₂ − α × r − ω × (ω × r)`, with α from the last two samples. Their
/// noise enters as its difference, which integrates to nothing. Both sensors must be on one clock.
#[derive(Debug, Clone)]
pub struct ImuPair {
    settings: ImuPairSettings,
    gyro: BiasDifference,
    accel: BiasDifference,
    pending: Vec<Imu>,
    /// Of the second sensor, in its own axes: the last one not after what was read, and all later ones.
    second: Vec<Imu>,
    /// The last sample read.
    last: Option<Imu>,
    /// The latest sample of the first sensor.
    newest: Option<Imu>,
}

/// One kind of sensor: the difference of the biases, and the weights.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BiasDifference {
    mean: Vector3<f64>,
    /// Per axis.
    variance: f64,
    /// Of the difference of two samples times the time between samples.
    white: f64,
    /// Per second.
    walk: f64,
    /// `w₂` and `κ`.
    weight: f64,
    share: f64,
}

impl BiasDifference {
    fn new([white_1, white_2]: [f64; 2], [walk_1, walk_2]: [f64; 2], sigma: f64) -> Self {
        let share = |a: f64, b: f64| if a + b > 0.0 { a * a / (a * a + b * b) } else { 0.5 };
        Self {
            mean: Vector3::zeros(),
            variance: sigma * sigma,
            white: white_1 * white_1 + white_2 * white_2,
            walk: walk_1 * walk_1 + walk_2 * walk_2,
            weight: share(white_1, white_2),
            share: share(walk_1, walk_2),
        }
    }

    /// Learns from two readings, `dt` seconds after those before.
    fn update(&mut self, first: &Vector3<f64>, second: &Vector3<f64>, dt: f64) {
        self.variance += self.walk * dt;
        let gain = self.variance / (self.variance + self.white / dt);
        if gain.is_finite() {
            self.mean += (first - second - self.mean) * gain;
            self.variance *= 1.0 - gain;
        }
    }

    /// What the pair reads; of one sensor only, with the pair's bias, if the other is silent.
    fn fuse(&self, [first, second]: [Option<Vector3<f64>>; 2]) -> Vector3<f64> {
        let first = first.map(|first| first - self.mean * self.share);
        let second = second.map(|second| second + self.mean * (1.0 - self.share));
        match (first, second) {
            (Some(first), Some(second)) => first + (second - first) * self.weight,
            (one, other) => one.or(other).unwrap_or_default(),
        }
    }
}

impl ImuPair {
    /// Refuses settings that cannot be.
    pub fn new(settings: ImuPairSettings) -> Result<Self, Error> {
        settings.first.check()?;
        settings.second.check()?;
        if !is_finite(&settings.body_from_second) {
            return Err(Error::NonFinite { what: "body_from_second", index: 0 });
        }
        if !(settings.timeout_s > 0.0 && settings.timeout_s <= 1.0) {
            return Err(invalid("timeout_s", settings.timeout_s, "must be above 0 and at most 1 s"));
        }
        all_not_negative(&[
            ("gyro_bias_sigma", settings.gyro_bias_sigma),
            ("accel_bias_sigma", settings.accel_bias_sigma),
        ])?;
        let (a, b) = (settings.first, settings.second);
        Ok(Self {
            settings,
            gyro: BiasDifference::new(
                [a.gyro_density, b.gyro_density],
                [a.gyro_walk, b.gyro_walk],
                settings.gyro_bias_sigma,
            ),
            accel: BiasDifference::new(
                [a.accel_density, b.accel_density],
                [a.accel_walk, b.accel_walk],
                settings.accel_bias_sigma,
            ),
            pending: Vec::with_capacity(MAX_PENDING + 1),
            second: Vec::with_capacity(MAX_PENDING + 1),
            last: None,
            newest: None,
        })
    }

    /// Noise of what the pair reads.
    pub fn noise(&self) -> ImuNoise {
        let (a, b) = (&self.settings.first, &self.settings.second);
        let fuse = |a: f64, b: f64| if a + b > 0.0 { a * b / a.hypot(b) } else { 0.0 };
        ImuNoise {
            gyro_density: fuse(a.gyro_density, b.gyro_density),
            gyro_walk: fuse(a.gyro_walk, b.gyro_walk),
            accel_density: fuse(a.accel_density, b.accel_density),
            accel_walk: fuse(a.accel_walk, b.accel_walk),
        }
    }

    /// The share κ of the difference of the biases that the pair's bias `b₁ − κ (b₁ − b₂)` has, of gyroscope and
    /// accelerometer.
    pub fn bias_shares(&self) -> [f64; 2] {
        [self.gyro.share, self.accel.share]
    }

    /// Takes a sample of the first sensor; stamps must increase. One for which the second has stood in is left out.
    pub fn first(&mut self, sample: &Imu) -> Result<(), Error> {
        sample.check_after(self.newest.as_ref())?;
        if self.pending.len() >= MAX_PENDING {
            return Err(Error::TooFew { what: "samples read from the pair while new ones came", got: 0, need: 1 });
        }
        self.newest = Some(*sample);
        if self.last.is_none_or(|last| sample.stamp > last.stamp) {
            self.pending.push(*sample);
        }
        Ok(())
    }

    /// Takes a sample of the second sensor in its own axes; stamps must increase.
    pub fn second(&mut self, sample: &Imu) -> Result<(), Error> {
        sample.check_after(self.second.last())?;
        if self.second.len() >= MAX_PENDING {
            // The first sensor is silent; what it will be compared with is recent.
            self.second.remove(0);
        }
        self.second.push(*sample);
        Ok(())
    }

    /// The next sample of the pair in the axes of the first sensor: at the time of one of its samples, if the second has got there or has been
    /// waited for long enough, and at that of one of the second while the first is late.
    pub fn read(&mut self) -> Option<Imu> {
        let (first, second) = self.due()?;
        let stamp = first.or(second)?.stamp;
        let dt = self.last.map_or(0.0, |last| stamp.secs_since(last.stamp));
        let rotation = self.settings.body_from_second.rotation;
        let rates = [first.map(|first| first.gyro), second.map(|other| rotation * other.gyro)];
        if let [Some(rate_1), Some(rate_2)] = &rates
            && dt > 0.0
        {
            self.gyro.update(rate_1, rate_2, dt);
        }
        let gyro = self.gyro.fuse(rates);
        let angular = self.last.map_or(Vector3::zeros(), |last| (gyro - last.gyro) / dt);
        let lever = self.settings.body_from_second.translation.vector;
        let moved = angular.cross(&lever) + gyro.cross(&gyro.cross(&lever));
        let forces = [first.map(|first| first.accel), second.map(|other| rotation * other.accel - moved)];
        if let [Some(force_1), Some(force_2)] = &forces
            && dt > 0.0
        {
            self.accel.update(force_1, force_2, dt);
        }
        let accel = self.accel.fuse(forces);
        let read = Imu { stamp, gyro, accel };
        self.last = Some(read);
        let used = self.second.partition_point(|other| other.stamp <= stamp).saturating_sub(1);
        self.second.drain(..used);
        Some(read)
    }

    /// What both sensors read next, at the same time: one of them at least.
    fn due(&mut self) -> Option<(Option<Imu>, Option<Imu>)> {
        let Some(sample) = self.pending.first().copied() else {
            return self.stand_in().map(|other| (None, Some(other)));
        };
        let other = self.second_at(&sample);
        if other.is_none() && !self.is_done_without(&sample) {
            return None;
        }
        self.pending.remove(0);
        Some((Some(sample), other))
    }

    /// Whether the second sensor is not waited for at a sample of the first: long enough it was, or it has been silent before.
    fn is_done_without(&self, sample: &Imu) -> bool {
        let silent = |since: &Imu| {
            self.newest.is_some_and(|newest| newest.stamp.secs_since(since.stamp) >= self.settings.timeout_s)
        };
        silent(sample) || self.second.last().is_some_and(silent)
    }

    /// The next sample of the second sensor, if the first is so late that it is not waited for.
    fn stand_in(&self) -> Option<Imu> {
        let late = self.second.last()?.stamp.secs_since(self.newest?.stamp) >= self.settings.timeout_s;
        let last = self.last?.stamp;
        self.second.iter().find(|other| late && other.stamp > last).copied()
    }

    /// What the second sensor reads at the time of a sample, if it has got there and was not silent before.
    fn second_at(&self, sample: &Imu) -> Option<Imu> {
        let index = self.second.partition_point(|other| other.stamp < sample.stamp);
        let after = self.second.get(index)?;
        if after.stamp == sample.stamp {
            return Some(*after);
        }
        let before = self.second.get(index.checked_sub(1)?)?;
        let gap = after.stamp.secs_since(before.stamp);
        if gap > self.settings.timeout_s {
            return None;
        }
        let share = sample.stamp.secs_since(before.stamp) / gap;
        Some(Imu {
            stamp: sample.stamp,
            gyro: before.gyro + (after.gyro - before.gyro) * share,
            accel: before.accel + (after.accel - before.accel) * share,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of N readings without a walk the mean has a variance of white noise over N time steps, beside the prior's.
    #[test]
    fn the_difference_of_biases_is_the_mean_of_the_readings() {
        let (first, second) = (Vector3::new(0.3, -0.1, 0.2), Vector3::new(0.1, 0.1, 0.1));
        let mut difference = BiasDifference::new([0.02, 0.01], [0.0; 2], 0.4);
        for _ in 0..50 {
            difference.update(&first, &second, 0.005);
        }
        let (prior, data) = (0.4_f64.powi(-2), 50.0 * 0.005 / (0.02_f64.powi(2) + 0.01_f64.powi(2)));
        assert!((difference.variance * (prior + data) - 1.0).abs() < 1e-9);
        assert!((difference.mean - (first - second) * (data / (prior + data))).norm() < 1e-12);
    }
}
