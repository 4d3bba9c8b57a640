//! The closed loop that sprays: errors in gusts, what a control step takes, what the valve does in faults, and the attitude response of
//! a recorded flight.

use std::error::Error;
use std::path::Path;

use nalgebra::Vector3;
use paint_planner::OptimalPlanner;
use paint_planner::control::{AttitudeSample, MpcSettings, identify_attitude};
use paint_sim::FlightSettings;
use paint_sim::flight::{
    CascadedController, Command, Controller, ControllerSettings, Estimate, Faults, FlightSample, Gust, Interlock,
    Localisation, Valve, Wind,
};
use paint_sim::flight::{Reference, ReferenceState};
use paintcopter::adapters::{MpcController, PlanReference};
use serde_json::json;

use crate::planned_stroke::{PlannedStroke, hose};
use crate::{Rng, cpu};

/// Flights of each row.
const FLIGHTS: u64 = 8;
/// Flights with each fault, their length, and the time before it, seconds.
const FAULTS: u64 = 1000;
const FAULT_FLIGHT: f64 = 4.0;
const FAULT_TIME: f64 = 2.0;
/// What the spray may miss its aim by with the valve open, and what its distance may be off by, m: the interlock's bounds and the
/// centimetre by which an estimate lags behind a gust that sets in at once.
const PERMITTED_MISS: f64 = 0.025;
const PERMITTED_DISTANCE: f64 = 0.06;

type AnyError = Box<dyn Error>;

/// The controllers that are compared.
#[derive(Clone, Copy)]
enum Who {
    Cascade,
    Mpc,
}

impl Who {
    const ALL: [(Self, &str); 2] = [(Self::Cascade, "cascade"), (Self::Mpc, "mpc")];

    fn controller(self, settings: &FlightSettings) -> Result<Box<dyn Controller>, AnyError> {
        Ok(match self {
            Self::Cascade => Box::new(CascadedController::new(settings.airframe, ControllerSettings::default())),
            Self::Mpc => Box::new(MpcController::new(&settings.airframe, MpcSettings::default())?),
        })
    }
}

/// Notes the CPU time of each command.
struct Timed<'a> {
    controller: &'a mut dyn Controller,
    seconds: &'a mut Vec<f64>,
}

impl Controller for Timed<'_> {
    fn command(&mut self, time: f64, estimate: &Estimate, reference: &dyn Reference) -> Command {
        let (command, seconds) = cpu::seconds(|| self.controller.command(time, estimate, reference));
        self.seconds.push(seconds);
        command
    }
}

/// Prints the figures.
///
/// # Errors
/// What planner and simulator refuse.
pub fn run() -> Result<(), AnyError> {
    let scene = PlannedStroke::new(&OptimalPlanner::default())?;
    let wind = |mean: f64, gust_sigma: f64| Wind { mean: Vector3::new(mean, 0.0, 0.0), gust_sigma, ..Wind::default() };
    for (name, wind) in [("usual", wind(2.0, 0.5)), ("gusts_3m_s", wind(0.0, 3.0))] {
        for (place, localisation) in [("mocap", Localisation::mocap()), ("slam", Localisation::slam_7cm())] {
            for (who, controller) in Who::ALL {
                gusts(&scene, &format!("{name}_{place}"), controller, who, wind, localisation)?;
            }
        }
    }
    for (who, controller) in Who::ALL {
        for (name, fault) in [
            ("pose_lost", Faults { pose_lost: Some(FAULT_TIME), ..Faults::default() }),
            ("servos_stuck", Faults { servos_stuck: Some(FAULT_TIME), ..Faults::default() }),
            ("gust", Faults { gust: Some(Gust { time: FAULT_TIME, velocity: Vector3::zeros() }), ..Faults::default() }),
        ] {
            faults(&scene, name, controller, who, fault)?;
        }
    }
    Ok(())
}

fn gusts(
    scene: &PlannedStroke,
    fig: &str,
    peer: &str,
    who: Who,
    wind: Wind,
    localisation: Localisation,
) -> Result<(), AnyError> {
    // Hit, pan, tilt, distance, and the share of time that the interlock kept the valve shut: the worst flight of all.
    let mut worst = [0.0_f64; 5];
    let mut seconds = Vec::new();
    for seed in 0..FLIGHTS {
        let valve = Valve { interlock: Some(Interlock::default()), ..Valve::default() };
        let settings =
            FlightSettings { wind, localisation, valve, hose: Some(hose()), seed, ..FlightSettings::default() };
        let mut controller = who.controller(&settings)?;
        let mut timed = Timed { controller: controller.as_mut(), seconds: &mut seconds };
        let s = scene.fly(&scene.reference(), &mut timed, &settings)?.statistics();
        let held = s.held_samples as f64 / (s.held_samples + s.open_samples).max(1) as f64;
        let figures = [s.hit_error_rms, s.pan_error_rms, s.tilt_error_rms, s.nozzle_distance_std, held];
        worst = std::array::from_fn(|k| worst[k].max(figures[k]));
    }
    seconds.sort_unstable_by(f64::total_cmp);
    let [hit, pan, tilt, distance, held] = worst;
    println!(
        "{}",
        json!({
            "fig": fig, "peer": peer, "hit_rms_cm": 100.0 * hit, "pan_rms_deg": pan.to_degrees(),
            "tilt_rms_deg": tilt.to_degrees(), "distance_std_cm": 100.0 * distance, "held_share": held,
            "step_us": 1e6 * seconds[seconds.len() / 2], "step_p99_us": 1e6 * seconds[seconds.len() * 99 / 100],
        })
    );
    Ok(())
}

