//! The controller in a simulated robot: sensors with their errors, a slide, a valve, and the true paint beside the believed one (handheld
//! paper, Section VI-B).

mod log;

use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use paint_planner::gantry::{Controller, ControllerSettings, Frame, InertialSample, RangeReading};
use paint_sim::droplets::{Coverage, Droplets, StepHits};
use paint_sim::gantry_robot::{InertialSensor, PoseSensor, RangeSensor, Stepper, Valve};
use paint_sim::spray::QUANTUM;

use super::deposit_model::SimulatedDeposit;
use super::error::HandheldError;
use super::forecast::{PaintDevice, PaintJob};
use super::hardware::HardwareSettings;
use super::object::PaintObject;
use crate::interruption;
pub use log::{PaintingLog, Tick};

/// Number of the first set of droplets that falls on the true object: the believed ones have their own.
const TRUE_SETS: u64 = 1000;
/// Parts of a tick in which the true nozzle is simulated.
const PARTS: usize = 2;

/// How a person holds the robot.
pub struct HandPoses<'a> {
    /// Pose of the robot at a time, s.
    pub pose: &'a dyn Fn(f64) -> Isometry3<f64>,
    /// Whether markers can be seen at that time at all.
    pub tracked: &'a dyn Fn(f64) -> bool,
    /// How long, s.
    pub duration: f64,
}

/// Paints while the hand moves; `progress` is told the share done.
///
/// # Errors
/// Settings that simulator or planner refuse, or a device that fails.
pub fn paint(
    object: &PaintObject,
    job: &PaintJob,
    device: &mut dyn PaintDevice,
    hardware: &HardwareSettings,
    hand: &HandPoses,
    progress: &dyn Fn(f64),
) -> Result<PaintingLog, HandheldError> {
    let dt = job.settings.deposit.step;
    let settings = ControllerSettings {
        step: dt,
        planner: job.settings.planner(),
        beam: job.settings.beam,
        filter: hardware.filter,
        max_position_sigma: hardware.max_position_sigma,
        registration: hardware.registration,
        corner_acceleration: hardware.corner_acceleration,
        valve_delay: hardware.valve.open_delay,
    };
    let model = SimulatedDeposit::new(job, &object.world, device);
    let bare = object.bare()?;
    let mut controller = Controller::new(settings, model, bare.clone(), object.middle())?;
    let mut robot = SimulatedRobot::new(object, job, hardware, bare.clone())?;
    let mut log = PaintingLog::new(bare);
    let mut squared_error = 0.0;
    let ticks = (hand.duration / dt).round() as usize;
    for tick in 0..ticks {
        if interruption::is_requested() {
            break;
        }
        let time = tick as f64 * dt;
        let pose = (hand.pose)(time);
        let measured = robot.pose_sensor.measure(&pose, time, dt).filter(|_| (hand.tracked)(time));
        let ranges =
            if measured.is_some() && hardware.registration.is_some() { robot.ranges(&pose) } else { Vec::new() };
        let frame = Frame {
            time,
            world_from_robot: measured,
            inertial: robot.inertial(hand.pose, time),
            ranges: &ranges,
            position: robot.stepper.position(),
            sprayed: log.ticks.last().map_or(0.0, |tick| tick.open),
        };
        let began = Instant::now();
        let command = controller.frame(&frame)?;
        let (took, valve_open) = (began.elapsed(), command.valve_open);
        log.note(&frame, command, took);
        if let Some(motion) = controller.motion().filter(|_| measured.is_some()) {
            let error = motion.world_from_robot.translation.vector - pose.translation.vector;
            squared_error += error.norm_squared();
        }
        robot.valve.command(time, valve_open);
        let tick = robot.spray(tick, hand.pose, &controller);
        log.ticks.push(Tick { tracked: measured.is_some(), ..tick });
        if log.ticks.len() % 100 == 1 {
            progress((log.ticks.len() - 1) as f64 / ticks as f64);
        }
    }
    let (middle, believed) = (object.middle(), controller.object_place());
    log.registration_error = (believed * middle - hardware.world_from_model * middle).norm();
    log.position_error_rms = (squared_error / (log.ticks.len() - log.lost_ticks).max(1) as f64).sqrt();
    (log.limit_hits, log.valve_switches) = (robot.stepper.limit_hits, robot.valve.switched);
    (log.truth, log.emitted) = (robot.truth, robot.emitted);
    log.belief = controller.deposit().clone();
    Ok(log)
}

