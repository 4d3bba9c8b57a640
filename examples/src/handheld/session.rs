//! The loop: poses a hundred times a second, a decision ten times a second, and the true paint beside the believed one (handheld paper,
//! Section VI-B).

mod booking;
mod log;
mod settings;

use std::collections::VecDeque;
use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use paint_planner::gantry::{
    GantryState, PoseFilter, RangeReading, Registration, RobotMotion, RoundedPath, Segment, plan_gantry, refine,
};
use paint_sim::droplets::{Coverage, Droplets, StepHits, Sweep};
use paint_sim::gantry_robot::{InertialSensor, PoseSensor, RangeSensor, Stepper, Valve};
use paint_sim::spray::QUANTUM;

use super::error::HandheldError;
use super::forecast::{Forecast, PaintDevice, PaintJob};
use super::object::PaintObject;
use super::settings::HandheldSettings;
use crate::adapters::MeshSurface;
use booking::Booking;
pub use log::{SessionLog, Tick};
pub use settings::SessionSettings;

/// Number of the first set of droplets that falls on the true object: the believed ones have their own.
const TRUE_SETS: u64 = 1000;
/// Parts of a tick in which the true nozzle is simulated.
const PARTS: usize = 2;

/// The robot's software and hardware while it paints.
struct Session<'a> {
    object: &'a PaintObject,
    job: &'a PaintJob<'a>,
    settings: &'a SessionSettings,
    filter: PoseFilter,
    booking: Booking,
    registration: Option<Registration>,
    stepper: Stepper,
    valve: Valve,
    /// Movements to come, the running one first.
    queue: VecDeque<Segment>,
    /// Speed before the running movement, m/s.
    entry_speed: f64,
    course: Option<RoundedPath>,
    /// When the running movement began, s.
    began: f64,
    commanded_open: bool,
    lost_since: Option<f64>,
    /// Jumps of the pose that were said.
    restarts: usize,
    squared_error: f64,
    tracked_ticks: usize,
    log: SessionLog,
}

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
    settings: &SessionSettings,
    hand: &HandPoses,
    progress: &dyn Fn(f64),
) -> Result<SessionLog, HandheldError> {
    let mut session = Session::new(object, job, settings)?;
    let mut pose_sensor = PoseSensor::new(settings.pose_sensor, settings.seed)?;
    let mut range_sensor = RangeSensor::new(settings.range_sensor, settings.seed)?;
    let mut inertial_sensor =
        settings.inertial_sensor.map(|inertial| InertialSensor::new(inertial, settings.seed)).transpose()?;
    let true_sets = (TRUE_SETS..TRUE_SETS + 16)
        .map(|number| Droplets::new(&job.settings.spray, job.settings.deposit.droplets, number))
        .collect::<Result<Vec<_>, _>>()?;
    let dt = job.settings.deposit.step;
    let motion = hand.pose;
    let ticks = (hand.duration / dt).round() as usize;
    let per_decision = per_decision(job.settings);
    for tick in 0..ticks {
        let time = tick as f64 * dt;
        let pose = motion(time);
        let measured = pose_sensor.measure(&pose, time, dt).filter(|_| (hand.tracked)(time));
        session.filter.update(measured.as_ref(), dt);
        if let Some(sensor) = &mut inertial_sensor {
            let reading = sensor.measure(motion, time);
            session.filter.inertial(&reading.specific_force, &reading.angular_velocity);
        }
        session.booking.observe(&session.filter);
        session.note_tracking(time, &pose, measured.is_some());
        if measured.is_some() {
            session.register(&pose, &mut range_sensor, dt);
        }
        if tick % per_decision == 0 {
            session.book(tick);
            session.decide(time, device)?;
        }
        session.command_valve(time, tick);
        session.spray(time, tick, motion, &true_sets);
        if tick % 100 == 0 {
            progress(tick as f64 / ticks as f64);
        }
    }
    Ok(session.finish())
}

