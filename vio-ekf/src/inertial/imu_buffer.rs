//! The delay buffer: inertial samples since the time of the state, so that late measurements are used at their own time.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::core_state::ImuCorrection;
use super::imu_noise_estimator::{ImuNoiseEstimator, ImuSettings, SampleNoise};
use super::preintegration::ImuPreintegration;
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;

/// The inertial samples since the time of the state, so that an image that arrives late is used at its own time.
#[derive(Debug, Clone)]
pub(crate) struct ImuBuffer {
    /// Begins with the last sample at or before the time of the state.
    samples: VecDeque<Imu>,
    /// Noise of each sample; without settings the data sheet is believed.
    noises: VecDeque<SampleNoise>,
    sensor: Option<ImuSettings>,
    estimator: ImuNoiseEstimator,
    /// On the densities of gyroscope and accelerometer.
    noise_factors: [f64; 2],
    capacity: usize,
    state_stamp: Stamp,
    started: Stamp,
}

impl ImuBuffer {
    /// With the state at a time from that of the sample on.
    pub(crate) fn new(sample: Imu, state_stamp: Stamp, capacity: usize) -> Self {
        let mut samples = VecDeque::with_capacity(capacity);
        samples.push_back(sample);
        let mut noises = VecDeque::with_capacity(capacity);
        noises.push_back(SampleNoise::default());
        Self {
            samples,
            noises,
            sensor: None,
            estimator: ImuNoiseEstimator::new(sample),
            noise_factors: [1.0; 2],
            capacity,
            state_stamp,
            started: state_stamp,
        }
    }

    /// The same with adaptive noise: saturated and vibrating samples get a larger one.
    pub(crate) fn with_noise_estimation(self, sensor: ImuSettings) -> Self {
        Self { sensor: Some(sensor), ..self }
    }

    /// From here on the noise of gyroscope and accelerometer is so many times as large.
    pub(crate) fn set_noise_factors(&mut self, factors: [f64; 2]) {
        self.noise_factors = factors;
    }

    /// Time of the state.
    pub(crate) fn state_stamp(&self) -> Stamp {
        self.state_stamp
    }

    /// Whether the state is still at its initial time.
    pub(crate) fn is_at_start(&self) -> bool {
        self.state_stamp == self.started
    }

    /// The latest time that is known of: of the last sample, or of a state after it.
    pub(crate) fn now(&self) -> Stamp {
        self.latest().stamp.max(self.state_stamp)
    }

    pub(crate) fn latest(&self) -> &Imu {
        &self.samples[self.samples.len() - 1]
    }

    /// Whether another sample would need more memory.
    pub(crate) fn is_full(&self) -> bool {
        self.samples.len() >= self.capacity
    }

    /// Time of the sample in the middle, which is after the state if there are three or more.
    pub(crate) fn middle(&self) -> Stamp {
        self.samples[self.samples.len() / 2].stamp.max(self.state_stamp)
    }

    /// The earliest time of a state that leaves half of the buffer free.
    pub(crate) fn half_free(&self) -> Stamp {
        self.samples[self.samples.len().saturating_sub(self.capacity / 2)].stamp
    }

    pub(crate) fn push(&mut self, sample: Imu) {
        let noise_of_sample = self.sensor.map(|sensor| self.estimator.sample(&sample, &sensor));
        self.noises.push_back(noise_of_sample.unwrap_or_default());
        self.samples.push_back(sample);
    }

    /// Densities of the white noise between two neighbours, the first of which has this index.
    fn densities(&self, index: usize, noise: &ImuNoise) -> [[f64; 3]; 2] {
        let densities = match &self.sensor {
            Some(sensor) => self.noises[index + 1].densities(&self.noises[index], noise, sensor),
            None => [[noise.gyro_density; 3], [noise.accel_density; 3]],
        };
        [0, 1].map(|k| densities[k].map(|density| density * self.noise_factors[k]))
    }

    /// Moves the time of the state forward and drops the samples before it.
    pub(crate) fn advance(&mut self, state_stamp: Stamp) {
        self.state_stamp = state_stamp;
        while self.samples.len() > 1 && self.samples[1].stamp <= state_stamp {
            self.samples.pop_front();
            self.noises.pop_front();
        }
    }

