//! The flight that paints: vehicle, wind, hose, pan-tilt unit and controller in a closed loop at 1 kHz.

use nalgebra::Vector3;

use crate::error::{Error, check_range};
use crate::surface::Surface;
use crate::trace::{event, span};

mod airframe;
mod controller;
mod estimator;
mod faults;
mod hose;
mod interlock;
mod log;
pub mod multirotor;
mod noise;
mod pan_tilt;
mod pose_source;
mod reference;
mod sample;
mod settings;
mod statistics;
mod vehicle;

pub use airframe::{Airframe, Command, GRAVITY};
pub use controller::{CascadedController, Controller, ControllerSettings};
pub use estimator::{Estimate, Estimator, ObserverSettings};
pub use faults::{Clog, Faults, Gust, Mislocalised};
pub use hose::{Catenary, HoseModel};
pub use interlock::{Interlock, InterlockInput, InterlockState};
pub use log::FlightLog;
pub use noise::{PoseSensor, WindModel};
pub use pan_tilt::{IdealPanTilt, PanTilt};
pub use pose_source::{LocalisedPose, PoseSource};
pub use reference::{Reference, ReferenceState};
pub use sample::FlightSample;
pub use settings::{FlightSettings, Localisation, Valve, Wind};
pub use statistics::FlightStatistics;
pub use vehicle::Vehicle;

/// Steps of the physics per second.
const RATE: u32 = 1000;
const STEP: f64 = 1.0 / RATE as f64;
/// Steps of the physics per step of localisation, controller and pan-tilt command.
const CONTROL_STEPS: i64 = 10;
/// Time of a control step, s: from one pose, and from one command, to the next.
pub const CONTROL_STEP: f64 = CONTROL_STEPS as f64 * STEP;
/// A vehicle farther than this from its reference is lost, m.
const DIVERGENCE_DISTANCE: f64 = 20.0;
/// Longest flight, s: a reference that asks for more has a wrong unit.
const MAX_DURATION: f64 = 86_400.0;

/// Flies `reference` with the built-in observer and controller, see [`fly_with`].
///
/// # Errors
/// As [`fly_with`].
pub fn fly(
    reference: &dyn Reference,
    ptu: &mut dyn PanTilt,
    surface: &dyn Surface,
    settings: &FlightSettings,
) -> Result<FlightLog, Error> {
    let mut controller = CascadedController::new(settings.airframe, ControllerSettings::default());
    fly_with(reference, &mut controller, ptu, surface, settings)
}

/// Flies `reference`: the truth moves at 1 kHz; localisation, observer, controller and the aim of the pan-tilt unit at
/// 100 Hz. Controller and pan-tilt unit see the reported pose, never the truth.
///
/// The vehicle starts at rest at the reference's first position and hovers there for `settings.settle` seconds. The
/// pan-tilt unit is commanded for the pose and the aim that are expected when the command takes effect. The valve follows the
/// reference, while its [`Interlock`] permits it if it has one.
///
/// # Errors
/// Settings out of range, values that are not finite from the reference, the controller or the pan-tilt unit, a hose
/// that is too short, no pose for longer than the settings allow, or a vehicle more than 20 m away from its reference.
pub fn fly_with(
    reference: &dyn Reference,
    controller: &mut dyn Controller,
    ptu: &mut dyn PanTilt,
    surface: &dyn Surface,
    settings: &FlightSettings,
) -> Result<FlightLog, Error> {
    settings.check()?;
    let mut sensor = PoseSensor::new(settings.localisation, CONTROL_STEP, settings.seed);
    fly_localised(reference, controller, ptu, surface, &mut sensor, settings)
}

/// As [`fly_with`], with a source of poses in the place of [`FlightSettings::localisation`].
///
/// # Errors
/// As [`fly_with`], and [`Error::Localisation`].
pub fn fly_localised(
    reference: &dyn Reference,
    controller: &mut dyn Controller,
    ptu: &mut dyn PanTilt,
    surface: &dyn Surface,
    localisation: &mut dyn PoseSource,
    settings: &FlightSettings,
) -> Result<FlightLog, Error> {
    let mut log = FlightLog::default();
    fly_recorded(reference, controller, ptu, surface, localisation, settings, &mut log)?;
    Ok(log)
}