impl<'a> Session<'a> {
    fn new(
        object: &'a PaintObject,
        job: &'a PaintJob<'a>,
        settings: &'a SessionSettings,
    ) -> Result<Self, HandheldError> {
        let bare = object.bare()?;
        let middle = 0.5 * settings.stepper.travel;
        let registration =
            settings.registration.map(|registration| Registration::new(object.middle(), registration)).transpose()?;
        let log = SessionLog {
            ticks: Vec::new(),
            messages: Vec::new(),
            truth: bare.clone(),
            belief: bare.clone(),
            emitted: 0.0,
            decision_ms: Vec::new(),
            idle_decisions: 0,
            held_decisions: 0,
            lost_ticks: 0,
            pose_jumps: 0,
            shut_after_loss: 0.0,
            limit_hits: 0,
            valve_switches: 0,
            registration_error: 0.0,
            position_error_rms: 0.0,
            best_plan: None,
        };
        Ok(Self {
            object,
            job,
            settings,
            filter: PoseFilter::new(settings.filter)?,
            booking: Booking::new(bare, per_decision(job.settings)),
            registration,
            stepper: Stepper::new(settings.stepper, middle)?,
            valve: Valve::new(settings.valve)?,
            queue: VecDeque::new(),
            entry_speed: 0.0,
            course: None,
            began: 0.0,
            commanded_open: false,
            lost_since: None,
            restarts: 0,
            squared_error: 0.0,
            tracked_ticks: 0,
            log,
        })
    }

    fn say(&mut self, time: f64, message: String) {
        self.log.messages.push((time, message));
    }

    fn note_tracking(&mut self, time: f64, truth: &Isometry3<f64>, tracked: bool) {
        match (tracked, self.lost_since) {
            (false, None) => {
                self.lost_since = Some(time);
                self.say(time, "markers lost: valve shut, path held".into());
            }
            (true, Some(since)) => {
                self.lost_since = None;
                self.say(time, format!("markers found after {:.2} s", time - since));
            }
            _ => {}
        }
        if self.filter.restarts() > self.restarts {
            self.restarts = self.filter.restarts();
            self.say(time, "the measured pose jumped: the filter starts anew".into());
        }
        self.log.lost_ticks += usize::from(!tracked);
        if let Some(motion) = self.filter.motion().filter(|_| tracked) {
            let error = motion.world_from_robot.translation.vector - truth.translation.vector;
            self.squared_error += error.norm_squared();
            self.tracked_ticks += 1;
        }
    }

    /// Distances to the object correct where it is believed to stand.
    fn register(&mut self, truth: &Isometry3<f64>, sensor: &mut RangeSensor, dt: f64) {
        let (Some(registration), Some(motion)) = (&mut self.registration, self.filter.motion()) else { return };
        let distances = sensor.measure(&(self.settings.world_from_model.inverse() * truth), &self.object.world);
        let believed = motion.world_from_robot;
        for (k, (direction, distance)) in sensor.directions().iter().zip(distances).enumerate() {
            let origin = believed * Point3::origin();
            let reading = RangeReading { origin, direction: believed.rotation * *direction, distance };
            registration.update(&reading, &MeshSurface(&self.object.world), if k == 0 { dt } else { 0.0 });
        }
    }

    fn model_from_world(&self) -> Isometry3<f64> {
        self.registration.as_ref().map_or_else(Isometry3::identity, Registration::correction).inverse()
    }

    /// Motion of the robot as seen from the model's place; `None` while it is not known well enough to spray.
    fn motion_at_model(&self) -> Option<RobotMotion> {
        let known = self.lost_since.is_none() && self.filter.position_sigma() <= self.settings.max_position_sigma;
        let motion = self.filter.motion().filter(|_| known)?;
        let model_from_world = self.model_from_world();
        Some(RobotMotion {
            world_from_robot: model_from_world * motion.world_from_robot,
            velocity: model_from_world.rotation * motion.velocity,
            angular_velocity: model_from_world.rotation * motion.angular_velocity,
        })
    }