    /// Rate read at the time of the state.
    pub(crate) fn rate_at_state(&self) -> Vector3<f64> {
        self.reading(self.state_stamp).gyro
    }

    /// What the sensor would have read at a time: linear between samples, constant before the first and after the last.
    pub(crate) fn reading(&self, stamp: Stamp) -> Imu {
        let after = self.samples.partition_point(|sample| sample.stamp <= stamp);
        let before = self.samples[after.saturating_sub(1)];
        match self.samples.get(after) {
            Some(next) if stamp > before.stamp => {
                let share = stamp.secs_since(before.stamp) / next.stamp.secs_since(before.stamp);
                let gyro = before.gyro + (next.gyro - before.gyro) * share;
                Imu { stamp, gyro, accel: before.accel + (next.accel - before.accel) * share }
            }
            _ => Imu { stamp, ..before },
        }
    }

    /// Preintegrates from the state until a time. Between samples rate and force are linear; after the last one they stay.
    pub(crate) fn preintegrate(&self, until: Stamp, correction: &ImuCorrection, noise: &ImuNoise) -> ImuPreintegration {
        self.preintegrate_between(self.state_stamp, until, correction, noise)
    }

    /// The same from a time after the state.
    pub(crate) fn preintegrate_between(
        &self,
        from: Stamp,
        until: Stamp,
        correction: &ImuCorrection,
        noise: &ImuNoise,
    ) -> ImuPreintegration {
        let mut preintegration = ImuPreintegration::default();
        self.continue_preintegration(&mut preintegration, (from, until), correction, noise);
        preintegration
    }

    /// Continues a preintegration over a span of time.
    pub(crate) fn continue_preintegration(
        &self,
        preintegration: &mut ImuPreintegration,
        (mut from, until): (Stamp, Stamp),
        correction: &ImuCorrection,
        noise: &ImuNoise,
    ) {
        let first = self.samples.partition_point(|sample| sample.stamp <= from).saturating_sub(1);
        for index in first..self.samples.len() - 1 {
            if from >= until {
                return;
            }
            let (before, after) = (&self.samples[index], &self.samples[index + 1]);
            let to = after.stamp.min(until);
            integrate_segment(
                preintegration,
                before,
                after,
                (from, to),
                correction,
                (noise, &self.densities(index, noise)),
            );
            from = to;
        }
        if until > from {
            let last = self.latest();
            integrate_segment(
                preintegration,
                last,
                last,
                (from, until),
                correction,
                (noise, &[[noise.gyro_density; 3], [noise.accel_density; 3]]),
            );
        }
    }

    /// Continues a preintegration that reaches until the last sample but one.
    pub(crate) fn continue_to_latest(
        &self,
        preintegration: &mut ImuPreintegration,
        correction: &ImuCorrection,
        noise: &ImuNoise,
    ) {
        let count = self.samples.len();
        let (before, after) = (&self.samples[count.saturating_sub(2)], &self.samples[count - 1]);
        let from = before.stamp.max(self.state_stamp);
        if after.stamp > from {
            let densities = self.densities(count - 2, noise);
            integrate_segment(preintegration, before, after, (from, after.stamp), correction, (noise, &densities));
        }
    }
}

/// Over a part of the time between two samples, or after them if they are the same.
fn integrate_segment(
    preintegration: &mut ImuPreintegration,
    before: &Imu,
    after: &Imu,
    (from, to): (Stamp, Stamp),
    correction: &ImuCorrection,
    (noise, densities): (&ImuNoise, &[[f64; 3]; 2]),
) {
    let gap = after.stamp.secs_since(before.stamp);
    let dt = to.secs_since(from);
    let fraction = if gap > 0.0 { (from.secs_since(before.stamp) + 0.5 * dt) / gap } else { 0.0 };
    let mean = |a: &Vector3<f64>, b: &Vector3<f64>| a + (b - a) * fraction;
    let readings = [mean(&before.gyro, &after.gyro), mean(&before.accel, &after.accel)];
    let (rate, force) = (correction.rate(&readings[0]), correction.force(&readings[1]));
    if correction.is_scaled() {
        preintegration.advance_by_calibration((&rate, &force), &readings, dt);
    }
    preintegration.integrate_with_densities(&rate, &force, dt, noise, densities);
}
