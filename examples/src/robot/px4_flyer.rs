//! PX4 as the flyer of a mission: for every flight it is started anew, on a vehicle that stands where the flight begins.

use std::path::{Path, PathBuf};
use std::time::Instant;

use cpu_time::ProcessTime;
use paint_sim::flight::{FlightLog, PoseSource};

use super::arguments::Arguments;
use super::error::RobotError;
use super::flight::Flown;
use super::report::FlightReport;
use super::settings::on_board_settings;
use super::simulation::fly_simulated;
use crate::autopilot::{Px4, Px4Vehicle};
use crate::mission::{Flight, Flyer, MissionError};
use crate::whole_file;
use crate::{interruption, say};

/// Flies one flight after another, and keeps what is told of them.
pub(super) struct Px4Flyer<'a> {
    arguments: &'a Arguments,
    /// PX4's own folder.
    source: &'a Path,
    flights: Vec<FlightReport>,
    /// Whether the last flight has broken the vehicle.
    broken: bool,
}

impl<'a> Px4Flyer<'a> {
    pub(super) fn new(arguments: &'a Arguments, source: &'a Path) -> Self {
        Self { arguments, source, flights: Vec::new(), broken: false }
    }

    /// The flights in their order.
    pub(super) fn flights(&self) -> &[FlightReport] {
        &self.flights
    }

    fn folder(&self) -> PathBuf {
        self.arguments.out.join("flights").join((self.flights.len() + 1).to_string())
    }

    fn fly(
        &self,
        flight: &Flight,
        poses: &mut dyn PoseSource,
        tell: &dyn Fn(f64),
    ) -> Result<(Flown, FlightReport), RobotError> {
        if interruption::is_requested() {
            return Err(RobotError::Interrupted);
        }
        if self.broken {
            return Err(RobotError::Broken { flight: self.flights.len() });
        }
        let folder = self.folder();
        let clock = (Instant::now(), ProcessTime::now());
        let settings = |hover_thrust| on_board_settings(self.arguments, &flight.conditions, hover_thrust);
        let launch = |vehicle: &Px4Vehicle| Px4::start(self.source, &folder.join("px4"), vehicle);
        // What fails, fails once.
        let faults = if self.flights.is_empty() { &self.arguments.fault[..] } else { &[] };
        let flown = fly_simulated(flight, poses, &settings, &launch, faults, &mut |done| tell(done))?;
        let (wall, cpu) = (clock.0.elapsed().as_secs_f64(), clock.1.elapsed().as_secs_f64());
        let path = folder.join("track.csv");
        whole_file::write(&path, &flown.record.track).map_err(|source| RobotError::File { path, source })?;
        let report = FlightReport::of(flight, &flown, [wall, cpu]);
        Ok((flown, report))
    }
}

impl Flyer for Px4Flyer<'_> {
    fn fly(
        &mut self,
        flight: &Flight,
        poses: &mut dyn PoseSource,
        tell: &dyn Fn(f64),
    ) -> Result<(FlightLog, Option<MissionError>), MissionError> {
        let of_flyer = |error: RobotError| match error {
            RobotError::Mission(error) => error,
            error => MissionError::Flyer(error.into()),
        };
        let (flown, report) = Self::fly(self, flight, poses, tell).map_err(of_flyer)?;
        say!("flight {}\n{}", self.flights.len() + 1, report.summary());
        self.flights.push(report);
        self.broken = flown.broken;
        let ended = flown.failed.map(|reason| MissionError::Flyer(reason.into()));
        Ok((without_run_ups(flown.record.painting), ended))
    }
}

/// A log without what was flown again after holds, to run up to where the paint had ended.
fn without_run_ups(log: FlightLog) -> FlightLog {
    let FlightLog { mut samples, interval } = log;
    let mut last = f64::NEG_INFINITY;
    samples.retain(|sample| {
        let goes_on = sample.time > last + 0.5 * interval;
        if goes_on {
            last = sample.time;
        }
        goes_on
    });
    FlightLog { samples, interval }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Vector3};
    use paint_sim::flight::FlightSample;

    use super::*;

    fn sample(time: f64, flow: f64) -> FlightSample {
        let (nowhere, zero) = (Point3::origin(), Vector3::zeros());
        FlightSample {
            time,
            world_from_body: Isometry3::identity(),
            velocity: zero,
            acceleration: zero,
            attitude: [0.0; 3],
            estimated_position: nowhere,
            reference_position: nowhere,
            pan_tilt: [0.0; 2],
            desired_pan_tilt: [0.0; 2],
            nozzle: nowhere,
            axis: Vector3::x_axis(),
            aim: None,
            hit: None,
            distance: f64::INFINITY,
            wanted_distance: 0.1,
            flow,
            held: false,
        }
    }

    /// A second of paint, a hold, a run-up of half a second without paint, and on.
    #[test]
    fn time_goes_on_in_a_log_with_holds() {
        let first = (0..100).map(|k| sample(0.01 * f64::from(k), 1.0));
        let again = (50..150).map(|k| sample(0.01 * f64::from(k), f64::from(u8::from(k >= 100))));
        let log = without_run_ups(FlightLog { samples: first.chain(again).collect(), interval: 0.01 });
        assert_eq!(log.samples.len(), 150);
        for (k, sample) in log.samples.iter().enumerate() {
            assert!((sample.time - 0.01 * k as f64).abs() < 1e-9 && sample.flow == 1.0, "{k} {}", sample.time);
        }
    }
}