/// Sensors, actuators and what they do to the true object.
struct SimulatedRobot<'a> {
    object: &'a PaintObject,
    job: &'a PaintJob<'a>,
    model_from_world: Isometry3<f64>,
    pose_sensor: PoseSensor,
    range_sensor: RangeSensor,
    inertial_sensor: Option<InertialSensor>,
    stepper: Stepper,
    valve: Valve,
    droplets: Vec<Droplets>,
    /// The paint on the true object, and what left the nozzle, m^3.
    truth: Coverage,
    emitted: f64,
}

impl<'a> SimulatedRobot<'a> {
    fn new(
        object: &'a PaintObject,
        job: &'a PaintJob<'a>,
        settings: &HardwareSettings,
        truth: Coverage,
    ) -> Result<Self, HandheldError> {
        let inertial = settings.inertial_sensor.map(|inertial| InertialSensor::new(inertial, settings.seed));
        let droplets = (TRUE_SETS..TRUE_SETS + 16)
            .map(|number| Droplets::new(&job.settings.spray, job.settings.deposit.droplets, number));
        Ok(Self {
            object,
            job,
            model_from_world: settings.world_from_model.inverse(),
            pose_sensor: PoseSensor::new(settings.pose_sensor, settings.seed)?,
            range_sensor: RangeSensor::new(settings.range_sensor, settings.seed)?,
            inertial_sensor: inertial.transpose()?,
            stepper: Stepper::new(settings.stepper, 0.5 * settings.stepper.travel)?,
            valve: Valve::new(settings.valve)?,
            droplets: droplets.collect::<Result<_, _>>()?,
            truth,
            emitted: 0.0,
        })
    }

    fn ranges(&mut self, world_from_robot: &Isometry3<f64>) -> Vec<RangeReading> {
        let distances = self.range_sensor.measure(&(self.model_from_world * world_from_robot), &self.object.world);
        let reading = |(direction, distance)| RangeReading { origin: Point3::origin(), direction, distance };
        self.range_sensor.directions().iter().copied().zip(distances).map(reading).collect()
    }

    fn inertial(&mut self, motion: &dyn Fn(f64) -> Isometry3<f64>, time: f64) -> Option<InertialSample> {
        let reading = self.inertial_sensor.as_mut()?.measure(motion, time);
        Some(InertialSample { specific_force: reading.specific_force, angular_velocity: reading.angular_velocity })
    }

    /// What really happens during a tick.
    fn spray(
        &mut self,
        tick: usize,
        motion: &dyn Fn(f64) -> Isometry3<f64>,
        controller: &Controller<SimulatedDeposit>,
    ) -> Tick {
        let settings = self.job.settings;
        let time = tick as f64 * settings.deposit.step;
        let part = settings.deposit.step / PARTS as f64;
        let mut open = 0.0;
        for k in 0..PARTS {
            let (from, to) = (time + k as f64 * part, time + (k + 1) as f64 * part);
            let before = self.stepper.position();
            let setpoint = controller.slide_at(to);
            self.stepper.step(setpoint.position, setpoint.velocity, part);
            let share = self.valve.open_share(from, to);
            open += share / PARTS as f64;
            if share == 0.0 {
                continue;
            }
            let position = 0.5 * (before + self.stepper.position());
            let nozzle = settings.geometry.nozzle(&(self.model_from_world * motion(0.5 * (from + to))), position);
            let sets = &self.droplets;
            let hits = StepHits::cast(self.job.surface, &nozzle, &sets[(PARTS * tick + k) % sets.len()]);
            let volume = settings.deposit.flow * part * share;
            self.emitted += volume;
            let droplet = volume / (settings.deposit.droplets as f64 * QUANTUM);
            self.truth.spray(&hits, droplet.round() as u64);
        }
        let (pose, position) = (motion(time), self.stepper.position());
        let nozzle = settings.geometry.nozzle(&pose, position);
        let at_model = settings.geometry.nozzle(&(self.model_from_world * pose), position);
        let hit = paint_sim::Surface::cast(&self.object.world, &at_model.origin, &at_model.axis, settings.spray.range);
        Tick {
            time,
            world_from_robot: pose,
            position,
            open,
            tracked: true,
            hit: hit.map(|hit| nozzle.origin + nozzle.axis.into_inner() * hit.distance),
        }
    }
}
