//! A session with a vehicle: states in, flights out.

use std::collections::VecDeque;

use nalgebra::Point3;

use super::feedback::Feedback;
use super::lag::LagIndicator;
use super::live::{LiveQueue, QueueCounts};
use super::pilot::{Pilot, PlannedTask};
use super::scene::TeleopScene;
use super::settings::TeleopSettings;
use super::state::{VrMode, VrState};
use super::strokes::Strokes;
use super::task::Task;
use super::vehicle::Vehicle;
use crate::world::VehicleState;

/// Way of the cradle after which the vehicle is asked once more to come, m.
const SOUGHT: f64 = 0.1;

/// Teleoperation of one vehicle by one person. While it is live, the vehicle follows the hand; otherwise strokes are kept, can be taken
/// back, and are flown when the person says so.
///
/// For every tick of a [`Resampler`](super::Resampler): [`push`](Self::push) the state, [`step`](Self::step) until there is no task,
/// let the vehicle move, and [`advance`](Self::advance).
#[derive(Debug, Clone)]
pub struct Teleop {
    settings: TeleopSettings,
    live: bool,
    queue: LiveQueue,
    /// What was painted while the vehicle does not follow, and what of it is to be flown.
    strokes: Strokes,
    tasks: VecDeque<Task>,
    pilot: Pilot,
    lag: LagIndicator,
    /// Where the person was when the vehicle was last asked to come.
    sought: Option<Point3<f64>>,
    /// Whether the last stroke that is kept was refused for its distance.
    too_far: bool,
    feedback: Vec<Feedback>,
}

impl Teleop {
    /// A vehicle at rest at `home`, which follows.
    pub fn new(settings: TeleopSettings, home: VehicleState) -> Self {
        Self {
            live: true,
            queue: LiveQueue::new(settings.session.clone()),
            strokes: Strokes::default(),
            tasks: VecDeque::new(),
            pilot: Pilot::new(home),
            lag: LagIndicator::default(),
            sought: None,
            too_far: false,
            feedback: Vec::new(),
            settings,
        }
    }

    /// Takes a state; whether it paints: not while the person has to wait, nor from too far away.
    pub fn push(&mut self, tick: VrState) -> bool {
        if self.live { self.push_live(tick) } else { self.push_kept(tick) }
    }

    fn push_live(&mut self, tick: VrState) -> bool {
        let before = self.queue.counts().accepted;
        self.queue.push(tick);
        let accepted = self.queue.counts().accepted > before;
        accepted && tick.hit.is_some_and(|hit| self.is_near(&tick, &hit.point))
    }

    fn push_kept(&mut self, tick: VrState) -> bool {
        let Some(hit) = tick.hit.filter(|_| tick.mode == VrMode::Painting) else {
            self.strokes.rest(tick);
            self.too_far = false;
            return false;
        };
        let near = self.is_near(&tick, &hit.point);
        if near {
            self.strokes.paint(tick);
        } else if !self.too_far {
            let distance = (hit.point - tick.nozzle_position()).norm();
            self.feedback.push(Feedback::MoveCloser { distance });
        }
        self.too_far = !near;
        near
    }

    fn is_near(&self, tick: &VrState, hit: &Point3<f64>) -> bool {
        (hit - tick.nozzle_position()).norm() < self.settings.session.far
    }

    /// Gives the vehicle its next task when it is free: first what was kept, then what the queue has. While it paints live it is given
    /// the next piece of the stroke before it halts. `None` where there is nothing more to do now; to be called until then.
    ///
    /// # Errors
    /// The vehicle's.
    pub fn step<V: Vehicle>(
        &mut self,
        now: f64,
        scene: &TeleopScene,
        vehicle: &mut V,
    ) -> Result<Option<PlannedTask>, V::Error> {
        if self.tasks.is_empty()
            && self.pilot.is_continuable(now, &self.settings)
            && let Some(segment) = self.queue.next_continuation(now, &vehicle.position())
        {
            if let Some(planned) = self.pilot.go_on(&segment, now, scene, &self.settings, vehicle)? {
                return Ok(Some(planned));
            }
            self.queue.give_back(segment);
            self.pilot.let_halt();
        }
        while self.pilot.is_free() {
            let next = self.tasks.pop_front().or_else(|| self.queue.next_task(now, &vehicle.position()));
            let Some(task) = next else { break };
            if let Task::Seek(state) = &task {
                // Where the vehicle could not come to the person it is not asked again until the person has moved.
                let here = state.cradle.position;
                if self.sought.is_some_and(|sought| (sought - here).norm() < SOUGHT) {
                    continue;
                }
                self.sought = Some(here);
            }
            if let Some(planned) = self.pilot.begin(&task, now, scene, &self.settings, vehicle)? {
                self.sought = self.sought.filter(|_| matches!(task, Task::Seek(_)));
                return Ok(Some(planned));
            }
        }
        Ok(None)
    }

    /// The flights have gone on until `now`, s on the session's clock.
    pub fn advance<V: Vehicle>(&mut self, now: f64, vehicle: &V) {
        self.pilot.advance(now, vehicle);
        let changed = self.lag.update(self.lag(), &self.settings.session);
        self.feedback.extend(changed.filter(|_| self.live));
    }

    /// Whether the vehicle follows at once from now on.
    pub fn set_live(&mut self, live: bool) {
        self.live = live;
    }

    /// Whether it does.
    pub fn is_live(&self) -> bool {
        self.live
    }

    /// Takes back the last stroke that was kept, from its press to its release; empty where there is none.
    pub fn undo(&mut self) -> Vec<VrState> {
        self.strokes.undo()
    }

    /// Takes back what was kept within a radius of a point, m.
    pub fn erase(&mut self, point: &Point3<f64>, radius: f64) -> Vec<VrState> {
        self.strokes.erase(point, radius)
    }

    /// Flies what was kept.
    pub fn fly_strokes(&mut self) {
        self.tasks.extend(self.strokes.take(&self.settings.session).into_iter().map(Task::Segment));
    }

    /// Whether there is nothing to fly, and nothing is flown.
    pub fn is_done(&self) -> bool {
        self.queue.is_empty() && self.tasks.is_empty() && self.pilot.is_free()
    }

    /// Latency in distance now, m: what the nozzle lacks of what the hand has painted live.
    pub fn lag(&self) -> f64 {
        (self.queue.painted_length() - self.pilot.painted_length()).max(0.0)
    }

    /// Whether states are refused until the vehicle has caught up, rule (e).
    pub fn is_waiting(&self) -> bool {
        self.queue.is_waiting()
    }

    /// What the person is to be told since the last call.
    pub fn take_feedback(&mut self) -> Vec<Feedback> {
        self.feedback.append(&mut self.queue.take_feedback());
        std::mem::take(&mut self.feedback)
    }

    /// What became of the states in the queue so far.
    pub fn counts(&self) -> QueueCounts {
        self.queue.counts()
    }

    /// What it was made with.
    pub fn settings(&self) -> &TeleopSettings {
        &self.settings
    }
}
