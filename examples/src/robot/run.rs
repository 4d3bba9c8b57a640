//! The run of `robot`: plan, fly, spray, report.

use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;
use paint_planner::onboard::{FailsafeSettings, Phase};
use paint_sim::FlightSettings;
use paint_sim::flight::{Airframe, Reference};

use super::arguments::{Arguments, AutopilotChoice};
use super::error::RobotError;
use super::flight::Flown;
use super::on_board::{OnBoardSettings, SetpointKind};
use super::recorder::Record;
use super::report::RobotReport;
use super::simulation::fly_simulated;
use super::vehicle::fly_vehicle;
use crate::autopilot::{OffboardSettings, Px4, Px4Vehicle, VehicleLink};
use crate::interruption::Finishing;
use crate::mission::{LocalisationChoice, MissionSettings, PlannedFlight, PlannedMission, PlannerChoice};
use crate::onboard::LocalisationFigures;
use crate::progress::Stage;
use crate::report::{LocalisationReport, save_figures};
use crate::whole_file;
use crate::{result, say};

/// Responses of the default vehicle under PX4's attitude control, s.
const PX4_RESPONSE: f64 = 0.18;

/// Plans the mission, flies its first flight on the autopilot, and leaves pictures, track and figures.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    let mission_file = arguments.mission.mission_file()?;
    let settings = &mission_file.settings;
    for (option, given) in [
        ("--tank and --battery", !settings.endurance.is_endless()),
        ("--identify", settings.identify),
        ("--planner smoothing and smoothing-locked", settings.path_planner != PlannerChoice::Optimal),
    ] {
        if given {
            return Err(RobotError::BuiltInOnly { option }.into());
        }
    }
    if matches!(arguments.autopilot, AutopilotChoice::Vehicle(_)) {
        check_not_simulated(arguments, settings)?;
    }
    settings.check_simulated()?;
    mission_file.begin_run(folder, "robot")?;
    let coat = mission_file.decide_coats(folder)?.coats.into_iter().next().ok_or(RobotError::NothingToFly)?;
    let mission = PlannedMission::new(coat.task).map_err(|error| mission_file.in_mesh(error))?;
    let flight = mission.flight(0).ok_or(RobotError::NothingToFly)?;
    let clock = (Instant::now(), ProcessTime::now());
    let _finishing = Finishing::begin();
    let stage = Stage::start("fly");
    let (flown, localisation) = fly(arguments, &flight, folder, &mut |painted| {
        stage.share(painted / arguments.seconds.min(flight.reference().duration()));
    })?;
    stage.done(&format!("{:.0} s", flown.seconds));
    let (wall, cpu) = (clock.0.elapsed().as_secs_f64(), clock.1.elapsed().as_secs_f64());
    let report = save(arguments, &flight, (&flown, localisation), [wall, cpu], folder)?;
    say!("{}", report.summary());
    result!("{}", folder.join("report.json").display());
    let mostly_shut = || format!("the valve was kept shut for {:.0} % of the paint", 100.0 * report.valve_held_share);
    match flown.failed.or_else(|| (report.valve_held_share > 0.5).then(mostly_shut)) {
        Some(reason) => Err(RobotError::Unfinished { reason, folder: folder.clone() }.into()),
        None => Ok(()),
    }
}

/// What says nothing about a vehicle that is not simulated is refused.
fn check_not_simulated(arguments: &Arguments, settings: &MissionSettings) -> Result<(), RobotError> {
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

fn fly(
    arguments: &Arguments,
    flight: &PlannedFlight,
    folder: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<(Flown, Option<LocalisationFigures>), RobotError> {
    let conditions = flight.conditions();
    match &arguments.autopilot {
        AutopilotChoice::Px4(source) => {
            let settings = |hover_thrust| on_board_settings(arguments, &conditions, hover_thrust);
            let launch = |vehicle: &Px4Vehicle| Px4::start(source, &folder.join("px4"), vehicle);
            fly_simulated(flight, &settings, &launch, &arguments.fault, progress)
        }
        AutopilotChoice::Vehicle(address) => {
            let link = VehicleLink::open(address)?;
            // Trajectories hold no thrust.
            let flown = fly_vehicle(link, flight, on_board_settings(arguments, &conditions, 0.0), progress)?;
            Ok((flown, None))
        }
    }
}

fn on_board_settings(arguments: &Arguments, conditions: &FlightSettings, hover_thrust: f64) -> OnBoardSettings {
    let airframe = Airframe {
        roll_gain: 1.0,
        roll_time_constant: PX4_RESPONSE,
        pitch_gain: 1.0,
        pitch_time_constant: PX4_RESPONSE,
        ..conditions.airframe
    };
    OnBoardSettings {
        setpoints: arguments.setpoints,
        arms: matches!(arguments.autopilot, AutopilotChoice::Px4(_)),
        airframe,
        hover_thrust,
        sends_odometry: true,
        valve: conditions.valve,
        failsafe: FailsafeSettings::default(),
        offboard: OffboardSettings::default(),
        seconds: arguments.seconds,
    }
}

fn save(
    arguments: &Arguments,
    flight: &PlannedFlight,
    (flown, localisation): (&Flown, Option<LocalisationFigures>),
    [wall, cpu]: [f64; 2],
    folder: &Path,
) -> Result<RobotReport, RobotError> {
    let path = folder.join("track.csv");
    whole_file::write(&path, &flown.record.track).map_err(|source| RobotError::File { path, source })?;
    let Record { painting, ways, events, .. } = &flown.record;
    let figures = flight.save(painting, ways, folder)?;
    let statistics = painting.statistics();
    let asked = painting.samples.iter().filter(|s| s.held || s.flow > 0.0).count();
    let painted = painting.samples.last().map_or(0.0, |sample| sample.time);
    let report = RobotReport {
        version: env!("CARGO_PKG_VERSION"),
        seed: flight.settings().seed,
        setpoints: format!("{:?}", arguments.setpoints).to_lowercase(),
        ended: flown.failed.clone().unwrap_or_else(|| "landed".into()),
        painted_s: painted,
        flight_s: flown.seconds,
        hit_error_rms_m: statistics.hit_error_rms,
        hit_error_p95_m: statistics.hit_error_p95,
        position_error_rms_m: statistics.position_error_rms,
        localisation_error_rms_m: statistics.localisation_error_rms,
        nozzle_distance_std_m: statistics.nozzle_distance_std,
        valve_held_share: statistics.held_samples as f64 / asked.max(1) as f64,
        valve_open_late_count: flown.valve_open_late,
        holds: events.iter().filter(|(_, phase)| matches!(phase, Phase::Hold(_))).count(),
        limit_violations: figures.limit_violations,
        collisions: figures.collisions,
        max_tilt_rad: statistics.max_tilt,
        paint_emitted_kg: figures.emitted,
        paint_deposited_kg: figures.deposited,
        simulated_over_wall_time: flown.seconds / wall,
        autopilot_cpu_s_per_s: flown.px4_cpu / flown.seconds,
        robot_cpu_s_per_s: cpu / flown.seconds,
        localisation: localisation.map(|own| LocalisationReport::of(&own, flown.seconds)),
    };
    save_figures(&report, folder)?;
    Ok(report)
}
