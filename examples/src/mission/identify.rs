//! The excitation flight before the first that paints: how the vehicle follows its commands, for controller and observer.

use nalgebra::{Point3, Vector3};
use paint_planner::control::{AttitudeFit, Excitation, Identification, IdentifiedAttitude};
use paint_planner::onboard::StraightWay;
use paint_sim::Surface;
use paint_sim::flight::{
    Airframe, CascadedController, Command, Controller, ControllerSettings, Estimate, FlightLog, FlightSettings,
    IdealPanTilt, LocalisedPose, PoseSource, Reference, ReferenceState, fly_localised,
};

use super::error::MissionError;
use super::flight_conditions::{localisation_noise, usual_flight};
use super::flight_sensors::{Poses, camera_before};
use super::painting_task::PaintingTask;
use super::plan::{Planned, PlannedLayer};
use crate::adapters::reference_state;
use crate::progress::Stage;
use crate::report::IdentifiedFigures;

/// The robot stands back from the place where its plan begins by so much, m, so that it may move.
const BACK: f64 = 1.2;
/// Its number among the flights, for its wind.
const FLIGHT: u64 = 0x200;
/// A soft hold: what it takes back of the slow part of the excitation is not there to learn from.
const HOLD: ControllerSettings =
    ControllerSettings { position: 2.0, velocity: 2.5, attitude: 6.0, heading: 3.0, lever_rate: 0.0, jerk_window: 0.1 };
/// Length of the gun, m: it points ahead and does nothing.
const GUN: f64 = 0.3;

/// What an excitation flight told.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Identified {
    /// The vehicle as controller and observer take it from now on.
    pub(super) model: Airframe,
    /// Roll and pitch.
    pub(super) attitude: IdentifiedAttitude,
}

impl Identified {
    /// For the report, beside the vehicle that was flown.
    pub(super) fn figures(&self, truth: &Airframe) -> IdentifiedFigures {
        IdentifiedFigures::of(&self.model, &self.attitude, truth)
    }
}

/// Flies an excitation behind the place where the first plan begins, if the mission asks for it, by the localisation that was chosen. What it
/// tells is the model from then on.
pub(super) fn identify(task: &mut PaintingTask, planned: &Planned) -> Result<Option<Identified>, MissionError> {
    let Some(PlannedLayer { plan, .. }) = planned.layers.first().filter(|_| task.settings.identify) else {
        return Ok(None);
    };
    let stage = Stage::start("identify");
    let usual = usual_flight(plan, &task.robot, &task.settings, FLIGHT);
    let conditions = FlightSettings { localisation: localisation_noise(&task.settings, usual.localisation), ..usual };
    let mut poses = Poses::of(task, || camera_before(task, std::iter::empty()), 0, &conditions)?;
    let start = plan.setpoint(0.0).sample;
    let (_, identified) = excite(&start.position, start.heading, task.met(), &conditions, poses.source())?;
    task.settings.model = identified.model;
    let describe = |fit: &AttitudeFit| format!("{:.3} in {:.3} s", fit.response.gain, lag(fit));
    let [roll, pitch] = &identified.attitude.first_order;
    stage.done(&format!("roll {}, pitch {}", describe(roll), describe(pitch)));
    Ok(Some(identified))
}

/// The flight behind a place, and what it told.
fn excite(
    place: &Point3<f64>,
    heading: f64,
    world: &dyn Surface,
    conditions: &FlightSettings,
    poses: &mut dyn PoseSource,
) -> Result<(FlightLog, Identified), MissionError> {
    let model = conditions.model();
    let excitation = Excitation { tilt_limit: model.tilt_limit, ..Excitation::default() };
    let mut controller = ExcitedController {
        inner: CascadedController::new(model, HOLD),
        identification: Identification::new(excitation)?,
        measured: [0.0; 2],
    };
    let place = place - BACK * Vector3::new(heading.cos(), heading.sin(), 0.0);
    let hover = Hover { place, heading, duration: excitation.total_duration() };
    let mut gun = IdealPanTilt::new(Point3::origin(), GUN, [0.8; 2])?;
    // The gun does nothing.
    let conditions = FlightSettings { ptu_locked: true, ..*conditions };
    let log = fly_localised(&hover, &mut controller, &mut gun, world, poses, &conditions)?;
    let attitude = controller.identification.finish()?;
    let [roll, pitch] = &attitude.first_order;
    let model = Airframe {
        roll_gain: roll.response.gain,
        roll_time_constant: lag(roll),
        pitch_gain: pitch.response.gain,
        pitch_time_constant: lag(pitch),
        ..model
    };
    Ok((log, Identified { model, attitude }))
}

