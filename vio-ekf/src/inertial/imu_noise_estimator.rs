//! Adaptive IMU noise: saturated and vibrating samples count less than the data sheet says.

use nalgebra::Vector3;

use crate::error::Error;
use crate::error::{all_not_negative, all_positive, invalid};
use crate::samples::{Imu, ImuNoise};

/// When scale and axes of the accelerometer are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum AccelMatrixEstimation {
    /// Never: the sensor is calibrated.
    Never,
    /// From when on the corrections of images fit an error of scale or axes and not the noise of the sensor. A calibrated sensor stays
    /// as it is: nine more unknowns cost accuracy on motions that excite them little.
    #[default]
    WhenNeeded,
    /// From the start.
    Always,
}

/// How an inertial sensor may be worse than its data sheet, and how many of its samples are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ImuSettings {
    /// The gyroscope reads no more than this on any axis, rad/s; 1000 degrees per second as the ADIS16448.
    pub gyro_range: f64,
    /// The accelerometer reads no more than this on any axis, m/s²; 18 g as the ADIS16448.
    pub accel_range: f64,
    /// Noise that is estimated from the samples replaces that of the data sheet where it exceeds it by this factor; 4, ours.
    /// Vibration is noise: in full for the gyroscope, for the accelerometer its integrated part.
    pub noise_inflation: f64,
    /// The noise of each sensor grows up to this factor while images correct velocity and attitude by more than it explains
    /// (innovation-based adaptive estimation); 30, ours. 1 to believe the readings.
    pub max_innovation_inflation: f64,
    /// Whether scale and axes of the accelerometer are estimated; ours: when the images ask for it.
    pub accel_matrix: AccelMatrixEstimation,
    /// Standard deviation of the accelerometer's scale on each axis, relative, where it is estimated; ours: 0.0175, with which 5 % are
    /// found. With more a calibrated sensor loses accuracy before far walls, with less, errors of 5 % stay behind.
    pub accel_scale_sigma: f64,
    /// Standard deviation of the angles between the accelerometer's axes and those of the body, rad, where they are estimated; ours:
    /// 0.012.
    pub accel_misalignment_sigma: f64,
    /// Standard deviation of the scale of each axis of the gyroscope, relative; ours: 0, and they are not estimated. As intrinsics they are
    /// estimated beside lenses of Kalibr's models alone.
    pub gyro_scale_sigma: f64,
    /// Inertial samples that are kept for measurements that arrive late; ours: 256, which is 1.3 s at 200 Hz.
    pub buffer_samples: usize,
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            gyro_range: 17.45,
            accel_range: 176.5,
            noise_inflation: 4.0,
            max_innovation_inflation: 30.0,
            accel_matrix: AccelMatrixEstimation::WhenNeeded,
            accel_scale_sigma: 0.0175,
            accel_misalignment_sigma: 0.012,
            gyro_scale_sigma: 0.0,
            buffer_samples: 256,
        }
    }
}

impl ImuSettings {
    /// Standard deviation of an entry of the accelerometer's matrix, counted row by row.
    pub(crate) fn accel_matrix_sigma(&self, entry: usize) -> f64 {
        if entry.is_multiple_of(4) { self.accel_scale_sigma } else { self.accel_misalignment_sigma }
    }

    /// Refuses values that no sensor can have.
    pub(crate) fn check(&self) -> Result<(), Error> {
        check_buffer("imu.buffer_samples", self.buffer_samples)?;
        all_not_negative(&[
            ("accel_scale_sigma", self.accel_scale_sigma),
            ("accel_misalignment_sigma", self.accel_misalignment_sigma),
            ("gyro_scale_sigma", self.gyro_scale_sigma),
        ])?;
        if self.max_innovation_inflation.is_nan() || self.max_innovation_inflation < 1.0 {
            return Err(invalid("max_innovation_inflation", self.max_innovation_inflation, "must be at least 1"));
        }
        all_positive(&[
            ("gyro_range", self.gyro_range),
            ("accel_range", self.accel_range),
            ("noise_inflation", self.noise_inflation),
        ])
    }
}

/// Refuses a buffer that is too short to be of use, or that exhausts the memory.
pub(crate) fn check_buffer(name: &'static str, count: usize) -> Result<(), Error> {
    if (8..=100_000).contains(&count) {
        Ok(())
    } else {
        Err(invalid(name, count as f64, "must be between 8 and 100000"))
    }
}

