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

    /// How well the flight followed its reference.
    pub fn statistics(&self) -> FlightStatistics {
        FlightStatistics::of(&self.samples)
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
