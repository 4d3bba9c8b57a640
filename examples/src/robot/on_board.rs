//! The on-board program: fed poses, joint angles and the autopilot's messages, it says what to send, where to aim and when to spray.
//! It knows neither sockets nor the simulation; times are those of whoever runs it, 100 steps a second.

use nalgebra::{Matrix3, Point3, Vector3};
use paint_planner::onboard::{Cause, FailsafeSettings, Phase, Phases, Situation};
use paint_sim::flight::{
    Airframe, CascadedController, Command, Controller as _, ControllerSettings, Estimate, Estimator, GRAVITY,
    InterlockInput, InterlockState, LocalisedPose, ObserverSettings, PanTilt, Reference, ReferenceState, Valve,
};

use super::guided_reference::{GuidedReference, ReferencePlan};
use crate::adapters::ServoPanTilt;
use crate::autopilot::{MavMessage, Odometry, OffboardLink, OffboardSettings, Setpoint};

/// Time of a control step, s.
pub(super) const CONTROL_STEP: f64 = 0.01;
/// What the autopilot aimed for longer ago than this, s, it no longer aims for.
const LONGEST_SILENCE: f64 = 0.1;
/// A pose that is farther from the one before than the fastest robot flies has jumped: m, and m/s.
const JUMP: f64 = 0.05;
const FASTEST: f64 = 3.0;
/// The autopilot is told of no more than this, m/s^2: a stronger one is a jump of the localisation.
const STRONGEST: f64 = 2.0;

/// Gains on an autopilot whose attitude loop is slower and of higher order than the controller's model: a third of its bandwidth.
const CONTROLLER: ControllerSettings =
    ControllerSettings { position: 4.0, velocity: 3.5, attitude: 6.0, heading: 3.0, lever_rate: 1.0, jerk_window: 0.1 };

/// Pole of the attitude, rad/s: such an autopilot turns as no model of first order expects, and what is measured errs less than the model.
const ATTITUDE_POLE: f64 = 60.0;

/// The observer's poles: inside our own position loop as slow as that loop needs it, beside the autopilot's as fast as the aim wants it.
fn observer(setpoints: SetpointKind) -> ObserverSettings {
    let translation = match setpoints {
        SetpointKind::Attitude => 6.0,
        SetpointKind::Trajectory => 16.0,
    };
    ObserverSettings { translation, attitude: ATTITUDE_POLE }
}

/// Which set-points the autopilot is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SetpointKind {
    /// Attitude and thrust: the position controller is ours, as in the thesis
    Attitude,
    /// Position, velocity, acceleration and heading: the position controller is the autopilot's
    Trajectory,
}

impl SetpointKind {
    /// As on the command line.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// What the on-board program is told.
#[derive(Debug, Clone, Copy)]
pub struct OnBoardSettings {
    /// Which set-points are sent.
    pub setpoints: SetpointKind,
    /// Whether it arms and takes control by itself: in simulation only; on a vehicle it waits for the pilot to do both.
    pub arms: bool,
    /// Responses of the vehicle under the autopilot's attitude control.
    pub airframe: Airframe,
    /// Share of the full thrust that carries the weight.
    pub hover_thrust: f64,
    /// Whether poses go to the autopilot as odometry; no if they come from it.
    pub sends_odometry: bool,
    /// The valve and its interlock.
    pub valve: Valve,
    /// When something is a cause to shut it.
    pub failsafe: FailsafeSettings,
    /// Rates of the link.
    pub offboard: OffboardSettings,
    /// How much of the plan is painted, s.
    pub seconds: f64,
}

/// What the robot is told in a control step.
#[derive(Debug, Clone, PartialEq)]
pub struct Commanded {
    /// For the autopilot.
    pub messages: Vec<MavMessage>,
    /// Pan and tilt, rad.
    pub pan_tilt: [f64; 2],
    /// Flow that the valve is opened for, m^3/s.
    pub flow: f64,
}

/// The state of the program.
pub struct OnBoard<'a> {
    settings: OnBoardSettings,
    plan: &'a dyn Reference,
    controller: CascadedController,
    estimator: Option<Estimator>,
    ptu: ServoPanTilt,
    interlock: InterlockState,
    link: OffboardLink,
    phases: Phases<ReferencePlan<'a>>,
    /// The last pose, and when it came.
    last: Option<(f64, LocalisedPose)>,
    /// Jumps of the pose.
    resets: u8,
    interrupted: bool,
}

impl<'a> OnBoard<'a> {
    /// On the ground with nothing heard.
    pub fn new(plan: &'a dyn Reference, ptu: ServoPanTilt, settings: OnBoardSettings) -> Self {
        let delays = [ptu.delay(), settings.valve.dead_time].map(|delay| delay / CONTROL_STEP);
        Self {
            controller: CascadedController::new(settings.airframe, CONTROLLER),
            estimator: None,
            interlock: InterlockState::new(settings.valve.interlock, delays),
            link: OffboardLink::new(settings.offboard),
            phases: Phases::new(ReferencePlan(plan), settings.seconds, settings.valve.lead),
            last: None,
            resets: 0,
            interrupted: false,
            plan,
            ptu,
            settings,
        }
    }