/// What exceeds the range is taken to be anywhere within as much again, for as long as this, s: the time between two images.
const SATURATED_S: f64 = 0.05;
/// Share of the range from which on a reading is saturated.
const SATURATION_SHARE: f64 = 0.99;
/// Octaves in which noise is estimated; used are those whose values are at most this far apart, s: flight is slower.
const OCTAVES: usize = 6;
const MAX_SPACING_S: f64 = 0.05;
/// Mean square of the third difference in each octave, for white noise of unit density, times the spacing of its values: 20 in the
/// first, less in the others, which are smoothed. From the sums of squares of the filters in a row.
const GAINS: [f64; OCTAVES] = [20.0, 6.875, 5.070_312_5, 4.711_425_8, 4.627_472, 4.606_844];
/// Mean of the least of the four octaves of 200 Hz, for white noise of unit density: the least of several estimates is too small. By
/// simulation, as the test does it.
const LEAST: f64 = 0.79;
/// Weight of the latest value in the mean of an octave, and the most it is in slower ones.
const WEIGHT: f64 = 1.0 / 32.0;
const MAX_WEIGHT: f64 = 1.0 / 8.0;
/// Values from which on an octave's mean is one.
const MIN_VALUES: u32 = 8;

/// Noise of one sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SampleNoise {
    /// Density of the white noise estimated from the samples until this one, mean over the axes of gyroscope and accelerometer.
    estimated: [f64; 2],
    /// By axis.
    saturated: [[bool; 3]; 2],
}

/// Estimates the noise of samples from the samples themselves. The result depends on them alone, not on when it is asked for.
///
/// Vibration makes lines in the spectrum of a sensor. An angle is seen in each image and shakes in full, but a velocity is only
/// integrated: a line of some metres per second squared moves it by centimetres per second to and fro, without drift. White
/// noise, which does drift, is in all octaves alike. So the accelerometer's noise is that of its octave of least power.
#[derive(Debug, Clone)]
pub(crate) struct ImuNoiseEstimator {
    latest: Imu,
    /// Time between two samples, mean, s.
    spacing: f64,
    gyro: Octave,
    accel: [Octave; OCTAVES],
}

/// Readings of half the rate of the octave before.
#[derive(Debug, Clone, Copy, Default)]
struct Octave {
    /// The latest first.
    before: [Vector3<f64>; 3],
    count: u32,
    /// Mean square of the third difference, by axis.
    mean_square: f64,
}

impl Octave {
    /// Takes a reading; gives one to the next octave, every second time.
    fn push(&mut self, reading: Vector3<f64>, weight: f64) -> Option<Vector3<f64>> {
        let [a, b, c] = self.before;
        self.before = [reading, a, b];
        self.count = self.count.saturating_add(1);
        if self.count <= 3 {
            return None;
        }
        // Motion has next to none.
        let difference = (reading - c) - (a - b) * 3.0;
        self.mean_square += weight * (difference.norm_squared() / 3.0 - self.mean_square);
        self.count.is_multiple_of(2).then(|| ((reading + c) + (a + b) * 3.0) / 8.0)
    }
}

impl ImuNoiseEstimator {
    /// Of the samples after one.
    pub(crate) fn new(sample: Imu) -> Self {
        Self { latest: sample, spacing: 0.0, gyro: Octave::default(), accel: [Octave::default(); OCTAVES] }
    }

    /// Takes the next sample.
    pub(crate) fn sample(&mut self, sample: &Imu, settings: &ImuSettings) -> SampleNoise {
        let gap = sample.stamp.secs_since(self.latest.stamp);
        self.spacing += if self.spacing > 0.0 { WEIGHT * (gap - self.spacing) } else { gap };
        self.latest = *sample;
        self.gyro.push(sample.gyro, WEIGHT);
        let (mut reading, mut spacing, mut weight) = (Some(sample.accel), self.spacing, WEIGHT);
        let mut lowest = f64::INFINITY;
        for (octave, gain) in self.accel.iter_mut().zip(GAINS) {
            reading = reading.and_then(|reading| octave.push(reading, weight));
            if octave.count >= MIN_VALUES && spacing <= MAX_SPACING_S.max(self.spacing) {
                lowest = lowest.min(octave.mean_square * spacing / gain);
            }
            (spacing, weight) = (2.0 * spacing, (2.0 * weight).min(MAX_WEIGHT));
        }
        let accel = if lowest.is_finite() { (lowest / LEAST).sqrt() } else { 0.0 };
        let saturated = [(sample.gyro, settings.gyro_range), (sample.accel, settings.accel_range)]
            .map(|(reading, range)| std::array::from_fn(|axis| reading[axis].abs() >= SATURATION_SHARE * range));
        SampleNoise { estimated: [(self.gyro.mean_square * self.spacing / GAINS[0]).sqrt(), accel], saturated }
    }
}

impl SampleNoise {
    /// Densities of the white noise between two samples, by axis of gyroscope and accelerometer.
    pub(crate) fn densities(&self, before: &Self, noise: &ImuNoise, settings: &ImuSettings) -> [[f64; 3]; 2] {
        let larger = [0, 1].map(|k| self.estimated[k].max(before.estimated[k]));
        let within = Self { estimated: larger, ..*self }.within_range(noise, settings);
        let density = |k: usize, range: f64| {
            std::array::from_fn(|axis| {
                let saturated = self.saturated[k][axis] || before.saturated[k][axis];
                if saturated { range * SATURATED_S.sqrt() } else { within[k] }
            })
        };
        [density(0, settings.gyro_range), density(1, settings.accel_range)]
    }