/// A part of a flight.
struct Part<'a> {
    whole: PlanReference<'a>,
    from: f64,
}

impl Reference for Part<'_> {
    fn duration(&self) -> f64 {
        FAULT_FLIGHT
    }

    fn at(&self, t: f64) -> ReferenceState {
        self.whole.at(self.from + t)
    }
}

/// Flights with a fault each, somewhere along the stroke: how often the valve is commanded shut at most one control step after the
/// spray misses, or the pose is lost. The command, not the paint, which follows after the valve's dead time.
fn faults(scene: &PlannedStroke, name: &str, peer: &str, who: Who, faults: Faults) -> Result<(), AnyError> {
    let mut rng = Rng::new(5);
    let (mut late, mut struck, mut held_before) = (0, 0, 0);
    for seed in 0..FAULTS {
        let from = rng.between(0.0, scene.plan.trajectory.duration() - FAULT_FLIGHT);
        let mut faults = faults;
        if let Some(gust) = &mut faults.gust {
            // 12 to 20 m/s push with 3.6 to 6 m/s²; the tilt limit holds against 3.5 of it forward and 4.6 sideways.
            let (speed, course) = (rng.between(12.0, 20.0), rng.between(0.0, std::f64::consts::TAU));
            gust.velocity = Vector3::new(speed * course.cos(), speed * course.sin(), 0.0);
        }
        let valve = Valve { dead_time: 0.0, lead: 0.0, interlock: Some(Interlock::default()) };
        let settings = FlightSettings { hose: Some(hose()), valve, faults, seed, ..FlightSettings::default() };
        let mut controller = who.controller(&settings)?;
        let log = scene.fly(&Part { whole: scene.reference(), from }, controller.as_mut(), &settings)?;
        let lost = |s: &FlightSample| faults.pose_lost.is_some_and(|time| s.time >= time);
        held_before += log.samples.iter().filter(|s| s.held && s.time > 1.0 && s.time < FAULT_TIME).count();
        struck += usize::from(log.samples.iter().any(|s| lost(s) || beyond(s)));
        late += usize::from(log.samples.windows(2).any(|pair| {
            let [before, after] = pair else { return false };
            after.flow > 0.0 && (lost(before) || beyond(before)) && (lost(after) || beyond(after))
        }));
    }
    println!(
        "{}",
        json!({
            "fig": format!("fault_{name}"), "peer": peer, "flights": FAULTS, "with_an_effect": struck,
            "shut_later_than_one_step": late,
            "held_before_share": held_before as f64 / (FAULTS as f64 * 100.0),
        })
    );
    Ok(())
}

/// Whether the true spray misses its aim by more than is permitted.
fn beyond(sample: &FlightSample) -> bool {
    sample.aim.is_some_and(|aim| {
        let ray = aim - sample.nozzle;
        let along = ray.dot(&sample.axis);
        let off = (ray - sample.axis.into_inner() * along).norm();
        off > PERMITTED_MISS || (along - sample.wanted_distance).abs() > PERMITTED_DISTANCE
    })
}

/// Identifies the response in a CSV file: a header, then time (s), commanded and measured angle (rad).
///
/// # Errors
/// Files that cannot be read or tell nothing.
pub fn attitude(file: &Path) -> Result<(), AnyError> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut samples = Vec::new();
    for (number, line) in text.lines().enumerate().skip(1) {
        let fields: Result<Vec<f64>, _> = line.split(',').map(|f| f.trim().parse()).collect();
        let Ok([time, commanded, measured]) = <[f64; 3]>::try_from(fields.unwrap_or_default()) else {
            return Err(format!("{} line {}: three numbers are wanted", file.display(), number + 1).into());
        };
        samples.push(AttitudeSample { time, commanded, measured });
    }
    let fit = identify_attitude(&samples)?;
    let sigma = |k: usize| fit.covariance[(k, k)].sqrt();
    println!(
        "{}",
        json!({
            "fig": "attitude_response", "peer": "paint-planner", "samples": samples.len(), "gain": fit.response.gain,
            "gain_sigma": sigma(0), "time_constant_s": fit.response.time_constant, "time_constant_sigma": sigma(1),
            "delay_s": fit.delay, "delay_sigma": sigma(2), "offset_rad": fit.offset, "residual_rad": fit.residual,
            "signal_rad": fit.signal,
        })
    );
    Ok(())
}