    /// The belief of the paint with what is known by now of where the robot was.
    fn book(&mut self, tick: usize) {
        let model_from_world = self.model_from_world();
        self.log.belief = self.booking.belief(self.job, &model_from_world, tick);
    }

    /// The next movement is decided while the running one goes on.
    fn decide(&mut self, time: f64, device: &mut dyn PaintDevice) -> Result<(), HandheldError> {
        let planner = self.job.settings.planner();
        let finished = self.queue.pop_front();
        self.entry_speed = finished.map_or(0.0, |segment| (segment.to - segment.from) / segment.duration);
        let rest = finished.map_or(self.stepper.position(), |segment| segment.to);
        let hold =
            |from: f64| Segment { layer: 0, cell: 0, speed: 0, start: 0.0, duration: planner.interval, from, to: from };
        if self.queue.is_empty() {
            self.queue.push_back(hold(rest));
        }
        self.began = time;
        match self.motion_at_model() {
            Some(motion) => self.plan(&motion, device)?,
            None => self.log.held_decisions += 1,
        }
        let mut path: Vec<Segment> = self.queue.iter().copied().collect();
        for (layer, segment) in path.iter_mut().enumerate() {
            segment.start = layer as f64 * planner.interval;
        }
        self.course = Some(RoundedPath::new(&path, self.entry_speed, self.settings.corner_acceleration)?);
        Ok(())
    }

    fn plan(&mut self, motion: &RobotMotion, device: &mut dyn PaintDevice) -> Result<(), HandheldError> {
        let job = self.job;
        let planner = job.settings.planner();
        let running = self.queue[0];
        let start = Instant::now();
        let now = Sweep {
            world_from_robot: motion.world_from_robot,
            velocity: motion.velocity,
            angular_velocity: motion.angular_velocity,
        };
        let then = Sweep { world_from_robot: now.at(running.duration), ..now };
        let expected = expected_paint(job, &self.log.belief, &now, &running);
        let mut forecast = Forecast::new(job, &expected, device, &then)?;
        let state = GantryState { position: running.to, speed: running.speed };
        let mut plan = plan_gantry(&mut forecast, state, &planner)?;
        if let Some(beam) = &job.settings.beam {
            refine(&mut plan, &mut forecast, beam)?;
        }
        forecast.check()?;
        self.log.decision_ms.push(1e3 * start.elapsed().as_secs_f64());
        self.log.idle_decisions += usize::from(plan.score <= 0.0);
        self.queue.truncate(1);
        self.queue.extend(plan.path());
        if self.log.best_plan.as_ref().is_none_or(|best| plan.score > best.score) {
            self.log.best_plan = Some(plan);
        }
        Ok(())
    }

    /// Opens the valve where the next step does good, as far as the robot knows where it is.
    fn command_valve(&mut self, time: f64, tick: usize) {
        let deposit = &self.job.settings.deposit;
        let ahead = self.settings.valve.open_delay + 0.5 * deposit.step;
        let mut open = false;
        if let (Some(motion), Some(course)) = (self.motion_at_model(), &self.course) {
            let position = course.at(time - self.began + ahead).0;
            let nozzle = self.job.settings.geometry.nozzle(&motion.after(ahead), position);
            let sets = &self.job.sets;
            let hits = StepHits::cast(self.job.surface, &nozzle, &sets[tick % sets.len()]);
            let belief = &mut self.log.belief;
            let found = hits.score(deposit.droplet(), deposit.punishment, |texel| belief.remaining(texel as usize));
            open = found.score > 0.0;
            if open {
                belief.spray(&hits, deposit.droplet());
            }
        }
        if let Some(since) = self.lost_since.filter(|_| self.commanded_open && !open) {
            self.log.shut_after_loss = self.log.shut_after_loss.max(time - since);
        }
        self.commanded_open = open;
        self.valve.command(time, open);
    }

