//! A session without a network: events in, paint, plans and notices out. It knows no clock but that of the events.

use std::path::PathBuf;
use std::time::Instant;

use nalgebra::UnitVector3;
use paint_planner::teleop::{
    PlannedTask, QueueCounts, RATE, ResampleCounts, Resampler, TaskKind, Teleop, TeleopScene, VrMode, VrState,
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
use super::simulated_vehicle::{SimulatedVehicle, VehicleView};
use super::world::VrWorld;
use crate::adapters::MeshSurface;

/// Ticks between two entries of the latency curve and of the recorded flight.
const CURVE_STRIDE: u64 = 9;
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
    teleop: Teleop,
    vehicle: SimulatedVehicle,
    /// The latest tick before a pause: all that the recording knows of the hand until it ends.
    paused: Option<VrState>,
    /// Paint as the person sees it, and as the robot has sprayed it.
    seen: Canvas,
    flown: Canvas,
    next_sequence: u64,
    /// Time of the latest state on the page's clock, s.
    page_time: f64,
    last_tick: Option<VrState>,
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
        let mut teleop = Teleop::new(settings.teleop(), world.home);
        teleop.set_live(settings.live);
        Ok(Self {
            clock: Resampler::new(settings.session.clone()),
            teleop,
            vehicle: SimulatedVehicle::new(&world, settings.seed),
            paused: None,
            seen: Canvas::new(&world)?,
            flown: Canvas::new(&world)?,
            next_sequence: 0,
            page_time: 0.0,
            last_tick: None,
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
        if let Some(last) = self.last_tick {
            self.fly_on(last)?;
        }
        if let Some(recorder) = self.recorder.take() {
            recorder.finish()?;
        }
        // The pictures show what has been flown now.
        self.take_patches();
        Ok(())
    }

    /// Everything that is left after the last tick of the hand.
    fn fly_on(&mut self, last: VrState) -> Result<(), VrError> {
        self.teleop.fly_strokes();
        let (lag, end) = (self.lag(), last.time + LONGEST_FINISH);
        let mut tick = VrState { mode: VrMode::Idle, hit: None, ..last };
        while !self.teleop.is_done() && tick.time < end {
            tick.sequence += 1;
            tick.time = tick.sequence as f64 / RATE;
            self.tick(tick)?;
        }
        self.behind = Some([if self.is_live() { lag } else { 0.0 }, self.time() - last.time]);
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
        let feedback = self.teleop.take_feedback();
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
        self.teleop.is_live()
    }

    pub(super) fn is_paused(&self) -> bool {
        self.paused.is_some()
    }

    pub(super) fn is_waiting(&self) -> bool {
        self.teleop.is_waiting()
    }

    /// Nearest and farthest stand-off that the brush size stands for, m.
    pub(super) fn stand_off(&self) -> [f64; 2] {
        self.teleop.settings().stand_off
    }

    /// Latency in distance now, m.
    pub(super) fn lag(&self) -> f64 {
        self.teleop.lag()
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
        (self.counts, self.teleop.counts(), self.clock.counts())
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
        if self.teleop.push(tick) {
            let shot: Vec<Shot> = self.preview(&tick).into_iter().collect();
            self.seen.spray(tick.colour, &shot, &self.settings.spray(), &self.world.surface.world)?;
        }
        self.start_tasks(tick.time)?;
        let (colour, shots) = self.vehicle.advance(tick.time, &self.world)?;
        if !shots.is_empty() {
            self.flown.spray(colour, &shots, &self.settings.spray(), &self.world.surface.world)?;
        }
        self.teleop.advance(tick.time, &self.vehicle);
        self.measure(&tick)
    }

    fn start_tasks(&mut self, now: f64) -> Result<(), VrError> {
        loop {
            let begun = Instant::now();
            let surface = MeshSurface(&self.world.surface.world);
            let scene = TeleopScene { canvas: &self.world, surface: &surface, tool: &self.world.robot };
            let Some(planned) = self.teleop.step(now, &scene, &mut self.vehicle)? else { return Ok(()) };
            self.curves.planning.push(begun.elapsed().as_secs_f64());
            self.planned(&planned)?;
        }
    }

    fn planned(&mut self, planned: &PlannedTask) -> Result<(), VrError> {
        let paints = planned.kind == TaskKind::Paint;
        self.counts.plans += 1;
        if paints {
            self.counts.paint_tasks += 1;
            self.counts.targets += planned.targets as u64;
            self.counts.targets_served += planned.served as u64;
        }
        self.curves.time.extend(planned.latency.filter(|_| self.is_live()).map(|latency| (planned.time, latency)));
        match &planned.flight {
            Ok(flight) => self.counts.continued += u64::from(flight.takes_over),
            Err(why) => {
                self.counts.refused_tasks += 1;
                self.counts.refused_paint += u64::from(paints);
                self.say(format!("the robot cannot {} here: {why}", planned.kind.name()));
            }
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
        if tick.sequence.is_multiple_of(CURVE_STRIDE) {
            if self.is_live() && (tick.mode == VrMode::Painting || lag > 0.0) {
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
            Command::Live { on } => self.teleop.set_live(on),
            Command::Pause { on } => self.pause(on),
            Command::Undo => self.undo()?,
            Command::Erase { point, radius } => {
                let erased = self.teleop.erase(&point, radius);
                self.withdraw(&erased)?;
            }
            Command::Fly => self.teleop.fly_strokes(),
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
        let stroke = self.teleop.undo();
        if stroke.is_empty() {
            self.say("nothing to take back: what the robot follows at once is on the wall".into());
        }
        self.withdraw(&stroke)
    }

    fn withdraw(&mut self, states: &[VrState]) -> Result<(), VrError> {
        self.counts.taken_back += states.len() as u64;
        let spray = self.settings.spray();
        for of_one_colour in states.chunk_by(|a, b| a.colour == b.colour) {
            let shots: Vec<Shot> = of_one_colour.iter().filter_map(|state| self.preview(state)).collect();
            self.seen.withdraw(of_one_colour[0].colour, &shots, &spray, &self.world.surface.world)?;
        }
        Ok(())
    }

    fn say(&mut self, text: String) {
        self.notices.push(Notice::Text { text });
    }

    /// The paint of one tick as the robot will spray it: along the normal, from the gun's distance within what the robot keeps.
    fn preview(&self, tick: &VrState) -> Option<Shot> {
        let hit = tick.hit?;
        let axis = UnitVector3::new_unchecked(-hit.normal.into_inner());
        let origin = hit.point + hit.normal.into_inner() * self.teleop.settings().stand_off_of(tick);
        Some(Shot { origin, axis, volume: tick.flow / RATE })
    }
}
