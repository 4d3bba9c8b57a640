//! The log of a flight.

use nalgebra::{Point3, UnitVector3, Vector3};

use super::sample::FlightSample;
use super::statistics::FlightStatistics;
use crate::spray::Shot;

/// A simulated flight.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FlightLog {
    /// One sample every `interval` seconds from 0 to the end of the reference.
    pub samples: Vec<FlightSample>,
    /// Time between samples, s.
    pub interval: f64,
}

impl FlightLog {
    /// The paint that left the nozzle: one shot for every `step` metres that the aim or the nozzle has moved with the valve
    /// open, from the mean pose of its samples weighted by their flow. A step well below the size of the spot changes nothing
    /// that can be seen; zero gives one shot per sample.
    pub fn shots(&self, step: f64) -> Vec<Shot> {
        self.timed_shots(step).into_iter().map(|(_, shot)| shot).collect()
    }

    /// The same with the time of each shot's first sample, s.
    pub fn timed_shots(&self, step: f64) -> Vec<(f64, Shot)> {
        let mut shots = Vec::new();
        let mut accumulated = ShotAccumulator::default();
        for sample in &self.samples {
            let moved = accumulated.first.is_some_and(|first| {
                let turned = (sample.axis.into_inner() - first.axis.into_inner()).norm() * sample.wanted_distance;
                (sample.nozzle - first.nozzle).norm() + turned >= step
            });
            if moved || sample.flow <= 0.0 {
                shots.extend(accumulated.shot());
                accumulated = ShotAccumulator::default();
            }
            if sample.flow > 0.0 {
                accumulated.add(sample, sample.flow * self.interval);
            }
        }
        shots.extend(accumulated.shot());
        shots
    }

    /// Samples `step` seconds apart, the first among them; as near to that as the interval allows.
    pub fn every(&self, step: f64) -> impl Iterator<Item = &FlightSample> {
        self.samples.iter().step_by(self.stride(step))
    }

    /// The log of those alone: what is kept of a long flight. Its [`shots`](Self::shots) are those of all samples; take them before.
    #[must_use]
    pub fn thinned(&self, step: f64) -> Self {
        Self { samples: self.every(step).copied().collect(), interval: self.stride(step) as f64 * self.interval }
    }

    fn stride(&self, step: f64) -> usize {
        (step / self.interval).round().max(1.0) as usize
    }

    /// How well the flight followed its reference.
    pub fn statistics(&self) -> FlightStatistics {
        FlightStatistics::of(&[&self.samples])
    }
}

/// Samples on their way to become one shot.
#[derive(Default)]
struct ShotAccumulator<'a> {
    first: Option<&'a FlightSample>,
    volume: f64,
    nozzle: Vector3<f64>,
    axis: Vector3<f64>,
}

impl<'a> ShotAccumulator<'a> {
    fn add(&mut self, sample: &'a FlightSample, volume: f64) {
        self.first.get_or_insert(sample);
        self.volume += volume;
        self.nozzle += volume * sample.nozzle.coords;
        self.axis += volume * sample.axis.into_inner();
    }

    fn shot(&self) -> Option<(f64, Shot)> {
        let first = self.first?;
        let axis = UnitVector3::try_new(self.axis, 1e-300).unwrap_or(first.axis);
        let shot = Shot { origin: Point3::from(self.nozzle / self.volume), axis, volume: self.volume };
        Some((first.time, shot))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

    #[test]
    fn a_thinned_log_keeps_its_times() {
        let sample = |k: u32| FlightSample {
            time: 0.01 * f64::from(k),
            world_from_body: Isometry3::identity(),
            velocity: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            attitude: [0.0; 3],
            estimated_position: Point3::origin(),
            reference_position: Point3::origin(),
            pan_tilt: [0.0; 2],
            desired_pan_tilt: [0.0; 2],
            nozzle: Point3::origin(),
            axis: Vector3::x_axis(),
            aim: None,
            hit: None,
            distance: 0.1,
            wanted_distance: 0.1,
            flow: 1.0,
            held: false,
        };
        let log = FlightLog { samples: (0..102).map(sample).collect(), interval: 0.01 };
        let thin = log.thinned(0.05);
        assert!(thin.samples.len() == 21 && (thin.interval - 0.05).abs() < 1e-15);
        for (k, kept) in thin.samples.iter().enumerate() {
            assert!((kept.time - 0.05 * k as f64).abs() < 1e-12, "{}", kept.time);
        }
        // No finer than it is, and nothing of nothing.
        assert_eq!((log.thinned(0.001), FlightLog::default().every(0.1).count()), (log, 0));
    }
}
