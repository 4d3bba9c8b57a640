//! Tasks become flights that follow each other, without a halt where that is possible.

use super::assignment::{Assignment, TaskKind};
use super::continuation::{Continuation, continue_plan};
use super::held_heading::{HeldHeading, plan_with_held_heading};
use super::lag::latency_in_time;
use super::scene::TeleopScene;
use super::settings::TeleopSettings;
use super::task::{Segment, Task};
use super::vehicle::{Flight, Vehicle};
use crate::error::Error;
use crate::plan::Plan;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::VehicleState;

/// What came of a task.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedTask {
    /// Number of the task in its session, from 0.
    pub number: u64,
    /// When it was planned on the session's clock, s; of a flight that takes over, when it does.
    pub time: f64,
    /// What it is for.
    pub kind: TaskKind,
    /// Latency in time, s; only of what is painted.
    pub latency: Option<f64>,
    /// Targets given.
    pub targets: usize,
    /// Those of them that are served.
    pub served: usize,
    /// The flight, or why there is none.
    pub flight: Result<Flight, Error>,
}

/// Plans one task after the other from where the vehicle will be.
#[derive(Debug, Clone)]
pub(super) struct Pilot {
    /// The vehicle when the last flight has ended.
    state: VehicleState,
    flight: Option<Flight>,
    /// What takes over from it before it halts.
    successor: Option<Flight>,
    /// Whether what follows waits for its end.
    halts: bool,
    /// When the latest flight was planned, s.
    planned: f64,
    count: u64,
    painted: f64,
}

impl Pilot {
    /// A vehicle at rest.
    pub(super) fn new(state: VehicleState) -> Self {
        Self { state, flight: None, successor: None, halts: false, planned: f64::NEG_INFINITY, count: 0, painted: 0.0 }
    }

    /// Whether the vehicle can take a task.
    pub(super) fn is_free(&self) -> bool {
        self.flight.is_none() && self.successor.is_none()
    }

    /// Whether it paints, and could go on without a halt if there were more; what was planned just now has not begun.
    pub(super) fn is_continuable(&self, now: f64, settings: &TeleopSettings) -> bool {
        let soon = |flight: &Flight| flight.pattern.is_some() && flight.end() - now <= settings.continue_within;
        self.successor.is_none() && !self.halts && now > self.planned && self.flight.as_ref().is_some_and(soon)
    }

    /// The flight in the air ends in a halt: it has been asked to go on, and cannot.
    pub(super) fn let_halt(&mut self) {
        self.halts = true;
    }

    /// Length of the pattern that the nozzle has painted, m.
    pub(super) fn painted_length(&self) -> f64 {
        self.painted
    }

    /// Plans a task and takes off. Tasks that come to no target are `None`.
    pub(super) fn begin<V: Vehicle>(
        &mut self,
        task: &Task,
        now: f64,
        scene: &TeleopScene,
        settings: &TeleopSettings,
        vehicle: &mut V,
    ) -> Result<Option<PlannedTask>, V::Error> {
        let Assignment { kind, targets, settings: planner } = Assignment::of(task, scene, settings);
        if targets.len() < 2 {
            return Ok(None);
        }
        let begin = now + settings.planning_time;
        let segment = match task {
            Task::Segment(segment) if kind == TaskKind::Paint => Some(segment),
            _ => None,
        };
        let (number, count) = (self.count, targets.len());
        let planned = self.plan_from_rest(&targets, scene, &planner);
        let flight = planned.map(|plan| Flight {
            number,
            begin,
            plan,
            targets,
            stand_off: planner.nozzle.stand_off,
            colour: segment.and_then(|segment| segment.states.first()).map_or(0, |state| state.colour),
            pattern: segment.map(|segment| [segment.start, segment.length]),
            takes_over: false,
        });
        if let Ok(flight) = &flight {
            vehicle.fly(flight)?;
            self.depart(flight, now);
            self.flight = Some(flight.clone());
            self.halts = false;
        } else if let Some(segment) = segment {
            // What cannot be flown is not caught up with either.
            self.painted = segment.start + segment.length;
        }
        self.count += 1;
        Ok(Some(PlannedTask {
            number,
            time: now,
            kind,
            latency: segment.map(|segment| latency_in_time(begin, segment)),
            targets: count,
            served: flight.as_ref().map_or(0, |flight| flight.plan.report.served),
            flight,
        }))
    }

