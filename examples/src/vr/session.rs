//! A session without a network: events in, paint, plans and notices out. It knows no clock but that of the events.

use std::collections::VecDeque;
use std::path::PathBuf;

use nalgebra::Point3;
use nalgebra::UnitVector3;
use paint_planner::session::{
    Feedback, LagIndicator, LiveQueue, QueueCounts, RATE, ResampleCounts, Resampler, Task, VrMode, VrState,
};
use paint_sim::Shot;

use super::canvas::{Canvas, Patch};
use super::counters::SessionCounts;
use super::error::VrError;
use super::event::{Command, Event};
use super::latency::LatencyCurves;
use super::message::Notice;
use super::recording::{PlanMark, SessionRecorder};
use super::settings::VrSettings;
use super::strokes::Strokes;
use super::vehicle::{PlannedTask, Vehicle, VehicleView, stand_off};
use super::world::VrWorld;

/// Ticks between two entries of the latency curve and of the recorded flight.
const CURVE_STRIDE: u64 = 9;
/// Way of the cradle after which the robot is asked once more to come, m.
const SOUGHT: f64 = 0.1;
/// Longest time that the vehicle is given to finish after the last event, s.
const LONGEST_FINISH: f64 = 3600.0;

/// What became of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handled {
    /// It is part of the session.
    Done,
    /// It already was.
    Repeated,
    /// Events before it are missing: send them again.
    Gap,
    /// It was refused, and counts as done.
    Refused,
    /// The person wants the results, and whether the session is over.
    Results {
        /// Whether it is.
        end: bool,
    },
}

/// One person's session on one surface.
pub struct Session {
    settings: VrSettings,
    world: VrWorld,
    clock: Resampler,
    queue: LiveQueue,
    vehicle: Vehicle,
    lag: LagIndicator,
    live: bool,
    /// The latest tick before a pause: all that the recording knows of the hand until it ends.
    paused: Option<VrState>,
    /// Paint as the person sees it, and as the robot has sprayed it.
    seen: Canvas,
    flown: Canvas,
    /// What was painted while the robot did not follow.
    strokes: Strokes,
    tasks: VecDeque<Task>,
    next_sequence: u64,
    /// Time of the latest state on the page's clock, s.
    page_time: f64,
    /// Where the person was when the robot was last asked to come.
    sought: Option<Point3<f64>>,
    last_tick: Option<VrState>,
    too_far: bool,
    notices: Vec<Notice>,
    curves: LatencyCurves,
    /// Once it is finished: how far the robot was behind at the last state, m, and how long it flew on, s.
    behind: Option<[f64; 2]>,
    plans: Vec<PlanMark>,
    counts: SessionCounts,
    recorder: Option<SessionRecorder>,
}

impl Session {
    /// A bare surface and a robot at rest. `recorder` keeps the events and plans.
    ///
    /// # Errors
    /// A world without texels.
    pub fn new(settings: VrSettings, world: VrWorld, recorder: Option<SessionRecorder>) -> Result<Self, VrError> {
        Ok(Self {
            clock: Resampler::new(settings.session.clone()),
            queue: LiveQueue::new(settings.session.clone()),
            vehicle: Vehicle::new(&world),
            lag: LagIndicator::default(),
            live: settings.live,
            paused: None,
            seen: Canvas::new(&world)?,
            flown: Canvas::new(&world)?,
            strokes: Strokes::default(),
            tasks: VecDeque::new(),
            next_sequence: 0,
            page_time: 0.0,
            sought: None,
            last_tick: None,
            too_far: false,
            notices: Vec::new(),
            curves: LatencyCurves::default(),
            behind: None,
            plans: Vec::new(),
            counts: SessionCounts::default(),
            recorder,
            settings,
            world,
        })
    }