/// As [`fly_localised`], with what was flown in `log`, whatever ends it: paint that is on the surface stays there.
///
/// # Errors
/// As [`fly_localised`].
pub fn fly_recorded(
    reference: &dyn Reference,
    controller: &mut dyn Controller,
    ptu: &mut dyn PanTilt,
    surface: &dyn Surface,
    localisation: &mut dyn PoseSource,
    settings: &FlightSettings,
    log: &mut FlightLog,
) -> Result<(), Error> {
    span!("fly");
    log.samples.clear();
    settings.check()?;
    let duration = reference.duration();
    check_range("duration of the reference", duration, 0.0, MAX_DURATION, "between 0 and a day")?;
    check_range("delay of the pan-tilt unit", ptu.delay(), 0.0, 1.0, "between 0 and 1 s")?;
    let hover = HoldBeforeStart { reference };
    let start = checked(reference, 0.0)?;

    let mut vehicle = Vehicle::at_rest(start.position, start.heading);
    let mut wind = WindModel::new(&settings.wind, STEP, settings.seed);
    let first = -(settings.settle / CONTROL_STEP).round() as i64 * CONTROL_STEPS;
    let begin = first as f64 * STEP;
    let start = localised(localisation, begin, &vehicle)?;
    let nowhere = || Error::Localisation { time: begin, why: "there is no pose to start from".into() };
    let start = start.ok_or_else(nowhere)?;
    controller.reported(begin, &start);
    let start = start.world_from_body;
    let model = settings.model();
    let mut estimator = Estimator::new(model, ObserverSettings::default(), &start);
    let mut command = Command { thrust: model.mass * GRAVITY, ..Command::default() };
    let mut hose_force = Vector3::zeros();
    let mut aim = [0.0; 2];
    let mut pan_tilt = [0.0; 2];
    ptu.reset(aim);
    let mut interlock = InterlockState::new(
        settings.valve.interlock,
        [ptu.delay(), settings.valve.dead_time].map(|delay| delay / CONTROL_STEP),
    );

    let log_steps = i64::from(RATE / settings.log_rate);
    // A hair of tolerance, or rounding would drop the last sample of a duration such as 0.3 s.
    let last = (duration / STEP + 1e-6).floor() as i64;
    log.interval = log_steps as f64 * STEP;
    log.samples.reserve((last / log_steps + 1) as usize);
    let mut trusted = !settings.faults.pose_lost(begin);
    let mut known = begin;
    for step in first..=last {
        let time = step as f64 * STEP;
        if step % CONTROL_STEPS == 0 {
            let wanted = checked(&hover, time)?;
            let distance = (vehicle.position - wanted.position).norm();
            if distance.is_nan() || distance > DIVERGENCE_DISTANCE {
                event!(warn, time, distance, "vehicle diverged from its reference");
                return Err(Error::Diverged { time, distance });
            }
            if step > first {
                // A source whose poses are lost goes on all the same, so that a fault changes nothing before it.
                let mut pose = localised(localisation, time, &vehicle)?.filter(|_| !settings.faults.pose_lost(time));
                if let Some(pose) = &mut pose {
                    pose.world_from_body.translation.vector += settings.faults.shift(time);
                }
                if let Some(pose) = &pose {
                    controller.reported(time, pose);
                    estimator.update(&pose.world_from_body, CONTROL_STEP);
                    known = time;
                } else if let Some(longest) = settings.longest_without_pose.filter(|longest| time - known > *longest) {
                    return Err(Error::Localisation { time, why: format!("no pose for {longest} s") });
                } else {
                    estimator.coast(CONTROL_STEP);
                }
                trusted = pose.is_some_and(|pose| pose.trusted);
            }
            command = controller.command(time, estimator.estimate(), &hover);
            if ![command.roll, command.pitch, command.yaw_rate, command.thrust].iter().all(|v| v.is_finite()) {
                return Err(Error::BadCallback { who: "the controller", time });
            }
            estimator.set_command(command);
            if let Some(model) = &settings.hose {
                hose_force = model.force(&vehicle.position)?;
            }
            // A command holds for one control step, so on average it acts half a step later still.
            let ahead = ptu.delay() + 0.5 * CONTROL_STEP;
            let target = checked(&hover, time + ahead)?.aim.filter(|_| !settings.ptu_locked);
            aim = target.map_or([0.0; 2], |point| ptu.command(&estimator.predict(ahead), &point));
            let ahead = settings.valve.dead_time + 0.5 * CONTROL_STEP;
            let later = checked(&hover, time + ahead)?;
            let estimator = trusted.then_some(&estimator);
            let known =
                InterlockInput { estimator, angles: pan_tilt, command: aim, now: &wanted, later: &later, ahead };
            interlock.decide(ptu, &known);
        }
        if step >= 0 && step % log_steps == 0 {
            let scene = SampleContext { reference, ptu, surface, settings };
            let given = step - (settings.valve.dead_time / STEP).round() as i64;
            let open = interlock.open((given - first).div_euclid(CONTROL_STEPS));
            let sample = scene.sample(time, &vehicle, pan_tilt, estimator.estimate(), open)?;
            localisation.sprayed(&sample, log.interval);
            log.samples.push(sample);
        }
        let air = wind.step() + settings.faults.gust(time);
        vehicle.step(&settings.airframe, &command, &air, &hose_force, STEP);
        localisation.moved(time + STEP, &vehicle)?;
        if !settings.faults.servos_stuck(time) {
            pan_tilt = ptu.step(aim, STEP);
        }
        if !pan_tilt.iter().all(|v| v.is_finite()) {
            return Err(Error::BadCallback { who: "the pan-tilt unit", time });
        }
    }
    Ok(())
}

