//! The flight on PX4: physics, PX4 and the on-board program in one simulated time.

use paint_planner::onboard::{Phase, Request};
use paint_sim::Surface;
use paint_sim::flight::Reference;

use super::error::RobotError;
use super::fault::{Fault, FaultKind};
use super::on_board::{CONTROL_STEP, OnBoard};
use super::recorder::{Record, Recorder, Seen};
use super::simulated_robot::{CONTROL_STEPS, SENSOR_STEPS, STEP, SimulatedRobot};
use crate::autopilot::{AutopilotError, Px4, simulator};
use crate::interruption;

/// The autopilot must be ready, armed and in the air after so long, s of its own clock.
const LONGEST_START: f64 = 60.0;
/// Landing may take so long, s.
const LONGEST_LANDING: f64 = 60.0;
/// Faster than this the ground breaks it, m/s.
const HARD_LANDING: f64 = 2.5;

/// A flight that was flown.
pub struct Flown {
    /// What it has left.
    pub record: Record,
    /// Control steps with the valve commanded open one step after a fault and later.
    pub valve_open_late: usize,
    /// Simulated time, s.
    pub seconds: f64,
    /// Processor time of PX4, s.
    pub px4_cpu: f64,
    /// What ended it before its time.
    pub failed: Option<String>,
    /// Whether that has broken the vehicle.
    pub broken: bool,
}

/// What is flown before what.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The plan.
    pub plan: &'a dyn Reference,
    /// What the spray meets.
    pub surface: &'a dyn Surface,
    /// What fails.
    pub faults: &'a [Fault],
}

/// Flies a plan on a PX4 in lockstep until it has landed or is given up.
///
/// `launch` starts PX4, again where a fault wants it. `progress` is told how much of the plan is painted, s.
///
/// # Errors
/// No PX4, or one that does not begin the flight. What goes wrong in the air is in [`Flown::failed`].
pub fn fly_px4(
    launch: &dyn Fn() -> Result<Px4, AutopilotError>,
    robot: &mut SimulatedRobot,
    on_board: &mut OnBoard,
    scene: &Scene,
    progress: &mut dyn FnMut(f64),
) -> Result<Flown, RobotError> {
    let px4 = launch()?;
    let motors = vec![0.0; robot.body().motors().len()];
    let recorder = Recorder::new(scene.plan, scene.surface);
    let faults = scene.faults;
    let (first_paint, late, past_cpu) = (None, 0, None);
    let mut flight = Px4Flight { launch, robot, on_board, faults, px4, motors, recorder, first_paint, late, past_cpu };
    let failed = loop {
        if interruption::is_requested() {
            flight.on_board.interrupt();
        }
        let end = flight.control_step().and_then(|end| flight.physics().map(|()| end));
        progress(flight.on_board.painted());
        match end {
            Ok(End::NotYet) => {}
            Ok(End::Landed) => break None,
            Ok(End::Failed(reason)) => break Some(reason),
            Err(error) if flight.on_board.wanted(flight.robot.time()).is_none() => return Err(error),
            Err(error) => break Some(format!("{error} ({})", flight.on_board.phase())),
        }
    };
    let broken = flight.is_broken();
    Ok(Flown {
        record: flight.recorder.finish(flight.on_board.events()),
        valve_open_late: flight.late,
        seconds: flight.robot.steps() as f64 * STEP,
        px4_cpu: flight.past_cpu.unwrap_or(0.0) + flight.px4.cpu_seconds(),
        broken,
        failed,
    })
}

struct Px4Flight<'a, 'b, 'c> {
    launch: &'a dyn Fn() -> Result<Px4, AutopilotError>,
    robot: &'a mut SimulatedRobot<'b>,
    on_board: &'a mut OnBoard<'c>,
    faults: &'a [Fault],
    px4: Px4,
    motors: Vec<f64>,
    recorder: Recorder<'a>,
    /// When the first paint phase began: faults count from there.
    first_paint: Option<f64>,
    late: usize,
    /// Processor time of a PX4 that was ended, s.
    past_cpu: Option<f64>,
}