    /// The off-board link, which is to be fed with the autopilot's messages.
    pub fn link(&mut self) -> &mut OffboardLink {
        &mut self.link
    }

    /// The flight is to end: with the valve shut it returns and lands, or stays on the ground.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// Whether it was interrupted before it took off.
    pub(super) fn is_called_off(&self) -> bool {
        self.interrupted && matches!(self.phase(), Phase::Wait | Phase::Arm)
    }

    /// What it is doing.
    pub fn phase(&self) -> Phase {
        self.phases.phase()
    }

    /// When each phase began.
    pub fn events(&self) -> &[(f64, Phase)] {
        self.phases.events()
    }

    /// Time of the plan, while it is painted.
    pub fn plan_time(&self, now: f64) -> Option<f64> {
        self.phases.plan_time(now).filter(|_| self.phase() == Phase::Paint)
    }

    /// Time of the plan up to which it is painted, s.
    pub fn painted(&self) -> f64 {
        self.phases.painted()
    }

    /// Why a flight that landed did not paint all of it.
    pub fn ended_early(&self) -> Option<Cause> {
        self.phases.ended_early()
    }

    /// Where it takes itself to be.
    pub fn estimated_position(&self) -> Option<Point3<f64>> {
        self.estimator.as_ref().map(|estimator| estimator.estimate().position)
    }

    /// Where it shall be; nothing on the ground.
    pub fn wanted(&self, now: f64) -> Option<ReferenceState> {
        self.phases.guided().map(|guided| GuidedReference(guided).at(now))
    }

    /// One control step at `now` (s), with the newest pose (`None`: there is none) and the joints as they report themselves.
    pub fn step(&mut self, now: f64, pose: Option<&LocalisedPose>, angles: [f64; 2]) -> Commanded {
        match (&mut self.estimator, pose) {
            (Some(estimator), Some(pose)) => estimator.update(&pose.world_from_body, CONTROL_STEP),
            (Some(estimator), None) => estimator.coast(CONTROL_STEP),
            (none, Some(pose)) => {
                let observer = observer(self.settings.setpoints);
                *none = Some(Estimator::new(self.settings.airframe, observer, &pose.world_from_body));
            }
            (None, None) => {}
        }
        let trusted = pose.is_some_and(|pose| pose.trusted) && !self.jumped(now, pose);
        let pose = pose.map(|pose| LocalisedPose { trusted, ..*pose });
        let watched = self.link.telemetry().watched(pose.as_ref());
        let failed = self.settings.failsafe.cause(now, &watched);
        let cause = failed.into_iter().chain(self.interrupted.then_some(Cause::Interrupted)).min();
        if let Some(estimator) = &self.estimator {
            let estimate = estimator.estimate();
            let ready = self.settings.failsafe.ready(&watched) && self.link.telemetry().position.is_some();
            let armed = watched.armed;
            let [_, _, heading] = estimate.attitude;
            self.phases.advance(&Situation { now, cause, position: estimate.position, heading, ready, armed });
            self.link.request(self.phases.request(self.settings.arms));
        }
        let setpoint = self.setpoint(now);
        let odometry = pose.filter(|_| self.settings.sends_odometry).map(|pose| odometry(&pose, self.resets));
        let messages = self.link.transmit(now, setpoint.as_ref(), odometry.as_ref());
        let (pan_tilt, permitted) = self.aim(now, angles, trusted);
        let flow = if permitted && cause.is_none() { self.wanted_flow(now) } else { 0.0 };
        Commanded { messages, pan_tilt, flow }
    }

    /// Whether a pose does not follow from the one before; such jumps are counted for the autopilot's estimator.
    fn jumped(&mut self, now: f64, pose: Option<&LocalisedPose>) -> bool {
        let Some(pose) = pose else { return false };
        let (before, at) = self.last.replace((now, *pose)).map_or((*pose, now), |(at, before)| (before, at));
        let way = pose.world_from_body.translation.vector - before.world_from_body.translation.vector;
        let jumped = way.norm() > JUMP + FASTEST * (now - at);
        self.resets = self.resets.wrapping_add(u8::from(jumped));
        jumped
    }