/// The reference, standing still at its first state before time zero.
struct HoldBeforeStart<'a> {
    reference: &'a dyn Reference,
}

impl Reference for HoldBeforeStart<'_> {
    fn duration(&self) -> f64 {
        self.reference.duration()
    }

    fn at(&self, t: f64) -> ReferenceState {
        let state = self.reference.at(t.max(0.0));
        if t >= 0.0 {
            return state;
        }
        let zero = Vector3::zeros();
        ReferenceState { velocity: zero, acceleration: zero, heading_rate: 0.0, flow: 0.0, ..state }
    }
}

fn checked(reference: &dyn Reference, time: f64) -> Result<ReferenceState, Error> {
    let state = reference.at(time);
    if state.is_finite() { Ok(state) } else { Err(Error::BadCallback { who: "the reference", time }) }
}

fn localised(source: &mut dyn PoseSource, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
    let pose = source.pose(time, truth)?;
    let finite = |pose: &LocalisedPose| pose.world_from_body.to_matrix().iter().all(|v| v.is_finite());
    if pose.as_ref().is_none_or(finite) { Ok(pose) } else { Err(Error::BadCallback { who: "the localisation", time }) }
}

/// What a sample of the log is measured against.
struct SampleContext<'a> {
    reference: &'a dyn Reference,
    ptu: &'a dyn PanTilt,
    surface: &'a dyn Surface,
    settings: &'a FlightSettings,
}

impl SampleContext<'_> {
    fn sample(
        &self,
        time: f64,
        vehicle: &Vehicle,
        pan_tilt: [f64; 2],
        estimate: &Estimate,
        open: bool,
    ) -> Result<FlightSample, Error> {
        let wanted = checked(self.reference, time)?;
        let flow = self.flow(time)?;
        let seen = FlightSample::measured(time, vehicle, estimate.position, pan_tilt, &wanted, self.ptu, self.surface)?;
        Ok(FlightSample { flow: if open { flow } else { 0.0 }, held: flow > 0.0 && !open, ..seen })
    }

    /// The valve follows the reference later by its dead time, for which its commands are given early.
    fn flow(&self, time: f64) -> Result<f64, Error> {
        let commanded = time - self.settings.valve.dead_time + self.settings.valve.lead;
        if (0.0..=self.reference.duration()).contains(&commanded) {
            Ok(checked(self.reference, commanded)?.flow.max(0.0) * self.settings.faults.flow_share(time))
        } else {
            Ok(0.0)
        }
    }
}