impl Px4Flight<'_, '_, '_> {
    /// Time since the first paint phase began, s; below zero before.
    fn since_paint(&self) -> f64 {
        self.first_paint.map_or(-1.0, |since| self.robot.time() - since)
    }

    fn failing(&self, kind: FaultKind) -> Option<&Fault> {
        self.faults.iter().find(|fault| fault.kind == kind && fault.holds(self.since_paint()))
    }

    fn fails(&self, kind: FaultKind) -> bool {
        self.failing(kind).is_some()
    }

    /// The on-board program's part.
    fn control_step(&mut self) -> Result<End, RobotError> {
        let now = self.robot.time();
        let vehicle = self.robot.body().as_vehicle();
        let pose = self.robot.pose()?;
        if let Some(program) = self.failing(FaultKind::Program).map(|fault| fault.at) {
            let estimated = self.on_board.estimated_position().unwrap_or(vehicle.position);
            self.recorder.line(now, &vehicle, [Some(estimated), None], &"no on-board program");
            let down = self.motors.iter().all(|motor| *motor == 0.0);
            return Ok(match self.hard_landing() {
                Some(failed) => failed,
                None if down => End::Failed("the on-board program has ended; the autopilot has landed".into()),
                None if self.since_paint() > program + LONGEST_LANDING => {
                    End::Failed("the on-board program has ended; the autopilot does not land".into())
                }
                None => End::NotYet,
            });
        }
        let cut = self.fails(FaultKind::Link);
        for (header, mut message) in self.px4.receive() {
            for fault in self.faults.iter().filter(|fault| fault.holds(self.since_paint())) {
                fault.kind.distort(&mut message);
            }
            if !cut {
                self.on_board.link().receive(now, &header, &message);
            }
        }
        let pose = pose.filter(|_| !self.fails(FaultKind::Pose));
        let commanded = self.on_board.step(now, pose.as_ref(), self.robot.pan_tilt());
        self.px4.send(if cut { &[] } else { &commanded.messages })?;
        if self.fails(FaultKind::Mode) {
            self.px4.send(&self.on_board.link().commands(Request::Land))?;
        }
        self.robot.stick(self.fails(FaultKind::Servo));
        self.robot.command(commanded.pan_tilt, commanded.flow);
        if self.on_board.phase() == Phase::Paint {
            self.first_paint.get_or_insert(now);
        }
        let seen = Seen {
            estimated: self.on_board.estimated_position().unwrap_or(vehicle.position),
            vehicle,
            ptu: self.robot.ptu(),
            pan_tilt: self.robot.pan_tilt(),
            flow: self.robot.flow(),
        };
        if let Some(sample) = self.recorder.note(now, self.on_board, &seen)? {
            self.robot.sprayed(&sample, CONTROL_STEP);
        }
        match self.hard_landing() {
            Some(failed) => Ok(failed),
            None => over(self.on_board, now),
        }
    }

    fn is_broken(&self) -> bool {
        self.robot.body().impact_speed() > HARD_LANDING
    }

    fn hard_landing(&self) -> Option<End> {
        let speed = self.robot.body().impact_speed();
        let failed =
            || End::Failed(format!("the vehicle hit the ground at {speed:.1} m/s ({})", self.on_board.phase()));
        self.is_broken().then(failed)
    }

    /// The physics and the autopilot until the next control step.
    fn physics(&mut self) -> Result<(), RobotError> {
        let forbidden = self.faults.iter().any(|fault| fault.forbids_paint(self.since_paint(), CONTROL_STEP));
        if self.past_cpu.is_none() && self.fails(FaultKind::Restart) {
            self.past_cpu = Some(self.px4.cpu_seconds());
            self.px4.kill();
            self.px4 = (self.launch)()?;
            self.motors.fill(0.0);
        }
        for k in 0..CONTROL_STEPS {
            // Not at 0: PX4 takes such a clock for one that is not set, sleeps on the wall clock until the next sample, and how its loops
            // lie among the samples would be the scheduler's choice.
            if self.robot.steps() > 0
                && self.robot.steps().is_multiple_of(SENSOR_STEPS)
                && let Some(controls) = self.px4.step(&self.robot.sensors())?
            {
                self.motors = simulator::motor_commands(controls, self.motors.len());
            }
            self.robot.step(&self.motors)?;
            self.late += usize::from(k == 0 && forbidden && self.robot.valve_is_commanded_open());
        }
        Ok(())
    }
}

/// Whether a flight is over, and how it ended.
pub(super) enum End {
    NotYet,
    Landed,
    Failed(String),
}

/// Whether the flight is over for the on-board program. An error where the autopilot did not begin it.
pub(super) fn over(on_board: &mut OnBoard, now: f64) -> Result<End, RobotError> {
    let phase = on_board.phase();
    let since = on_board.events().last().map_or(0.0, |(since, _)| now - since);
    let ended_early = on_board.ended_early();
    let called_off = on_board.is_called_off();
    let telemetry = on_board.link().telemetry();
    if let Some(identity) = telemetry.identity {
        identity.check()?;
    }
    match phase {
        _ if called_off => Ok(End::Failed("interrupted before it took off".into())),
        Phase::Done => Ok(match ended_early {
            Some(cause) => End::Failed(format!("ended early: {}", cause.text())),
            None => End::Landed,
        }),
        Phase::Aborted(_) => Ok(End::Failed(phase.to_string())),
        Phase::Wait | Phase::Arm if now > LONGEST_START => {
            let what = if phase == Phase::Wait { "find its place" } else { "arm in off-board mode" };
            if telemetry.identity.is_none() {
                return Err(AutopilotError::Silent {
                    what: "the off-board link".into(),
                    seconds: LONGEST_START,
                    hint: "no heartbeat of an autopilot came".into(),
                }
                .into());
            }
            let state =
                format!("{:?}, armed: {}, estimator: {:?}", telemetry.mode, telemetry.armed, telemetry.estimator);
            let said = telemetry.text.clone().unwrap_or_else(|| "nothing".into());
            Err(AutopilotError::Refused { what, seconds: LONGEST_START, state, said }.into())
        }
        Phase::Land if since > LONGEST_LANDING => Ok(End::Failed("it does not land".into())),
        _ => Ok(End::NotYet),
    }
}