    /// Takes an event. The same events give the same session, whenever they come.
    ///
    /// # Errors
    /// A recording that cannot be written, or a flight that leaves its plan.
    pub fn handle(&mut self, event: &Event) -> Result<Handled, VrError> {
        if event.sequence() < self.next_sequence {
            self.counts.repeated += 1;
            return Ok(Handled::Repeated);
        }
        if event.sequence() > self.next_sequence {
            self.counts.gaps += 1;
            return Ok(Handled::Gap);
        }
        self.next_sequence += 1;
        if let Err(error) = event.check() {
            self.counts.refused += 1;
            self.say(error.to_string());
            return Ok(Handled::Refused);
        }
        self.counts.events += 1;
        let event = &self.without_hand(event);
        let time = self.time();
        if let Some(recorder) = &mut self.recorder {
            recorder.event(time, event)?;
        }
        match event {
            Event::State(state) => self.state(*state)?,
            Event::Command { command, .. } => return self.command(*command),
        }
        Ok(Handled::Done)
    }

    /// While the session is paused a state is only the clock: the hand rests where it was.
    fn without_hand(&self, event: &Event) -> Event {
        match (event, &self.paused) {
            (Event::State(state), Some(held)) => {
                let (nozzle, cradle) = (held.nozzle, held.cradle);
                Event::State(VrState { mode: VrMode::Idle, hit: None, nozzle, cradle, ..*state })
            }
            _ => *event,
        }
    }

    /// Sequence number of the event that is expected next.
    pub fn next_sequence(&self) -> u64 {
        self.next_sequence
    }

    /// Time of the latest state on the page's clock, s.
    pub(super) fn clock(&self) -> f64 {
        self.page_time
    }

    /// Time of the session, s: that of its latest tick.
    pub fn time(&self) -> f64 {
        self.last_tick.map_or(0.0, |tick| tick.time)
    }

    /// Lets the vehicle finish everything, painted while it followed or not.
    ///
    /// # Errors
    /// As [`Session::handle`].
    pub fn finish(&mut self) -> Result<(), VrError> {
        let Some(last) = self.last_tick else { return Ok(()) };
        self.fly_strokes();
        let (lag, end) = (self.lag(), last.time + LONGEST_FINISH);
        let mut tick = VrState { mode: VrMode::Idle, hit: None, ..last };
        while !(self.queue.is_empty() && self.tasks.is_empty() && self.vehicle.is_free()) && tick.time < end {
            tick.sequence += 1;
            tick.time = tick.sequence as f64 / RATE;
            self.tick(tick)?;
        }
        self.behind = Some([if self.live { lag } else { 0.0 }, self.time() - last.time]);
        if let Some(recorder) = self.recorder.take() {
            recorder.finish()?;
        }
        // The pictures show what has been flown now.
        self.take_patches();
        Ok(())
    }