    /// Density of the white noise of what is not saturated, of gyroscope and accelerometer.
    pub(crate) fn within_range(&self, noise: &ImuNoise, settings: &ImuSettings) -> [f64; 2] {
        let sheet = [noise.gyro_density, noise.accel_density];
        [0, 1]
            .map(|k| if self.estimated[k] > settings.noise_inflation * sheet[k] { self.estimated[k] } else { sheet[k] })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::sim::Rng;
    use crate::stamp::Stamp;

    const SHEET: ImuNoise = ImuNoise { gyro_density: 2e-4, accel_density: 2e-3, ..ImuNoise::ZERO };

    /// Densities after two seconds at 200 Hz of a motion that changes steadily, with readings added on all axes.
    fn estimated(add: impl Fn(usize) -> f64, settings: &ImuSettings) -> [[f64; 3]; 2] {
        let sample = |k: usize| {
            let t = k as f64 * 0.005;
            let gyro = Vector3::new(0.3, 1.2, -0.5) * t + Vector3::repeat(add(k));
            let accel = Vector3::new(1.0, 2.0, 9.81) + Vector3::repeat(add(k));
            Imu { stamp: Stamp::from_nanos(k as i64 * 5_000_000), gyro, accel }
        };
        let mut estimator = ImuNoiseEstimator::new(sample(0));
        let noises: Vec<SampleNoise> = (1..400).map(|k| estimator.sample(&sample(k), settings)).collect();
        noises[398].densities(&noises[397], &SHEET, settings)
    }

    #[test]
    fn steady_motion_shows_no_noise() {
        assert_eq!(estimated(|_| 0.0, &ImuSettings::default()), [[2e-4; 3], [2e-3; 3]]);
    }

    #[test]
    fn white_noise_shows_its_own_variance() {
        // Evenly spread over ±1: a variance of a third, a density of √(0.005 / 3).
        let noise = |k: usize| {
            let z = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            ((z ^ (z >> 27)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let [gyro, accel] = estimated(noise, &ImuSettings::default());
        let expected = (0.005_f64 / 3.0).sqrt();
        assert!((gyro[0] / expected - 1.0).abs() < 0.3, "{} {expected}", gyro[0]);
        assert!((0.6..1.3).contains(&(accel[0] / expected)), "{} {expected}", accel[0]);
    }

    #[test]
    fn the_least_of_the_octaves_is_right_in_the_mean() {
        let (mut rng, settings) = (Rng::new(4), ImuSettings::default());
        let mut sample = |k: usize| {
            let stamp = Stamp::from_nanos(k as i64 * 5_000_000);
            Imu { stamp, gyro: Vector3::zeros(), accel: rng.normal_vector() * (0.02 * 200.0_f64.sqrt()) }
        };
        let mut estimator = ImuNoiseEstimator::new(sample(0));
        let squares: Vec<f64> =
            (1..40_000).map(|k| estimator.sample(&sample(k), &settings).estimated[1].powi(2)).collect();
        let mean = squares[1000..].iter().sum::<f64>() / (squares.len() - 1000) as f64;
        assert!((mean.sqrt() / 0.02 - 1.0).abs() < 0.02, "{}", mean.sqrt());
    }

    #[test]
    fn a_line_shakes_but_does_not_drift() {
        let line = |hertz: f64| move |k: usize| 6.0 * (std::f64::consts::TAU * hertz * 0.005 * k as f64).sin();
        for hertz in [26.0, 87.0, 113.0, 174.0] {
            let [gyro, accel] = estimated(line(hertz), &ImuSettings::default());
            // |2 sin(π f / 200)|³ / √20 of 6/√2, as the density of white noise.
            let expected = 6.0 / 2_f64.sqrt() * (2.0 * (std::f64::consts::PI * hertz / 200.0).sin()).abs().powi(3);
            let expected = expected * (0.005_f64 / 20.0).sqrt();
            assert!((gyro[0] / expected - 1.0).abs() < 0.05, "{hertz}: {} {expected}", gyro[0]);
            assert!(accel[0] < 0.01, "{hertz}: {}", accel[0]);
        }
    }

    #[test]
    fn the_axis_at_its_end_is_not_believed() {
        let settings = ImuSettings { gyro_range: 2.0, ..ImuSettings::default() };
        let [gyro, accel] = estimated(|_| 0.0, &settings);
        // Only the second axis reads more than 2 rad/s, at the end.
        assert_eq!(gyro, [2e-4, 2.0 * SATURATED_S.sqrt(), 2e-4]);
        assert_eq!(accel, [2e-3; 3]);
    }
}
