//! The on-board program: poses a hundred times a second, a decision ten times a second (handheld paper, Section VI-B, Fig. 3).

use std::collections::VecDeque;

use nalgebra::{Isometry3, Point3, Vector3};

use super::beam::{BeamSettings, refine};
use super::deposit_estimate::DepositEstimate;
use super::lattice::{GantryState, Segment};
use super::model::DepositModel;
use super::plan::{GantryPlan, plan_gantry};
use super::pose_filter::{PoseFilter, PoseFilterSettings};
use super::registration::{RangeReading, Registration, RegistrationSettings};
use super::robot_motion::RobotMotion;
use super::rounded_path::RoundedPath;
use super::settings::GantrySettings;
use crate::error::{Error, ensure};

/// Numbers of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ControllerSettings {
    /// Time from one frame to the next, s (default 0.01); the interval of the decisions is a whole number of frames.
    pub step: f64,
    /// Lattice, horizon and flux of the decisions.
    pub planner: GantrySettings,
    /// Simulated candidates; `None` (default) takes the graph's best path as it is.
    pub beam: Option<BeamSettings>,
    /// What is believed of the sensors and of the hand.
    pub filter: PoseFilterSettings,
    /// Largest standard deviation of the believed place at which the valve may open, m (default 1.2 mm).
    pub max_position_sigma: f64,
    /// Correction of the object's place by measured distances; `None` believes the model.
    pub registration: Option<RegistrationSettings>,
    /// Acceleration of the rounded corners, m/s^2 (default 5).
    pub corner_acceleration: f64,
    /// Time from a command to an open valve, s (default 4 ms).
    pub valve_delay: f64,
}

impl Default for ControllerSettings {
    fn default() -> Self {
        Self {
            step: 0.01,
            planner: GantrySettings::default(),
            beam: None,
            filter: PoseFilterSettings::default(),
            max_position_sigma: 1.2e-3,
            registration: Some(RegistrationSettings::default()),
            corner_acceleration: 5.0,
            valve_delay: 4e-3,
        }
    }
}

/// What an inertial sensor at the robot's origin says, in the robot's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertialSample {
    /// Specific force, m/s^2: upwards at rest.
    pub specific_force: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
}

/// What the sensors say at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<'a> {
    /// Seconds since the start; frames come every [`ControllerSettings::step`].
    pub time: f64,
    /// Measured pose; `None` while the markers are lost.
    pub world_from_robot: Option<Isometry3<f64>>,
    /// Inertial sensor, where there is one.
    pub inertial: Option<InertialSample>,
    /// Measured distances to the object, origin and direction in the robot's frame; unused without a pose.
    pub ranges: &'a [RangeReading],
    /// Position of the nozzle on its slide, m, as its motor counts.
    pub position: f64,
    /// Share of the time since the last frame in which paint flew.
    pub sprayed: f64,
}

/// Where the slide shall be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlideSetpoint {
    /// Position along the gantry, m.
    pub position: f64,
    /// Velocity, m/s.
    pub velocity: f64,
}

/// What happened in a frame.
#[derive(Debug)]
pub enum Event {
    /// The markers are lost: the valve shuts, the path is held.
    TrackingLost,
    /// The markers are there again after so many seconds.
    TrackingFound {
        /// How long they were lost, s.
        after: f64,
    },
    /// The measured pose was so far from the expected one that the filter began anew.
    PoseJumped,
    /// A path was decided on.
    Decided(Box<GantryPlan>),
    /// A decision fell out because the place of the robot is not known well enough; the old path goes on, and then the nozzle rests.
    Held,
}

/// What the robot shall do until the next frame.
#[derive(Debug)]
pub struct Command {
    /// Whether the valve shall be open.
    pub valve_open: bool,
    /// Where the slide shall be at the next frame; see [`Controller::slide_at`] for the way there.
    pub slide: SlideSetpoint,
    /// What happened, in order.
    pub events: Vec<Event>,
}

/// The robot's program while a person sweeps it past the object. It knows no clock but that of its frames.
pub struct Controller<M: DepositModel> {
    settings: ControllerSettings,
    model: M,
    filter: PoseFilter,
    registration: Option<Registration>,
    estimate: DepositEstimate<M>,
    /// The paint as it is believed to be.
    deposit: M::Deposit,
    /// Movements to come, the running one first, and the way of the nozzle along them since `began` (s).
    queue: VecDeque<Segment>,
    course: Option<RoundedPath>,
    began: f64,
    lost_since: Option<f64>,
    /// Frames so far, and the position of the nozzle at the last one, m.
    frames: usize,
    position: f64,
}