    /// Makes the recording so far a whole file, and goes on recording; its path, where there is a recording.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub(super) fn save_recording(&mut self) -> Result<Option<PathBuf>, VrError> {
        self.recorder.as_mut().map(SessionRecorder::save).transpose()
    }

    /// What the person is to be told since the last call.
    pub fn take_notices(&mut self) -> Vec<Notice> {
        let feedback = self.queue.take_feedback();
        self.notices.extend(feedback.into_iter().map(Notice::Feedback));
        std::mem::take(&mut self.notices)
    }

    /// Changed parts of the two pictures: what the person sees, what the robot has sprayed.
    pub(super) fn take_patches(&mut self) -> [Option<Patch>; 2] {
        [0, 1].map(|number| self.take_patch(number))
    }

    /// The same of one of them.
    pub(super) fn take_patch(&mut self, number: usize) -> Option<Patch> {
        let canvas = if number == 0 { &mut self.seen } else { &mut self.flown };
        canvas.take_patch(&self.world)
    }

    pub(super) fn canvases(&self) -> [&Canvas; 2] {
        [&self.seen, &self.flown]
    }

    pub(super) fn world(&self) -> &VrWorld {
        &self.world
    }

    pub(super) fn settings(&self) -> &VrSettings {
        &self.settings
    }

    pub(super) fn vehicle(&self) -> &VehicleView {
        self.vehicle.view()
    }

    pub(super) fn is_live(&self) -> bool {
        self.live
    }

    pub(super) fn is_paused(&self) -> bool {
        self.paused.is_some()
    }

    pub(super) fn is_waiting(&self) -> bool {
        self.queue.is_waiting()
    }

    /// Latency in distance now, m.
    pub(super) fn lag(&self) -> f64 {
        (self.queue.painted_length() - self.vehicle.painted_length()).max(0.0)
    }

    /// How far the robot was behind at the last state, m (0 where it does not follow), and how long it flew on after it, s; `None` before
    /// [`Session::finish`].
    pub(super) fn behind(&self) -> Option<[f64; 2]> {
        self.behind
    }

    /// Latencies so far.
    pub fn curves(&self) -> &LatencyCurves {
        &self.curves
    }

    /// Every plan so far.
    pub(super) fn plans(&self) -> &[PlanMark] {
        &self.plans
    }

    pub(super) fn counts(&self) -> (SessionCounts, QueueCounts, ResampleCounts) {
        (self.counts, self.queue.counts(), self.clock.counts())
    }

    fn state(&mut self, state: VrState) -> Result<(), VrError> {
        // The page's own hit is only what it draws; what counts is where the gun's ray meets the true surface.
        let hit = (state.mode == VrMode::Painting).then(|| self.world.hit(&state.nozzle)).flatten();
        let colour = state.colour.min(self.world.palette.len() as u8 - 1);
        self.page_time = self.page_time.max(state.time);
        let mut ticks = Vec::new();
        self.clock.push(VrState { hit, colour, ..state }, &mut ticks);
        ticks.into_iter().try_for_each(|tick| self.tick(tick))
    }

    fn tick(&mut self, tick: VrState) -> Result<(), VrError> {
        self.last_tick = Some(tick);
        let painted = if self.live { self.push_live(tick) } else { self.push_offline(tick) };
        if painted {
            let shot: Vec<Shot> = preview(&tick).into_iter().collect();
            let spray = self.settings.spray();
            self.seen.spray(tick.colour, &shot, &spray, &self.world.surface.world)?;
        }
        self.start_tasks(tick.time)?;
        let (colour, shots) = self.vehicle.advance(tick.time);
        if !shots.is_empty() {
            self.flown.spray(colour, &shots, &self.settings.spray(), &self.world.surface.world)?;
        }
        self.measure(&tick)
    }

    /// Whether the state paints: not while the person has to wait, nor from too far away.
    fn push_live(&mut self, tick: VrState) -> bool {
        let before = self.queue.counts().accepted;
        self.queue.push(tick);
        let accepted = self.queue.counts().accepted > before;
        accepted && tick.hit.is_some_and(|hit| self.near(&tick, &hit.point))
    }

    fn push_offline(&mut self, tick: VrState) -> bool {
        let Some(hit) = tick.hit.filter(|_| tick.mode == VrMode::Painting) else {
            self.strokes.rest(tick);
            self.too_far = false;
            return false;
        };
        let near = self.near(&tick, &hit.point);
        if near {
            self.strokes.paint(tick);
        } else if !self.too_far {
            let distance = (hit.point - tick.nozzle_position()).norm();
            self.notices.push(Notice::Feedback(Feedback::MoveCloser { distance }));
        }
        self.too_far = !near;
        near
    }

    fn near(&self, tick: &VrState, hit: &Point3<f64>) -> bool {
        (hit - tick.nozzle_position()).norm() < self.settings.session.far
    }

    /// Gives the vehicle its next task when it is free: first what was painted offline, then what the queue has. While it paints live
    /// it is given the next piece of the stroke before it halts.
    fn start_tasks(&mut self, now: f64) -> Result<(), VrError> {
        if self.tasks.is_empty() && self.vehicle.is_continuable(now) {
            let position = self.vehicle.position();
            if let Some(segment) = self.queue.next_continuation(now, &position) {
                if let Some(planned) = self.vehicle.go_on(&segment, now, &self.world, &self.settings)? {
                    self.counts.continued += 1;
                    self.planned(&planned)?;
                } else {
                    self.queue.give_back(segment);
                    self.vehicle.let_halt();
                }
            }
        }
        while self.vehicle.is_free() {
            let position = self.vehicle.position();
            let Some(task) = self.tasks.pop_front().or_else(|| self.queue.next_task(now, &position)) else { break };
            if let Task::Seek(state) = &task {
                // Where the robot could not come to the person it is not asked again until the person has moved.
                let here = state.cradle.position;
                if self.sought.is_some_and(|sought| (sought - here).norm() < SOUGHT) {
                    continue;
                }
                self.sought = Some(here);
            }
            if let Some(planned) = self.vehicle.begin(&task, now, &self.world, &self.settings)? {
                self.planned(&planned)?;
                self.sought = self.sought.filter(|_| planned.kind == "seek");
            }
        }
        Ok(())
    }

    fn planned(&mut self, planned: &PlannedTask) -> Result<(), VrError> {
        self.counts.plans += 1;
        self.curves.planning.push(planned.seconds);
        if planned.kind == "paint" {
            self.counts.paint_tasks += 1;
            self.counts.targets += planned.targets[0] as u64;
            self.counts.targets_served += planned.targets[1] as u64;
        }
        self.curves.time.extend(planned.latency.filter(|_| self.live).map(|latency| (planned.time, latency)));
        if let Some(why) = &planned.refused {
            self.counts.refused_tasks += 1;
            self.counts.refused_paint += u64::from(planned.kind == "paint");
            self.say(format!("the robot cannot {} here: {why}", planned.kind));
        }
        let mark = PlanMark::of(planned);
        if let Some(recorder) = &mut self.recorder {
            recorder.plan(planned, &mark)?;
        }
        self.plans.push(mark);
        Ok(())
    }

    fn measure(&mut self, tick: &VrState) -> Result<(), VrError> {
        let lag = self.lag();
        if let Some(feedback) = self.lag.update(lag, &self.settings.session).filter(|_| self.live) {
            self.notices.push(Notice::Feedback(feedback));
        }
        if tick.sequence.is_multiple_of(CURVE_STRIDE) {
            if self.live && (tick.mode == VrMode::Painting || lag > 0.0) {
                self.curves.distance.push((tick.time, lag));
            }
            if let Some(recorder) = &mut self.recorder {
                recorder.vehicle(tick.time, self.vehicle.view())?;
            }
        }
        Ok(())
    }

    fn command(&mut self, command: Command) -> Result<Handled, VrError> {
        match command {
            Command::Live { on } => self.live = on,
            Command::Pause { on } => self.pause(on),
            Command::Undo => self.undo()?,
            Command::Erase { point, radius } => {
                let erased = self.strokes.erase(&point, radius);
                self.withdraw(&erased)?;
            }
            Command::Fly => self.fly_strokes(),
            Command::Save => return Ok(Handled::Results { end: false }),
            Command::End => return Ok(Handled::Results { end: true }),
        }
        Ok(Handled::Done)
    }

    fn pause(&mut self, on: bool) {
        // Before the first state there is no hand to hold still, and nothing to leave out.
        self.paused = self.last_tick.filter(|_| on);
    }

    fn undo(&mut self) -> Result<(), VrError> {
        let stroke = self.strokes.undo();
        if stroke.is_empty() {
            self.say("nothing to take back: what the robot follows at once is on the wall".into());
        }
        self.withdraw(&stroke)
    }

    fn withdraw(&mut self, states: &[VrState]) -> Result<(), VrError> {
        self.counts.taken_back += states.len() as u64;
        let spray = self.settings.spray();
        for of_one_colour in states.chunk_by(|a, b| a.colour == b.colour) {
            let shots: Vec<Shot> = of_one_colour.iter().filter_map(preview).collect();
            self.seen.withdraw(of_one_colour[0].colour, &shots, &spray, &self.world.surface.world)?;
        }
        Ok(())
    }

    fn fly_strokes(&mut self) {
        self.tasks.extend(self.strokes.take(&self.settings.session).into_iter().map(Task::Segment));
    }

    fn say(&mut self, text: String) {
        self.notices.push(Notice::Text { text });
    }
}

/// The paint of one tick as the robot will spray it: along the normal, from the gun's distance within what the robot keeps.
fn preview(tick: &VrState) -> Option<Shot> {
    let hit = tick.hit?;
    let axis = UnitVector3::new_unchecked(-hit.normal.into_inner());
    let origin = hit.point + hit.normal.into_inner() * stand_off(tick);
    Some(Shot { origin, axis, volume: tick.flow / RATE })
}
