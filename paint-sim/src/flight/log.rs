//! The log of a flight.

use nalgebra::{Point3, UnitVector3, Vector3};

use super::sample::FlightSample;
use super::statistics::FlightStatistics;
use crate::error::Error;
use crate::gantry_robot::ValveSettings;
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

    /// The log of what a valve lets through of its flows, as [`ValveSettings::through`] has it: [`shots`](Self::shots) then begin and end where
    /// paint does, with a weak beginning and end. What flows after the log leaves the nozzle where the log ends. The flight's own
    /// [`dead_time`](super::Valve::dead_time) is in its flows already.
    ///
    /// # Errors
    /// Settings that are negative or not finite.
    pub fn through_valve(&self, settings: &ValveSettings) -> Result<Self, Error> {
        let commanded: Vec<f64> = self.samples.iter().map(|sample| sample.flow).collect();
        let Some(last) = self.samples.len().checked_sub(1) else { return Ok(self.clone()) };
        let flows = settings.through(&commanded, self.interval)?;
        let mut samples = self.samples.clone();
        for (k, flow) in flows.into_iter().enumerate() {
            let sample = &mut samples[k.min(last)];
            sample.flow = if k > last { sample.flow } else { 0.0 } + flow;
        }
        Ok(Self { samples, interval: self.interval })
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

    fn log(flow: impl Fn(u32) -> f64) -> FlightLog {
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
            flow: flow(k),
            held: false,
        };
        FlightLog { samples: (0..102).map(sample).collect(), interval: 0.01 }
    }

    /// Samples stand 10 ms apart and move 1 mm each: a burst comes late, ramped, and whole.
    #[test]
    fn paint_comes_when_the_valve_lets_it() {
        let mut log = log(|k| if (20..60).contains(&k) || k > 90 { 2e-6 } else { 0.0 });
        for (k, sample) in log.samples.iter_mut().enumerate() {
            sample.nozzle.x = 1e-3 * k as f64;
        }
        let valve = ValveSettings { open_delay: 0.03, close_delay: 0.02, rise: 0.04, fall: 0.06 };
        let passed = log.through_valve(&valve).unwrap();
        let total = |log: &FlightLog| log.samples.iter().map(|s| s.flow).sum::<f64>() * 0.01;
        // Two bursts, each 2e-6 (T - 10 ms + 10 ms): as much as was commanded.
        assert!((total(&passed) / total(&log) - 1.0).abs() < 1e-12, "{} {}", total(&passed), total(&log));
        let flows: Vec<f64> = passed.samples.iter().map(|s| s.flow * 1e6).collect();
        for (k, flow) in
            [(22, 0.0), (23, 0.25), (24, 0.75), (26, 1.75), (27, 2.0), (61, 2.0), (62, 2.0 - 1.0 / 6.0), (68, 0.0)]
        {
            assert!((flows[k] - flow).abs() < 1e-9, "{k}: {}", flows[k]);
        }
        let volumes = |log: &FlightLog| log.shots(2e-3).iter().map(|shot| shot.volume).sum::<f64>();
        assert!((volumes(&passed) / total(&log) - 1.0).abs() < 1e-12);
        // A valve that is at once where it is told to be changes nothing.
        let ideal = ValveSettings { open_delay: 0.0, close_delay: 0.0, ..ValveSettings::default() };
        assert_eq!(log.through_valve(&ideal).unwrap(), log);
        assert!(log.through_valve(&ValveSettings { rise: -1.0, ..ideal }).is_err());
    }

    #[test]
    fn a_thinned_log_keeps_its_times() {
        let log = log(|_| 1.0);
        let thin = log.thinned(0.05);
        assert!(thin.samples.len() == 21 && (thin.interval - 0.05).abs() < 1e-15);
        for (k, kept) in thin.samples.iter().enumerate() {
            assert!((kept.time - 0.05 * k as f64).abs() < 1e-12, "{}", kept.time);
        }
        // No finer than it is, and nothing of nothing.
        assert_eq!((log.thinned(0.001), FlightLog::default().every(0.1).count()), (log, 0));
    }
}
