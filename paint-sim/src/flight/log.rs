//! What a flight leaves behind.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use super::statistics::FlightStatistics;
use crate::spray::Shot;

/// The state of a flight at one moment. World frame, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightSample {
    /// Time of the reference, s.
    pub time: f64,
    /// True pose.
    pub world_from_body: Isometry3<f64>,
    /// True velocity of the body's centre, m/s.
    pub velocity: Vector3<f64>,
    /// Its acceleration, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Roll, pitch and yaw, rad.
    pub attitude: [f64; 3],
    /// What the controller takes for the position.
    pub estimated_position: Point3<f64>,
    /// What the reference wants at this time.
    pub reference_position: Point3<f64>,
    /// Pan and tilt.
    pub pan_tilt: [f64; 2],
    /// Pan and tilt that would hit the aim from the TRUE pose at this time, within the unit's limits; the actual ones
    /// where there is no aim.
    pub desired_pan_tilt: [f64; 2],
    /// Tip of the nozzle.
    pub nozzle: Point3<f64>,
    /// Spray direction.
    pub axis: UnitVector3<f64>,
    /// The point that the reference wants to hit at this time.
    pub aim: Option<Point3<f64>>,
    /// Where the spray's axis meets the surface.
    pub hit: Option<Point3<f64>>,
    /// Distance from the nozzle to `hit` along the axis, m; infinite where nothing is hit.
    pub distance: f64,
    /// The distance that the reference wants, m.
    pub wanted_distance: f64,
    /// Flow that leaves the nozzle, m^3/s.
    pub flow: f64,
}

/// A simulated flight.
#[derive(Debug, Clone, PartialEq)]
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
        let mut shots = Vec::new();
        let mut gathered = Gathered::default();
        for sample in &self.samples {
            let moved = gathered.first.is_some_and(|first| {
                let turned = (sample.axis.into_inner() - first.axis.into_inner()).norm() * sample.wanted_distance;
                (sample.nozzle - first.nozzle).norm() + turned >= step
            });
            if moved || sample.flow <= 0.0 {
                shots.extend(gathered.shot());
                gathered = Gathered::default();
            }
            if sample.flow > 0.0 {
                gathered.add(sample, sample.flow * self.interval);
            }
        }
        shots.extend(gathered.shot());
        shots
    }

    /// How well the flight followed its reference.
    pub fn statistics(&self) -> FlightStatistics {
        FlightStatistics::of(&self.samples)
    }
}

/// Samples on their way to become one shot.
#[derive(Default)]
struct Gathered<'a> {
    first: Option<&'a FlightSample>,
    volume: f64,
    nozzle: Vector3<f64>,
    axis: Vector3<f64>,
}

impl<'a> Gathered<'a> {
    fn add(&mut self, sample: &'a FlightSample, volume: f64) {
        self.first.get_or_insert(sample);
        self.volume += volume;
        self.nozzle += volume * sample.nozzle.coords;
        self.axis += volume * sample.axis.into_inner();
    }

    fn shot(&self) -> Option<Shot> {
        let first = self.first?;
        let axis = UnitVector3::try_new(self.axis, 1e-300).unwrap_or(first.axis);
        Some(Shot { origin: Point3::from(self.nozzle / self.volume), axis, volume: self.volume })
    }
}
