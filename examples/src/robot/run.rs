//! The run of `robot`: plan, fly, spray, report.

use std::path::Path;

use paint_sim::flight::Faults;

use super::arguments::{Arguments, AutopilotChoice};
use super::error::RobotError;
use super::fault::Fault;
use super::on_board::SetpointKind;
use super::px4_flyer::Px4Flyer;
use super::report::{FlightReport, RobotReport};
use super::trial::{Pilot, try_first_flight};
use crate::interruption::Finishing;
use crate::mission::{
    BuiltInFlyer, CoatTasks, Coats, LocalisationChoice, MissionSettings, PlannedCoats, PlannerChoice, save_flown,
};
use crate::mission_file::MissionFile;
use crate::report::save_figures;
use crate::{result, say};

/// Plans the mission, flies it, and leaves pictures, tracks and figures.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let mut mission_file = arguments.mission.mission_file()?;
    let first_alone = match &arguments.autopilot {
        Some(AutopilotChoice::Vehicle(address)) => Some(Pilot::OfVehicle(address)),
        Some(AutopilotChoice::Px4(source)) if arguments.seconds.is_some() => Some(Pilot::Px4(source)),
        _ => None,
    };
    check(arguments, first_alone.is_some(), &mission_file.settings)?;
    if first_alone.is_none() && !arguments.mission.names_surface() {
        mission_file = own_job(mission_file);
    }
    mission_file.settings.sensor_faults.extend(arguments.fault.iter().filter_map(Fault::of_sensors));
    mission_file.settings.check_simulated()?;
    mission_file.begin_run(folder, "robot")?;
    let tasks = mission_file.decide_coats(folder)?;
    match first_alone {
        Some(pilot) => try_first_flight(arguments, &pilot, &mission_file, tasks),
        None => fly_mission(arguments, &mission_file, tasks),
    }
}

/// The job where none is named: the robot paints what it has mapped, and looks at it if it is of one paint.
fn own_job(mut mission_file: MissionFile) -> MissionFile {
    mission_file.scan = true;
    mission_file.settings.look |= mission_file.palette.is_none();
    mission_file
}

/// What the autopilot does not do is refused, and what says nothing about a vehicle that is not simulated.
fn check(arguments: &Arguments, first_alone: bool, settings: &MissionSettings) -> Result<(), RobotError> {
    let Some(autopilot) = &arguments.autopilot else { return Ok(()) };
    for (option, given) in [
        ("--identify", settings.identify),
        ("--robots", settings.team.robots > 1),
        ("[settings.faults] of a mission", settings.faults != Faults::default()),
        ("--planner smoothing and smoothing-locked", settings.path_planner != PlannerChoice::Optimal),
    ] {
        if given {
            return Err(RobotError::BuiltInOnly { option });
        }
    }
    for (option, given) in [("--tank and --battery", !settings.endurance.is_endless()), ("--look", settings.look)] {
        if given && first_alone {
            return Err(RobotError::WholeMissionOnly { option });
        }
    }
    if matches!(autopilot, AutopilotChoice::Px4(_)) {
        return Ok(());
    }
    let own = settings.localisation.is_some_and(|chosen| chosen != LocalisationChoice::MotionCapture);
    for (option, given, why) in [
        ("--localisation", own, "it says itself where it is"),
        ("--setpoints attitude", arguments.setpoints == SetpointKind::Attitude, "which thrust carries it is not known"),
        ("--fault", !arguments.fault.is_empty(), "nothing is made to fail on a vehicle"),
    ] {
        if given {
            return Err(RobotError::SimulationOnly { option, why });
        }
    }
    Ok(())
}

/// All flights of a mission, on PX4 or in the built-in simulation.
fn fly_mission(
    arguments: &Arguments,
    mission_file: &MissionFile,
    tasks: CoatTasks,
) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let planned = PlannedCoats::new(tasks).map_err(|error| mission_file.in_mesh(error))?;
    let Some(AutopilotChoice::Px4(source)) = &arguments.autopilot else {
        return save(&Coats::fly(planned, &mut BuiltInFlyer)?, None, folder);
    };
    // PX4 lands where it is interrupted.
    let _finishing = Finishing::begin();
    let mut flyer = Px4Flyer::new(arguments, source);
    let coats = Coats::fly(planned, &mut flyer)?;
    save(&coats, Some((arguments.setpoints, flyer.flights())), folder)
}

/// Leaves what was flown, and what is told of the flights on an autopilot with its set-points.
fn save(
    coats: &Coats,
    told: Option<(SetpointKind, &[FlightReport])>,
    folder: &Path,
) -> Result<(), Box<dyn std::error::Error>> {
    let _finishing = Finishing::begin();
    let mission = save_flown(coats, folder)?;
    if let Some((setpoints, flights)) = told {
        save_figures(&RobotReport { mission: &mission, setpoints: setpoints.name(), flights }, folder)?;
    }
    say!("{}", mission.summary());
    result!("{}", folder.join("report.md").display());
    if let Some(grounded) = coats.grounded() {
        return Err(grounded.clone().into());
    }
    let flights = told.map_or(&[][..], |(_, flights)| flights);
    match flights.iter().find_map(FlightReport::mostly_shut) {
        Some(reason) => Err(RobotError::Unfinished { reason, folder: folder.to_owned() }.into()),
        None => Ok(()),
    }
}