    fn setpoint(&mut self, now: f64) -> Option<Setpoint> {
        let (station, station_heading) = self.phases.station()?;
        let Some(guided) = self.phases.guided().map(GuidedReference) else {
            // On the ground.
            return Some(match self.settings.setpoints {
                SetpointKind::Attitude => Setpoint::leaning(0.0, 0.0, station_heading, station_heading, 0.0),
                SetpointKind::Trajectory => Setpoint::Trajectory {
                    position: station,
                    velocity: Vector3::zeros(),
                    acceleration: Vector3::zeros(),
                    heading: station_heading,
                },
            });
        };
        let estimate = *self.estimator.as_ref()?.estimate();
        let wanted = guided.at(now);
        let (setpoint, command) = match self.settings.setpoints {
            SetpointKind::Attitude => {
                let command = self.controller.command(now, &estimate, &guided);
                let [_, _, yaw] = estimate.attitude;
                let thrust = command.thrust / (self.settings.airframe.mass * GRAVITY) * self.settings.hover_thrust;
                (Setpoint::leaning(command.roll, command.pitch, yaw, wanted.heading, thrust), command)
            }
            SetpointKind::Trajectory => {
                // The autopilot knows of wind and hose only what its own error tells.
                let disturbance = estimate.disturbance.cap_magnitude(STRONGEST);
                let setpoint = Setpoint::Trajectory {
                    position: wanted.position,
                    velocity: wanted.velocity,
                    acceleration: wanted.acceleration - disturbance,
                    heading: wanted.heading,
                };
                let command = self.autopilots_command(now, &estimate);
                (setpoint, command)
            }
        };
        self.estimator.as_mut()?.set_command(command);
        Some(setpoint)
    }

    /// What the autopilot's position controller commands, by what it says or, where it says nothing, by the attitude that it keeps.
    fn autopilots_command(&self, now: f64, estimate: &Estimate) -> Command {
        let Airframe { mass, roll_gain, pitch_gain, .. } = self.settings.airframe;
        let weight = mass * GRAVITY;
        let told = self.link.telemetry().attitude_target.filter(|target| now - target.at <= LONGEST_SILENCE);
        let [roll, pitch, thrust] = told.map_or_else(
            || {
                let [roll, pitch, _] = estimate.attitude;
                [roll / roll_gain, pitch / pitch_gain, weight / (roll.cos() * pitch.cos()).max(0.5)]
            },
            |target| {
                let (roll, pitch, _) = target.attitude.euler_angles();
                [roll, pitch, target.thrust / self.settings.hover_thrust * weight]
            },
        );
        Command { roll, pitch, yaw_rate: estimate.yaw_rate, thrust }
    }

    /// Where the joints shall be, and whether the interlock permits paint.
    fn aim(&mut self, now: f64, angles: [f64; 2], trusted: bool) -> ([f64; 2], bool) {
        let Some(estimator) = &self.estimator else { return ([0.0; 2], false) };
        self.ptu.reset(angles);
        let Some(offset) = self.phases.aim_offset(now) else { return ([0.0; 2], false) };
        let at = |time: f64| self.plan.at(time - offset);
        // A command holds for one control step, so on average it acts half a step later still.
        let ahead = self.ptu.delay() + 0.5 * CONTROL_STEP;
        let aim = at(now + ahead).aim;
        let command = aim.map_or([0.0; 2], |point| self.ptu.command(&estimator.predict(ahead), &point));
        let ahead = self.settings.valve.dead_time + 0.5 * CONTROL_STEP;
        let (wanted, later) = (at(now), at(now + ahead));
        let estimator = trusted.then_some(estimator);
        self.interlock
            .decide(&self.ptu, &InterlockInput { estimator, angles, command, now: &wanted, later: &later, ahead });
        (command, self.interlock.last())
    }

    /// What the plan asks for when a command of now takes effect; nothing where it is painted already.
    fn wanted_flow(&self, now: f64) -> f64 {
        let Some(time) = self.plan_time(now).map(|time| time + self.settings.valve.lead) else { return 0.0 };
        if self.phases.unpainted().contains(&time) { self.plan.at(time).flow.max(0.0) } else { 0.0 }
    }
}

/// A pose for the autopilot, after so many jumps.
fn odometry(pose: &LocalisedPose, resets: u8) -> Odometry {
    let [position, attitude] = pose.sigma.map(|sigma| sigma * sigma);
    Odometry {
        world_from_body: pose.world_from_body,
        velocity: None,
        position_covariance: Matrix3::from_diagonal_element(position),
        attitude_covariance: Matrix3::from_diagonal_element(attitude),
        velocity_covariance: Matrix3::zeros(),
        north: true,
        resets,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, UnitQuaternion};

    use super::*;

    /// An error of the model's roll decays at its own rate and the observer's pole: of 0.1 rad at 7 rad/s |7j + 5.4| / |7j + 5.4 + 60|,
    /// 13 mrad, is left.
    #[test]
    fn a_vehicle_that_turns_as_the_model_does_not_is_followed() {
        let turned = |time: f64| Isometry3::rotation(Vector3::x() * 0.1 * (7.0 * time).sin());
        for setpoints in [SetpointKind::Attitude, SetpointKind::Trajectory] {
            let mut estimator = Estimator::new(Airframe::default(), observer(setpoints), &turned(0.0));
            let mut worst = 0.0_f64;
            for step in 1..300 {
                let pose = turned(f64::from(step) * CONTROL_STEP);
                estimator.update(&pose, CONTROL_STEP);
                let [roll, pitch, yaw] = estimator.estimate().attitude;
                worst = worst.max(UnitQuaternion::from_euler_angles(roll, pitch, yaw).angle_to(&pose.rotation));
            }
            assert!((0.005..0.02).contains(&worst), "{setpoints:?}: {worst}");
        }
    }
}