impl<M: DepositModel> Controller<M> {
    /// Before an object with the paint `deposit` on it; `middle` is a point in it, m, about which its place is corrected.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn new(
        settings: ControllerSettings,
        model: M,
        deposit: M::Deposit,
        middle: Point3<f64>,
    ) -> Result<Self, Error> {
        settings.planner.check()?;
        for (name, value) in
            [("controller.step", settings.step), ("controller.corner_acceleration", settings.corner_acceleration)]
        {
            ensure(name, value, value.is_finite() && value > 0.0, "finite and greater than 0")?;
        }
        for (name, value) in [
            ("controller.max_position_sigma", settings.max_position_sigma),
            ("controller.valve_delay", settings.valve_delay),
        ] {
            ensure(name, value, value >= 0.0, "not negative")?;
        }
        Ok(Self {
            filter: PoseFilter::new(settings.filter)?,
            registration: settings
                .registration
                .map(|registration| Registration::new(middle, registration))
                .transpose()?,
            estimate: DepositEstimate::new(deposit.clone(), settings.step, settings.frames_per_decision()),
            deposit,
            queue: VecDeque::new(),
            course: None,
            began: 0.0,
            lost_since: None,
            frames: 0,
            position: 0.0,
            settings,
            model,
        })
    }

    /// Takes in what the sensors say and decides what the robot does until the next frame.
    ///
    /// # Errors
    /// [`Error::Frame`] for numbers that no sensor gives; what the model cannot compute. The frame is lost then, and the valve is to be shut.
    pub fn frame(&mut self, frame: &Frame) -> Result<Command, M::Error> {
        frame.check()?;
        let mut events = Vec::new();
        if frame.sprayed > 0.0 && self.frames > 0 {
            self.estimate.sprayed(self.frames - 1, 0.5 * (self.position + frame.position), frame.sprayed);
        }
        self.localise(frame, &mut events);
        if self.frames.is_multiple_of(self.settings.frames_per_decision()) {
            self.deposit = self.estimate.estimate(&self.model, &self.object_place().inverse(), self.frames);
            events.push(self.decide(frame)?);
        }
        let valve_open = self.valve(frame.time);
        self.frames += 1;
        self.position = frame.position;
        Ok(Command { valve_open, slide: self.slide_at(frame.time + self.settings.step), events })
    }

    /// Where the slide shall be at a time (s) between this frame and the next.
    pub fn slide_at(&self, time: f64) -> SlideSetpoint {
        let at = |course: &RoundedPath| course.at(time - self.began);
        let (position, velocity) = self.course.as_ref().map_or((self.position, 0.0), at);
        SlideSetpoint { position, velocity }
    }

    /// The motion of the robot as it is believed to be; `None` before the first pose.
    pub fn motion(&self) -> Option<&RobotMotion> {
        self.filter.motion()
    }

    /// The motion that takes the object from the place of its model to where it is believed to stand.
    pub fn object_place(&self) -> Isometry3<f64> {
        self.registration.as_ref().map_or_else(Isometry3::identity, Registration::correction)
    }

    /// The paint as it is believed to be.
    pub fn deposit(&self) -> &M::Deposit {
        &self.deposit
    }

    /// Pose of the robot, and by measured distances that of the object.
    fn localise(&mut self, frame: &Frame, events: &mut Vec<Event>) {
        let restarts = self.filter.restarts();
        self.filter.update(frame.world_from_robot.as_ref(), self.settings.step);
        if let Some(InertialSample { specific_force, angular_velocity }) = &frame.inertial {
            self.filter.inertial(specific_force, angular_velocity);
        }
        self.estimate.observe(&self.filter);
        match (frame.world_from_robot, self.lost_since) {
            (None, None) => {
                self.lost_since = Some(frame.time);
                events.push(Event::TrackingLost);
            }
            (Some(_), Some(since)) => {
                self.lost_since = None;
                events.push(Event::TrackingFound { after: frame.time - since });
            }
            _ => {}
        }
        if self.filter.restarts() > restarts {
            events.push(Event::PoseJumped);
        }
        let (Some(registration), Some(motion), None) = (&mut self.registration, self.filter.motion(), self.lost_since)
        else {
            return;
        };
        let believed = motion.world_from_robot;
        for (k, reading) in frame.ranges.iter().enumerate() {
            let (origin, direction) = (believed * reading.origin, believed.rotation * reading.direction);
            let in_world = RangeReading { origin, direction, ..*reading };
            registration.update(&in_world, self.model.surface(), if k == 0 { self.settings.step } else { 0.0 });
        }
    }

    /// Motion of the robot as seen from the model's place; `None` while it is not known well enough to spray.
    fn motion_at_model(&self) -> Option<RobotMotion> {
        let known = self.lost_since.is_none() && self.filter.position_sigma() <= self.settings.max_position_sigma;
        let motion = self.filter.motion().filter(|_| known)?;
        let model_from_world = self.object_place().inverse();
        Some(RobotMotion {
            world_from_robot: model_from_world * motion.world_from_robot,
            velocity: model_from_world.rotation * motion.velocity,
            angular_velocity: model_from_world.rotation * motion.angular_velocity,
        })
    }

    /// The next movement is decided while the running one goes on.
    fn decide(&mut self, frame: &Frame) -> Result<Event, M::Error> {
        let finished = self.queue.pop_front();
        let entry_speed = finished.map_or(0.0, |segment| (segment.to - segment.from) / segment.duration);
        let rest = finished.map_or(frame.position, |segment| segment.to);
        let interval = self.settings.planner.interval;
        if self.queue.is_empty() {
            let still = Segment { layer: 0, cell: 0, speed: 0, start: 0.0, duration: interval, from: rest, to: rest };
            self.queue.push_back(still);
        }
        self.began = frame.time;
        let event = match self.motion_at_model() {
            Some(motion) => {
                let plan = self.plan(&motion)?;
                self.queue.truncate(1);
                self.queue.extend(plan.path());
                Event::Decided(Box::new(plan))
            }
            None => Event::Held,
        };
        let timed = |(k, segment): (usize, &Segment)| Segment { start: k as f64 * interval, ..*segment };
        let path: Vec<Segment> = self.queue.iter().enumerate().map(timed).collect();
        self.course = Some(RoundedPath::new(&path, entry_speed, self.settings.corner_acceleration)?);
        Ok(event)
    }

    /// Plans from the end of the running movement.
    fn plan(&mut self, motion: &RobotMotion) -> Result<GantryPlan, M::Error> {
        let running = self.queue[0];
        let then = RobotMotion { world_from_robot: motion.after(running.duration), ..*motion };
        let expected = self.expected_deposit(motion, &running);
        let state = GantryState { position: running.to, speed: running.speed };
        let Self { model, settings: ControllerSettings { planner, beam, .. }, .. } = self;
        model.forecast(&expected, &then, |forecast| {
            let mut plan = plan_gantry(forecast, state, planner)?;
            if let Some(beam) = beam {
                refine(&mut plan, forecast, beam)?;
            }
            Ok(plan)
        })
    }

    /// The paint after the running movement, as it is expected to go.
    fn expected_deposit(&self, motion: &RobotMotion, running: &Segment) -> M::Deposit {
        let mut expected = self.deposit.clone();
        let steps = (running.duration / self.settings.step).round() as usize;
        for k in 0..steps {
            let share = (k as f64 + 0.5) / steps as f64;
            let position = running.from + share * (running.to - running.from);
            let footprint = self.model.footprint(&motion.after(share * running.duration), position, k);
            if self.model.score(&footprint, &expected) > 0.0 {
                self.model.spray(&footprint, 1.0, &mut expected);
            }
        }
        expected
    }

    /// Opens the valve where the next step does good, as far as the robot knows where it is.
    fn valve(&mut self, time: f64) -> bool {
        let (Some(motion), Some(course)) = (self.motion_at_model(), &self.course) else { return false };
        let ahead = self.settings.valve_delay + 0.5 * self.settings.step;
        let (position, _) = course.at(time - self.began + ahead);
        let footprint = self.model.footprint(&motion.after(ahead), position, self.frames);
        let open = self.model.score(&footprint, &self.deposit) > 0.0; // handheld paper, Eqs. (6), (7)
        if open {
            self.model.spray(&footprint, 1.0, &mut self.deposit);
        }
        open
    }
}

impl ControllerSettings {
    /// Frames from one decision to the next.
    fn frames_per_decision(&self) -> usize {
        ((self.planner.interval / self.step).round() as usize).max(1)
    }
}

impl Frame<'_> {
    fn check(&self) -> Result<(), Error> {
        let refuse = |what| Err(Error::Frame { time: self.time, what });
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
        let posed = |pose: &Isometry3<f64>| {
            finite(&pose.translation.vector) && pose.rotation.coords.iter().all(|c| c.is_finite())
        };
        if !self.time.is_finite() || !self.position.is_finite() {
            return refuse("`time` and `position` must be finite");
        }
        if !self.world_from_robot.as_ref().is_none_or(posed) {
            return refuse("`world_from_robot` must be finite: give `None` where no pose is measured");
        }
        if self.inertial.is_some_and(|sample| !finite(&sample.specific_force) || !finite(&sample.angular_velocity)) {
            return refuse("`inertial` must be finite");
        }
        if !(0.0..=1.0).contains(&self.sprayed) {
            return refuse("`sprayed` is a share from 0 to 1");
        }
        Ok(())
    }
}