/// The model has no delay: the whole lag is its time constant, s.
fn lag(fit: &AttitudeFit) -> f64 {
    fit.response.time_constant + fit.delay
}

/// A controller whose roll and pitch are excited, by the attitude that is reported.
struct ExcitedController {
    inner: CascadedController,
    identification: Identification,
    measured: [f64; 2],
}

impl Controller for ExcitedController {
    fn reported(&mut self, _time: f64, pose: &LocalisedPose) {
        let (roll, pitch, _) = pose.world_from_body.rotation.euler_angles();
        self.measured = [roll, pitch];
    }

    fn command(&mut self, time: f64, estimate: &Estimate, reference: &dyn Reference) -> Command {
        let wanted = self.inner.command(time, estimate, reference);
        let [roll, pitch] = self.identification.step(time, [wanted.roll, wanted.pitch], self.measured);
        Command { roll, pitch, ..wanted }
    }
}

/// In its place.
struct Hover {
    place: Point3<f64>,
    heading: f64,
    duration: f64,
}

impl Reference for Hover {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> ReferenceState {
        let way = StraightWay { ends: [self.place; 2], heading: [self.heading; 2], duration: self.duration };
        reference_state(&way.at(t, Vector3::zeros()))
    }
}

#[cfg(test)]
mod tests {
    use paint_sim::flight::FlightSample;
    use ptu_kinematics::Ptu;

    use super::super::settings::MissionSettings;
    use super::super::simulated_flight::{flight_settings, fly_plan, noise};
    use super::super::test_panel;
    use super::*;
    use crate::adapters::Robot;

    /// The usual vehicle with gains and time constants off by a share, each its own way.
    fn off(share: [f64; 5]) -> Airframe {
        let usual = Airframe::default();
        Airframe {
            roll_gain: usual.roll_gain * (1.0 + share[0]),
            roll_time_constant: usual.roll_time_constant * (1.0 + share[1]),
            pitch_gain: usual.pitch_gain * (1.0 + share[2]),
            pitch_time_constant: usual.pitch_time_constant * (1.0 + share[3]),
            yaw_time_constant: usual.yaw_time_constant * (1.0 + share[4]),
            ..usual
        }
    }

    /// Eight vehicles whose gains and lags are off by 30 %, each its own way: all together, and none of them by more than before.
    #[test]
    fn what_is_identified_paints_better_than_what_was_believed() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let plan = test_panel::plan(&surface, &robot, &settings);
        let start = plan.setpoint(0.0).sample;
        let mut squares = [0.0; 2];
        for seed in 0..8 {
            let signs = 11 * seed;
            let airframe = off(std::array::from_fn(|k| if signs >> k & 1 == 0 { -0.3 } else { 0.3 }));
            let believed =
                FlightSettings { airframe, model: Some(Airframe::default()), ..flight_settings(&plan, None, seed) };
            let mut poses = noise(&believed);
            let (log, identified) =
                excite(&start.position, start.heading, &surface.world, &believed, &mut poses).unwrap();
            let model = identified.model;
            for (found, truth) in [
                (model.roll_gain, airframe.roll_gain),
                (model.roll_time_constant, airframe.roll_time_constant),
                (model.pitch_gain, airframe.pitch_gain),
                (model.pitch_time_constant, airframe.pitch_time_constant),
            ] {
                assert!((found / truth - 1.0).abs() < 0.03, "vehicle {seed}: {found} for {truth}");
            }
            assert!(identified.attitude.second_order.iter().all(Option::is_none));
            let away = |s: &FlightSample| (s.world_from_body.translation.vector - s.reference_position.coords).norm();
            let excursion = log.samples.iter().map(away).fold(0.0, f64::max);
            assert!(excursion < 0.6, "{excursion} m");
            let learnt = FlightSettings { model: Some(model), ..believed };
            let hits = [believed, learnt].map(|flight| {
                let log = fly_plan(&plan, &surface.world, &robot, &settings, &flight).unwrap();
                log.statistics().hit_error_rms
            });
            println!("vehicle {seed}: {:.4} m by what was believed, {:.4} m by what is identified", hits[0], hits[1]);
            assert!(hits[1] < hits[0], "{hits:?}");
            squares = [0, 1].map(|k| squares[k] + hits[k] * hits[k]);
        }
        let ratio = (squares[1] / squares[0]).sqrt();
        println!("together {ratio:.2} of it");
        assert!(ratio < 0.7, "{ratio}");
    }
}