    /// Plans a segment that goes on where the flight in the air ends, and lets it take over before the vehicle slows down. `None` where
    /// it cannot: the vehicle halts then, and the segment is a task like any other.
    pub(super) fn go_on<V: Vehicle>(
        &mut self,
        segment: &Segment,
        now: f64,
        scene: &TeleopScene,
        settings: &TeleopSettings,
        vehicle: &mut V,
    ) -> Result<Option<PlannedTask>, V::Error> {
        let Some(flying) = &self.flight else { return Ok(None) };
        let Assignment { kind, targets: next, settings: planner } =
            Assignment::of(&Task::Segment(segment.clone()), scene, settings);
        let same_colour = segment.states.first().is_some_and(|first| first.colour == flying.colour);
        let near = |a: &Target, b: &Target| (a.point - b.point).norm() <= settings.session.hit_jump;
        if !same_colour || next.len() < 2 || !flying.targets.last().is_some_and(|last| near(last, &next[0])) {
            return Ok(None);
        }
        let earliest = now + settings.planning_time - flying.begin;
        let heading = flying.plan.trajectory.sample(earliest).heading;
        let continued = HeldHeading::nearly(scene.tool, heading).find_map(|held| {
            continue_plan(&flying.plan, &flying.targets, earliest, &next, scene.surface, &held, &planner).ok()
        });
        let Some(Continuation { at, targets, remaining, plan }) = continued else { return Ok(None) };
        let begin = flying.begin + at;
        // From a vehicle that brakes hard already a curve within the limits may be longer than a halt.
        let halting = self.plan_from_rest(&next, scene, &planner);
        let halting = halting.map_or(f64::INFINITY, |plan| plan.trajectory.duration());
        if begin + plan.trajectory.duration() > flying.end() + settings.planning_time + halting {
            return Ok(None);
        }
        let start = flying.painted(begin).unwrap_or(segment.start);
        // The vehicle comes to the segment when it has flown what was left.
        let latency = latency_in_time(begin + plan.target_time[remaining], segment);
        let flight = Flight {
            number: self.count,
            begin,
            plan,
            targets,
            stand_off: planner.nozzle.stand_off,
            colour: flying.colour,
            pattern: Some([start, segment.start + segment.length - start]),
            takes_over: true,
        };
        vehicle.fly(&flight)?;
        self.depart(&flight, now);
        self.successor = Some(flight.clone());
        self.count += 1;
        Ok(Some(PlannedTask {
            number: flight.number,
            time: begin,
            kind,
            latency: Some(latency),
            targets: next.len(),
            served: next.len(),
            flight: Ok(flight),
        }))
    }

    /// The flights go on until `now`.
    pub(super) fn advance<V: Vehicle>(&mut self, now: f64, vehicle: &V) {
        if let Some(next) = self.successor.take_if(|next| next.begin <= now) {
            self.flight = Some(next);
            self.halts = false;
        }
        let Some(flight) = &self.flight else { return };
        self.painted = self.painted.max(flight.painted(now).unwrap_or(0.0));
        if vehicle.has_finished(flight, now) {
            self.flight = None;
        }
    }

    fn plan_from_rest(&self, targets: &[Target], scene: &TeleopScene, planner: &Settings) -> Result<Plan, Error> {
        let planner = Settings { start: Some(self.state), ..planner.clone() };
        plan_with_held_heading(targets, self.state.heading, scene.surface, scene.tool, &planner)
    }

    /// Remembers where the vehicle will be, and since when that is known.
    fn depart(&mut self, flight: &Flight, now: f64) {
        self.planned = now;
        if let Some(last) = flight.plan.waypoints.last() {
            self.state = last.state;
        }
    }
}
