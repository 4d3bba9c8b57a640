//! What an inertial sensor with its faults reads along a motion.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::rng::{Rng, derive};
use crate::error::Error;
use crate::error::{all_not_negative, invalid};
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;
use crate::trajectory::is_finite;
use crate::trajectory::spline::{Motion, Spline};

/// Samples that one recording may hold: 14 hours at 1 kHz.
const MAX_SAMPLES: f64 = 5e7;

/// An inertial sensor with its faults. The default is the sensor of the EuRoC vehicle: noise and walking biases only.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ImuModel {
    /// Samples per second; 200 as on the EuRoC vehicle.
    pub rate_hz: f64,
    /// White noise and bias walk; ADIS16448.
    pub noise: ImuNoise,
    /// Standard deviation of each axis of the gyroscope's first bias, rad/s; 0.01, ours.
    pub gyro_bias_sigma: f64,
    /// Standard deviation of each axis of the accelerometer's first bias, m/s²; 0.05, ours.
    pub accel_bias_sigma: f64,
    /// Pose of the sensor on the body: identity for the sensor that defines the body, a lever arm for a second one.
    pub body_from_imu: Isometry3<f64>,
    /// Scale and misalignment of the gyroscope: what it reads is this matrix times the true rate.
    pub gyro_matrix: Matrix3<f64>,
    /// Scale and misalignment of the accelerometer.
    pub accel_matrix: Matrix3<f64>,
    /// Rate that the gyroscope reads per specific force, (rad/s)/(m/s²).
    pub gyro_g_sensitivity: Matrix3<f64>,
    /// Vibration lines.
    pub vibrations: Vec<Vibration>,
    /// Largest readings, and how samples get lost.
    pub limits: ImuLimits,
}

/// What an inertial sensor and its transport cannot do.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ImuLimits {
    /// The gyroscope reads no more than this on any axis, rad/s; 1000 degrees per second as the ADIS16448.
    pub gyro_range: f64,
    /// The accelerometer reads no more than this on any axis, m/s²; 18 g as the ADIS16448.
    pub accel_range: f64,
    /// Chance that a sample is lost.
    pub drop_probability: f64,
    /// Standard deviation of the error of a stamp, s. Stamps keep their order: an error is cut to 0.49 of the interval.
    pub stamp_jitter_s: f64,
}

impl Default for ImuLimits {
    fn default() -> Self {
        Self { gyro_range: 17.45, accel_range: 176.5, drop_probability: 0.0, stamp_jitter_s: 0.0 }
    }
}

/// A line in the spectrum of the vibration, as a propeller makes it. Each axis has its own phase, drawn from the seed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Vibration {
    /// Frequency, Hz; above half the sensor's rate it folds back, as in a real sensor without a filter.
    pub frequency_hz: f64,
    /// Amplitude of the angular rate on each axis, rad/s.
    pub gyro_amplitude: f64,
    /// Amplitude of the specific force on each axis, m/s².
    pub accel_amplitude: f64,
}

impl Default for ImuModel {
    fn default() -> Self {
        Self {
            rate_hz: 200.0,
            noise: ImuNoise::default(),
            gyro_bias_sigma: 0.01,
            accel_bias_sigma: 0.05,
            body_from_imu: Isometry3::identity(),
            gyro_matrix: Matrix3::identity(),
            accel_matrix: Matrix3::identity(),
            gyro_g_sensitivity: Matrix3::zeros(),
            vibrations: Vec::new(),
            limits: ImuLimits::default(),
        }
    }
}

/// What a simulated sensor recorded, and the truth about its biases.
#[derive(Debug, Clone, PartialEq)]
pub struct ImuRecording {
    /// The samples that arrived, stamps strictly increasing.
    pub samples: Vec<Imu>,
    first: Stamp,
    rate_hz: f64,
    gyro_biases: Vec<Vector3<f64>>,
    accel_biases: Vec<Vector3<f64>>,
}

impl ImuModel {
    /// The ideal sensor: no noise, no bias.
    pub fn ideal(rate_hz: f64) -> Self {
        Self { rate_hz, noise: ImuNoise::ZERO, gyro_bias_sigma: 0.0, accel_bias_sigma: 0.0, ..Self::default() }
    }

    /// Refuses a sensor that cannot be: rates and limits not positive, anything not finite.
    pub fn check(&self) -> Result<(), Error> {
        self.noise.check()?;
        if !(self.rate_hz > 0.0 && self.rate_hz <= 1e5) {
            return Err(invalid("rate_hz", self.rate_hz, "must be above 0 and at most 100000 samples per second"));
        }
        for (name, range) in [("gyro_range", self.limits.gyro_range), ("accel_range", self.limits.accel_range)] {
            // An infinite range is a sensor without saturation.
            if range.is_nan() || range <= 0.0 {
                return Err(invalid(name, range, "must be positive"));
            }
        }
        if !(0.0..1.0).contains(&self.limits.drop_probability) {
            let rule = "must be at least 0 and below 1";
            return Err(invalid("drop_probability", self.limits.drop_probability, rule));
        }
        all_not_negative(&[
            ("gyro_bias_sigma", self.gyro_bias_sigma),
            ("accel_bias_sigma", self.accel_bias_sigma),
            ("stamp_jitter_s", self.limits.stamp_jitter_s),
        ])?;
        for line in &self.vibrations {
            all_not_negative(&[
                ("frequency_hz", line.frequency_hz),
                ("gyro_amplitude", line.gyro_amplitude),
                ("accel_amplitude", line.accel_amplitude),
            ])?;
        }
        let matrices = [&self.gyro_matrix, &self.accel_matrix, &self.gyro_g_sensitivity];
        if !matrices.iter().all(|m| m.iter().all(|v| v.is_finite())) {
            return Err(Error::NonFinite { what: "gyro_matrix, accel_matrix or gyro_g_sensitivity of IMU", index: 0 });
        }
        if is_finite(&self.body_from_imu) { Ok(()) } else { Err(Error::NonFinite { what: "body_from_imu", index: 0 }) }
    }