    /// What really happens during a tick.
    fn spray(&mut self, time: f64, tick: usize, motion: &dyn Fn(f64) -> Isometry3<f64>, sets: &[Droplets]) {
        let (settings, model_from_world) = (self.job.settings, self.settings.world_from_model.inverse());
        let part = settings.deposit.step / PARTS as f64;
        let mut open = 0.0;
        let begin = self.stepper.position();
        for k in 0..PARTS {
            let (from, to) = (time + k as f64 * part, time + (k + 1) as f64 * part);
            let before = self.stepper.position();
            if let Some(course) = &self.course {
                let (position, speed) = course.at(to - self.began);
                self.stepper.step(position, speed, part);
            }
            let share = self.valve.open_share(from, to);
            open += share / PARTS as f64;
            if share == 0.0 {
                continue;
            }
            let position = 0.5 * (before + self.stepper.position());
            let nozzle = settings.geometry.nozzle(&(model_from_world * motion(0.5 * (from + to))), position);
            let hits = StepHits::cast(self.job.surface, &nozzle, &sets[(PARTS * tick + k) % sets.len()]);
            let volume = settings.deposit.flow * part * share;
            self.log.emitted += volume;
            let droplet = volume / (settings.deposit.droplets as f64 * QUANTUM);
            self.log.truth.spray(&hits, droplet.round() as u64);
        }
        if open > 0.0 {
            self.booking.sprayed(tick, 0.5 * (begin + self.stepper.position()), open);
        }
        let pose = motion(time);
        let nozzle = settings.geometry.nozzle(&pose, self.stepper.position());
        let at_model = settings.geometry.nozzle(&(model_from_world * pose), self.stepper.position());
        let hit = paint_sim::Surface::cast(&self.object.world, &at_model.origin, &at_model.axis, settings.spray.range);
        self.log.ticks.push(Tick {
            time,
            world_from_robot: pose,
            position: self.stepper.position(),
            open,
            tracked: self.lost_since.is_none(),
            hit: hit.map(|hit| nozzle.origin + nozzle.axis.into_inner() * hit.distance),
        });
    }

    fn finish(self) -> SessionLog {
        let mut log = self.log;
        let believed = self.registration.as_ref().map_or_else(Isometry3::identity, Registration::correction);
        let middle = self.object.middle();
        log.registration_error = (believed * middle - self.settings.world_from_model * middle).norm();
        log.pose_jumps = self.restarts;
        log.position_error_rms = (self.squared_error / self.tracked_ticks.max(1) as f64).sqrt();
        log.limit_hits = self.stepper.limit_hits;
        log.valve_switches = self.valve.switched;
        log
    }
}

/// Ticks from one decision to the next.
fn per_decision(settings: &HandheldSettings) -> usize {
    ((settings.planner.interval / settings.deposit.step).round() as usize).max(1)
}

/// The paint after the running movement, as it is expected to go.
fn expected_paint(job: &PaintJob, belief: &Coverage, sweep: &Sweep, running: &Segment) -> Coverage {
    let (mut expected, deposit) = (belief.clone(), &job.settings.deposit);
    let steps = (running.duration / deposit.step).round() as usize;
    for k in 0..steps {
        let share = (k as f64 + 0.5) / steps as f64;
        let position = running.from + share * (running.to - running.from);
        let nozzle = job.settings.geometry.nozzle(&sweep.at(share * running.duration), position);
        let hits = StepHits::cast(job.surface, &nozzle, &job.sets[k % job.sets.len()]);
        let found = hits.score(deposit.droplet(), deposit.punishment, |texel| expected.remaining(texel as usize));
        if found.score > 0.0 {
            expected.spray(&hits, deposit.droplet());
        }
    }
    expected
}
