//! A mission's first flight alone: its first seconds on PX4, or all of it on a vehicle.

use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;

use super::arguments::Arguments;
use super::error::RobotError;
use super::flight::Flown;
use super::report::{FlightReport, TrialReport};
use super::settings::on_board_settings;
use super::simulation::fly_simulated;
use super::vehicle::fly_vehicle;
use crate::autopilot::{LinkAddress, Px4, Px4Vehicle, VehicleLink};
use crate::interruption::Finishing;
use crate::mission::{CoatTasks, Flight, PlannedMission, Poses};
use crate::mission_file::MissionFile;
use crate::progress::Stage;
use crate::report::{LocalisationReport, save_figures};
use crate::whole_file;
use crate::{result, say};

/// Who flies it.
pub(super) enum Pilot<'a> {
    /// PX4 of a folder, in simulation.
    Px4(&'a Path),
    /// The pilot of a vehicle that is to be reached there.
    OfVehicle(&'a LinkAddress),
}

/// Flies it, and leaves pictures, track and figures.
pub(super) fn try_first_flight(
    arguments: &Arguments,
    pilot: &Pilot,
    mission_file: &MissionFile,
    tasks: CoatTasks,
) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let coat = tasks.coats.into_iter().next().ok_or(RobotError::NothingToFly)?;
    let mission = PlannedMission::new(coat.task).map_err(|error| mission_file.in_mesh(error))?;
    let planned = mission.flight(0).ok_or(RobotError::NothingToFly)?;
    let reference = planned.reference();
    let flight = planned.flight(&reference);
    let mut poses = planned.poses(&flight)?;
    let clock = (Instant::now(), ProcessTime::now());
    let _finishing = Finishing::begin();
    let stage = Stage::start("fly");
    let duration = flight.reference.duration().min(arguments.seconds.unwrap_or(f64::INFINITY));
    let flown = fly(arguments, pilot, &flight, &mut poses, folder, &mut |painted| stage.share(painted / duration))?;
    stage.done(&format!("{:.0} s", flown.seconds));
    let machine = [clock.0.elapsed().as_secs_f64(), clock.1.elapsed().as_secs_f64()];
    let path = folder.join("track.csv");
    whole_file::write(&path, &flown.record.track).map_err(|source| RobotError::File { path, source })?;
    let report = TrialReport {
        version: env!("CARGO_PKG_VERSION"),
        seed: flight.settings().seed,
        setpoints: arguments.setpoints.name(),
        flown: planned.save(&flown.record.painting, folder)?,
        flight: FlightReport::of(&flight, &flown, machine),
        localisation: poses.figures().map(|own| LocalisationReport::of(&own, flown.seconds)),
    };
    save_figures(&report, folder)?;
    say!("{}\n  {} limit violations", report.flight.summary(), report.flown.limit_violations);
    result!("{}", folder.join("report.json").display());
    match flown.failed.or_else(|| report.flight.mostly_shut()) {
        Some(reason) => Err(RobotError::Unfinished { reason, folder: folder.clone() }.into()),
        None => Ok(()),
    }
}

fn fly(
    arguments: &Arguments,
    pilot: &Pilot,
    flight: &Flight,
    poses: &mut Poses,
    folder: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<Flown, RobotError> {
    match *pilot {
        Pilot::Px4(source) => {
            let settings = |hover_thrust| on_board_settings(arguments, &flight.conditions, hover_thrust);
            let launch = |vehicle: &Px4Vehicle| Px4::start(source, &folder.join("px4"), vehicle);
            fly_simulated(flight, poses.source(), &settings, &launch, &arguments.fault, progress)
        }
        // Trajectories hold no thrust.
        Pilot::OfVehicle(address) => {
            let settings = on_board_settings(arguments, &flight.conditions, 0.0);
            fly_vehicle(VehicleLink::open(address)?, flight, settings, progress)
        }
    }
}
