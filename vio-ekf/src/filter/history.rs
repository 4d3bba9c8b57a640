use std::collections::VecDeque;

use nalgebra::Vector3;

use super::interval::Interval;
use super::trust::{Judge, SensorSettings, Trust};
use crate::{Imu, ImuNoise, Stamp};

/// The inertial samples since the anchor, so that an image that arrives late is used at its own time.
#[derive(Debug, Clone)]
pub(crate) struct History {
    /// Begins with the last sample at or before the anchor.
    samples: VecDeque<Imu>,
    /// Of each sample, and what it is judged by; without settings the data sheet is believed.
    trusts: VecDeque<Trust>,
    sensor: Option<SensorSettings>,
    judge: Judge,
    capacity: usize,
    anchor: Stamp,
    started: Stamp,
}

impl History {
    /// Anchored at a sample.
    pub(crate) fn new(sample: Imu, anchor: Stamp, capacity: usize) -> Self {
        let mut samples = VecDeque::with_capacity(capacity);
        samples.push_back(sample);
        let mut trusts = VecDeque::with_capacity(capacity);
        trusts.push_back(Trust::default());
        Self { samples, trusts, sensor: None, judge: Judge::new(sample), capacity, anchor, started: anchor }
    }

    /// The same, but the samples are believed only as far as they deserve.
    pub(crate) fn judging(self, sensor: SensorSettings) -> Self {
        Self { sensor: Some(sensor), ..self }
    }

    /// Time of the anchor.
    pub(crate) fn anchor(&self) -> Stamp {
        self.anchor
    }

    /// Whether the anchor is still where it started.
    pub(crate) fn is_new(&self) -> bool {
        self.anchor == self.started
    }

    /// The latest time that is known of: of the last sample, or of an anchor after it.
    pub(crate) fn now(&self) -> Stamp {
        self.latest().stamp.max(self.anchor)
    }

    pub(crate) fn latest(&self) -> &Imu {
        &self.samples[self.samples.len() - 1]
    }

    /// Whether another sample would need more memory.
    pub(crate) fn is_full(&self) -> bool {
        self.samples.len() >= self.capacity
    }

    /// Time of the sample in the middle, which is after the anchor if there are three or more.
    pub(crate) fn middle(&self) -> Stamp {
        self.samples[self.samples.len() / 2].stamp.max(self.anchor)
    }

    /// An anchor from here on leaves room for as many samples again.
    pub(crate) fn oldest(&self) -> Stamp {
        self.samples[self.samples.len().saturating_sub(self.capacity / 2)].stamp
    }

    pub(crate) fn push(&mut self, sample: Imu) {
        let trust = self.sensor.map(|sensor| self.judge.sample(&sample, &sensor));
        self.trusts.push_back(trust.unwrap_or_default());
        self.samples.push_back(sample);
    }

    /// Densities of the white noise between two neighbours, the first of which has this index.
    fn densities(&self, index: usize, noise: &ImuNoise) -> [[f64; 3]; 2] {
        let Some(sensor) = &self.sensor else { return [[noise.gyro_density; 3], [noise.accel_density; 3]] };
        self.trusts[index + 1].densities(&self.trusts[index], noise, sensor)
    }

    /// Moves the anchor forward and forgets what is before it.
    pub(crate) fn advance(&mut self, anchor: Stamp) {
        self.anchor = anchor;
        while self.samples.len() > 1 && self.samples[1].stamp <= anchor {
            self.samples.pop_front();
            self.trusts.pop_front();
        }
    }

    /// Rate read at the anchor.
    pub(crate) fn rate_at_anchor(&self) -> Vector3<f64> {
        self.reading(self.anchor).gyro
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

    /// Motion from the anchor until a time. Between samples rate and force are linear; after the last one they stay.
    pub(crate) fn integrate(&self, until: Stamp, biases: &[Vector3<f64>; 2], noise: &ImuNoise) -> Interval {
        self.between(self.anchor, until, biases, noise)
    }

    /// The same from a time after the anchor.
    pub(crate) fn between(&self, from: Stamp, until: Stamp, biases: &[Vector3<f64>; 2], noise: &ImuNoise) -> Interval {
        let mut interval = Interval::default();
        self.extend(&mut interval, (from, until), biases, noise);
        interval
    }

    /// Goes on with an interval over a span of time.
    pub(crate) fn extend(
        &self,
        interval: &mut Interval,
        (mut from, until): (Stamp, Stamp),
        biases: &[Vector3<f64>; 2],
        noise: &ImuNoise,
    ) {
        let first = self.samples.partition_point(|sample| sample.stamp <= from).saturating_sub(1);
        for index in first..self.samples.len() - 1 {
            if from >= until {
                return;
            }
            let (before, after) = (&self.samples[index], &self.samples[index + 1]);
            let to = after.stamp.min(until);
            extend(interval, before, after, (from, to), biases, (noise, &self.densities(index, noise)));
            from = to;
        }
        if until > from {
            let last = self.latest();
            extend(
                interval,
                last,
                last,
                (from, until),
                biases,
                (noise, &[[noise.gyro_density; 3], [noise.accel_density; 3]]),
            );
        }
    }

    /// Goes on with an interval that reaches until the last sample but one.
    pub(crate) fn extend_to_latest(&self, interval: &mut Interval, biases: &[Vector3<f64>; 2], noise: &ImuNoise) {
        let count = self.samples.len();
        let (before, after) = (&self.samples[count.saturating_sub(2)], &self.samples[count - 1]);
        let from = before.stamp.max(self.anchor);
        if after.stamp > from {
            let densities = self.densities(count - 2, noise);
            extend(interval, before, after, (from, after.stamp), biases, (noise, &densities));
        }
    }
}

/// Over a part of the time between two samples, or after them if they are the same.
fn extend(
    interval: &mut Interval,
    before: &Imu,
    after: &Imu,
    (from, to): (Stamp, Stamp),
    [gyro_bias, accel_bias]: &[Vector3<f64>; 2],
    (noise, densities): (&ImuNoise, &[[f64; 3]; 2]),
) {
    let gap = after.stamp.secs_since(before.stamp);
    let dt = to.secs_since(from);
    let fraction = if gap > 0.0 { (from.secs_since(before.stamp) + 0.5 * dt) / gap } else { 0.0 };
    let mean = |a: &Vector3<f64>, b: &Vector3<f64>, bias: &Vector3<f64>| a + (b - a) * fraction - bias;
    let rate = mean(&before.gyro, &after.gyro, gyro_bias);
    let force = mean(&before.accel, &after.accel, accel_bias);
    interval.extend_shaken(&rate, &force, dt, noise, densities);
}