    /// Angular rate and specific force at the sensor, in its axes, without any fault:
    /// `R_ib (f + α × r + ω × (ω × r))` with the lever arm `r`.
    pub fn ideal_reading(&self, motion: &Motion, gravity: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (rate, lever) = (motion.rate_in_body, self.body_from_imu.translation.vector);
        let force = motion.specific_force(gravity)
            + motion.angular_acceleration_in_body.cross(&lever)
            + rate.cross(&rate.cross(&lever));
        let imu_from_body = self.body_from_imu.rotation.inverse();
        (imu_from_body * rate, imu_from_body * force)
    }

    /// Records the whole motion. A sample is the reading at its instant, not a mean over the interval; the same seed
    /// gives the same noise whatever the motion.
    pub fn record(&self, spline: &Spline, gravity: f64, seed: u64) -> Result<ImuRecording, Error> {
        self.check()?;
        let (first, last) = spline.span();
        let count = last.secs_since(first) * self.rate_hz;
        if count > MAX_SAMPLES {
            return Err(invalid("rate_hz", self.rate_hz, "must leave at most fifty million samples"));
        }
        let interval = 1.0 / self.rate_hz;
        // Each fault draws from its own stream: switching one on does not change the others.
        let mut white = Rng::new(derive(seed, 1));
        let mut walk = Rng::new(derive(seed, 2));
        let mut transport = Rng::new(derive(seed, 3));
        let phases = self.phases(derive(seed, 4));
        let mut gyro_bias = walk.normal_vector() * self.gyro_bias_sigma;
        let mut accel_bias = walk.normal_vector() * self.accel_bias_sigma;
        let mut recording = ImuRecording {
            samples: Vec::with_capacity(count as usize + 1),
            first,
            rate_hz: self.rate_hz,
            gyro_biases: Vec::with_capacity(count as usize + 1),
            accel_biases: Vec::with_capacity(count as usize + 1),
        };
        for index in 0..=count as usize {
            let since = index as f64 / self.rate_hz;
            let stamp = Stamp::from_nanos((first.nanos() + (since * 1e9).round() as i64).min(last.nanos()));
            let (rate, force) = self.ideal_reading(&spline.sample(stamp)?, gravity);
            let mut gyro = self.gyro_matrix * rate + self.gyro_g_sensitivity * force + gyro_bias;
            let mut accel = self.accel_matrix * force + accel_bias;
            for (line, (gyro_phase, accel_phase)) in self.vibrations.iter().zip(&phases) {
                let angle = std::f64::consts::TAU * line.frequency_hz * since;
                gyro += gyro_phase.map(|p| line.gyro_amplitude * (angle + p).sin());
                accel += accel_phase.map(|p| line.accel_amplitude * (angle + p).sin());
            }
            let root_rate = self.rate_hz.sqrt();
            gyro += white.normal_vector() * (self.noise.gyro_density * root_rate);
            accel += white.normal_vector() * (self.noise.accel_density * root_rate);
            let limits = &self.limits;
            let sample = Imu {
                stamp: limits.stamp(stamp, interval, &mut transport),
                gyro: gyro.map(|v| v.clamp(-limits.gyro_range, limits.gyro_range)),
                accel: accel.map(|v| v.clamp(-limits.accel_range, limits.accel_range)),
            };
            if transport.uniform() >= limits.drop_probability {
                recording.samples.push(sample);
            }
            recording.gyro_biases.push(gyro_bias);
            recording.accel_biases.push(accel_bias);
            gyro_bias += walk.normal_vector() * (self.noise.gyro_walk * interval.sqrt());
            accel_bias += walk.normal_vector() * (self.noise.accel_walk * interval.sqrt());
        }
        Ok(recording)
    }

    /// For each vibration line, the phases of the three axes of both sensors.
    fn phases(&self, seed: u64) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let mut rng = Rng::new(seed);
        let mut phase = || Vector3::from_fn(|_, _| std::f64::consts::TAU * rng.uniform());
        self.vibrations.iter().map(|_| (phase(), phase())).collect()
    }
}

impl ImuLimits {
    fn stamp(&self, stamp: Stamp, interval: f64, rng: &mut Rng) -> Stamp {
        let error = (rng.normal() * self.stamp_jitter_s).clamp(-0.49 * interval, 0.49 * interval);
        Stamp::from_nanos(stamp.nanos() + (error * 1e9) as i64)
    }
}

impl ImuRecording {
    /// True biases of gyroscope (rad/s) and accelerometer (m/s²) at a time, linear between samples and constant beyond
    /// the first and the last.
    pub fn biases_at(&self, stamp: Stamp) -> (Vector3<f64>, Vector3<f64>) {
        let last = self.gyro_biases.len() - 1;
        let place = (stamp.secs_since(self.first) * self.rate_hz).clamp(0.0, last as f64);
        let (index, fraction) = ((place as usize).min(last.saturating_sub(1)), place.fract());
        let next = (index + 1).min(last);
        let fraction = if place >= last as f64 { 1.0 } else { fraction };
        (
            self.gyro_biases[index].lerp(&self.gyro_biases[next], fraction),
            self.accel_biases[index].lerp(&self.accel_biases[next], fraction),
        )
    }
}
