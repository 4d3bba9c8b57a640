//! The simulated vehicle that flies one task after the other, on the session's clock.

use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use paint_planner::session::{
    Continuation, RATE, Segment, Task, VrMode, VrState, continue_plan, latency_in_time, targets,
};
use paint_planner::{NozzleState, Plan, Settings, Target, Tool, VehicleState, plan};
use paint_sim::flight::FlightLog;
use paint_sim::flight::{FlightSample, Localisation};
use paint_sim::{FlightSettings, Shot};
use ptu_kinematics::{Hover, Joints, ServoSettings};

use super::error::VrError;
use super::run_up::{RUN_UP, RunUp};
use super::settings::{STAND_OFF, Timing, VrSettings, viewing};
use super::world::VrWorld;
use crate::adapters::{MeshSurface, PlanReference, Robot, ServoPanTilt};

/// Time that planning takes on the session's clock, s: one tick. The measured time is reported, but must not change what is flown.
const PLANNING: f64 = 1.0 / RATE;
/// Time before its end in which a flight may be continued, s: the next segment is planned as late as the vehicle need not slow down.
const CONTINUE: f64 = 1.5;
/// Motion of the nozzle that one shot stands for, m.
const SHOT_STEP: f64 = 0.005;
/// How far the vehicle may turn in a segment, and the pan that may be needed for it, rad, the first that serves all targets: none, which
/// is a little more than half a bin of the planner's headings; a little; whatever it takes. The pan joint ends at 1.57, and a turn costs
/// more than the segment itself: 0.9 of it are used before the vehicle turns at all, and 1.1 before it turns far.
const TURNS: [[f64; 2]; 3] = [[0.05, 0.9], [0.2, 1.1], [f64::INFINITY, f64::INFINITY]];
/// Way between the two targets of a place that is only flown to, m.
const SIDESTEP: f64 = 0.005;

/// What came of a task.
pub(super) struct PlannedTask {
    /// Number of the task in its session, from 0.
    pub(super) number: u64,
    /// When it was planned on the session's clock, s.
    pub(super) time: f64,
    /// `paint`, `view`, `approach` or `seek`.
    pub(super) kind: &'static str,
    /// Time that planning took, s of wall clock.
    pub(super) seconds: f64,
    /// Latency in time, s; only for paint.
    pub(super) latency: Option<f64>,
    /// Targets given and served.
    pub(super) targets: [usize; 2],
    /// The plan; `None` where there is none.
    pub(super) plan: Option<Plan>,
    /// Why not.
    pub(super) refused: Option<String>,
}

/// The robot as it is seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct VehicleView {
    pub(super) world_from_body: Isometry3<f64>,
    pub(super) pan_tilt: [f64; 2],
    pub(super) nozzle: Point3<f64>,
    pub(super) aim: Point3<f64>,
    pub(super) flow: f64,
}

/// A task in the air.
struct Flight {
    begin: f64,
    plan: Plan,
    targets: Vec<Target>,
    log: FlightLog,
    /// Samples whose paint has landed.
    landed: usize,
    colour: u8,
    /// The part of the pattern that it paints: where it begins and its length, m.
    pattern: Option<[f64; 2]>,
    /// Whether what follows waits for its end.
    halts: bool,
}

impl Flight {
    fn end(&self) -> f64 {
        self.begin + self.plan.trajectory.duration()
    }

    /// Where on the pattern it is at a time, m; only while it paints.
    fn painted(&self, now: f64) -> Option<f64> {
        let [start, length] = self.pattern?;
        Some(start + length * share_passed(&self.plan.target_time, now - self.begin))
    }

    /// Flies on until `now`, the samples at `now` themselves left out where another flight takes over there.
    fn advance(&mut self, now: f64, inclusive: bool) -> Vec<FlightSample> {
        let elapsed = (now - self.begin) / self.log.interval;
        let reached = if inclusive { elapsed.floor() + 1.0 } else { elapsed.ceil() };
        let reached = (reached.max(0.0) as usize).min(self.log.samples.len());
        let passed = self.log.samples[self.landed.min(reached)..reached].to_vec();
        self.landed = self.landed.max(reached);
        passed
    }
}

/// The vehicle.
pub(super) struct Vehicle {
    /// Where it is when the last flight has ended.
    state: VehicleState,
    view: VehicleView,
    flight: Option<Flight>,
    /// What takes over from it before it halts.
    successor: Option<Flight>,
    count: u64,
    /// Length of the pattern that its nozzle has painted, m.
    painted: f64,
}

impl Vehicle {
    /// At rest before the surface.
    pub(super) fn new(world: &VrWorld) -> Self {
        let state = world.home;
        Self { state, view: at_rest(&state, world), flight: None, successor: None, count: 0, painted: 0.0 }
    }

    /// Position of its body, m.
    pub(super) fn position(&self) -> Point3<f64> {
        Point3::from(self.view.world_from_body.translation.vector)
    }

    pub(super) fn view(&self) -> &VehicleView {
        &self.view
    }

    /// Whether it can take a task.
    pub(super) fn is_free(&self) -> bool {
        self.flight.is_none()
    }

    /// Whether it paints, and could go on without a halt if there were more.
    pub(super) fn is_continuable(&self, now: f64) -> bool {
        let soon = |flight: &Flight| flight.pattern.is_some() && !flight.halts && flight.end() - now <= CONTINUE;
        self.successor.is_none() && self.flight.as_ref().is_some_and(soon)
    }

    /// What it has in the air ends in a halt: it has been asked to go on, and cannot.
    pub(super) fn let_halt(&mut self) {
        if let Some(flight) = &mut self.flight {
            flight.halts = true;
        }
    }

    /// Length of the pattern that its nozzle has painted, m.
    pub(super) fn painted_length(&self) -> f64 {
        self.painted
    }

    /// Plans a task and takes off. Tasks that come to no target are `None`.
    pub(super) fn begin(
        &mut self,
        task: &Task,
        now: f64,
        world: &VrWorld,
        settings: &VrSettings,
    ) -> Result<Option<PlannedTask>, VrError> {
        let started = Instant::now();
        let (kind, targets, planner) = self.assignment(task, world, settings);
        if targets.len() < 2 {
            return Ok(None);
        }
        let planned = self.plan(&targets, world, &planner);
        let seconds = started.elapsed().as_secs_f64();
        let (plan, refused) = match planned {
            Ok(plan) => (Some(plan), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let painted =
            if let Task::Segment(segment) = task { Some(segment).filter(|s| s.mode == VrMode::Painting) } else { None };
        let record = PlannedTask {
            number: self.count,
            time: now,
            kind,
            seconds,
            latency: painted.map(|segment| latency_in_time(now + PLANNING, segment)),
            targets: [targets.len(), plan.as_ref().map_or(0, |plan| plan.report.served)],
            plan,
            refused,
        };
        self.count += 1;
        if let Some(plan) = &record.plan {
            let log = self.fly(plan, &planner, 0.0, world, settings)?;
            self.arrive(plan);
            self.flight = Some(Flight {
                begin: now + PLANNING,
                plan: plan.clone(),
                targets,
                log,
                landed: 0,
                colour: painted.and_then(|segment| segment.states.first()).map_or(0, |state| state.colour),
                pattern: painted.map(|segment| [segment.start, segment.length]),
                halts: false,
            });
        } else if let Some(segment) = painted {
            // What cannot be flown is not caught up with either.
            self.painted = segment.start + segment.length;
        }
        Ok(Some(record))
    }

    /// Plans a segment that goes on where the flight in the air ends, and lets it take over before the vehicle slows down. `None` where
    /// it cannot: the vehicle halts then, and the segment is a task like any other.
    pub(super) fn go_on(
        &mut self,
        segment: &Segment,
        now: f64,
        world: &VrWorld,
        settings: &VrSettings,
    ) -> Result<Option<PlannedTask>, VrError> {
        let Some(flying) = &self.flight else { return Ok(None) };
        let started = Instant::now();
        let (_, next, planner) = self.assignment(&Task::Segment(segment.clone()), world, settings);
        let joins = segment.states.first().is_some_and(|first| first.colour == flying.colour);
        let near = |a: &Target, b: &Target| (a.point - b.point).norm() <= settings.session.hit_jump;
        if !joins || next.len() < 2 || !flying.targets.last().is_some_and(|last| near(last, &next[0])) {
            return Ok(None);
        }
        let earliest = now + PLANNING - flying.begin;
        let heading = flying.plan.trajectory.sample(earliest).heading;
        let wall = MeshSurface(&world.surface.world);
        let continued = TURNS[..2].iter().find_map(|&turn| {
            let held = HeldHeading { robot: &world.robot, heading, turn };
            continue_plan(&flying.plan, &flying.targets, earliest, &next, &wall, &held, &planner).ok()
        });
        let Some(Continuation { at, targets, remaining, plan }) = continued else { return Ok(None) };
        let begin = flying.begin + at;
        // From a vehicle that brakes hard already a curve within the limits may be longer than a halt.
        let halting = self.plan(&next, world, &planner).map_or(f64::INFINITY, |plan| plan.trajectory.duration());
        if begin + plan.trajectory.duration() > flying.end() + PLANNING + halting {
            return Ok(None);
        }
        let start = flying.painted(begin).unwrap_or(segment.start);
        let record = PlannedTask {
            number: self.count,
            time: begin,
            kind: "paint",
            seconds: started.elapsed().as_secs_f64(),
            // The vehicle comes to the segment when it has flown what was left.
            latency: Some(latency_in_time(begin + plan.target_time[remaining], segment)),
            targets: [next.len(), next.len()],
            plan: Some(plan.clone()),
            refused: None,
        };
        self.count += 1;
        let colour = flying.colour;
        let log = self.fly(&plan, &planner, RUN_UP, world, settings)?;
        self.arrive(&plan);
        let pattern = Some([start, segment.start + segment.length - start]);
        self.successor = Some(Flight { begin, plan, targets, log, landed: 0, colour, pattern, halts: false });
        Ok(Some(record))
    }

    /// Plans with the heading that the vehicle has, or nearly, if that serves every target: segments that follow each other are then flown
    /// without a turn in between, which would cost more than the segment itself.
    fn plan(&self, targets: &[Target], world: &VrWorld, planner: &Settings) -> Result<Plan, paint_planner::Error> {
        let wall = MeshSurface(&world.surface.world);
        let mut planned = Err(paint_planner::Error::NothingReachable { count: targets.len() });
        for turn in TURNS {
            let held = HeldHeading { robot: &world.robot, heading: self.state.heading, turn };
            planned = plan(targets, &wall, &held, planner);
            if planned.as_ref().is_ok_and(|plan| plan.report.served == targets.len()) {
                break;
            }
        }
        planned
    }

    /// The simulated flight along a plan; one that begins in motion is entered with a run-up of that many seconds.
    fn fly(
        &self,
        plan: &Plan,
        planner: &Settings,
        run_up: f64,
        world: &VrWorld,
        settings: &VrSettings,
    ) -> Result<FlightLog, VrError> {
        let reference = PlanReference {
            plan,
            chain: &world.robot.chain,
            gun_length: world.ptu.tilt_from_tip.norm(),
            stand_off: planner.nozzle.stand_off,
        };
        let flight = FlightSettings {
            localisation: Localisation::mocap(),
            seed: settings.seed.wrapping_mul(0x9E37_79B9).wrapping_add(self.count),
            ..FlightSettings::default()
        };
        let mut gun = ServoPanTilt::new(world.robot.chain.clone(), ServoSettings::default())?;
        let entered = RunUp { plan: &reference, seconds: run_up };
        let log = paint_sim::fly(&entered, &mut gun, &world.surface.world, &flight)?;
        Ok(entered.without(log))
    }

    /// Remembers where the plan ends.
    fn arrive(&mut self, plan: &Plan) {
        if let Some(last) = plan.waypoints.last() {
            self.state = last.state;
        }
    }

    /// Flies on until `now`; the paint that has left the nozzle since, and which.
    pub(super) fn advance(&mut self, now: f64) -> (u8, Vec<Shot>) {
        let Some(flight) = &mut self.flight else { return (0, Vec::new()) };
        let colour = flight.colour;
        let interval = flight.log.interval;
        let takes_over = self.successor.take_if(|next| next.begin <= now);
        let mut passed = flight.advance(takes_over.as_ref().map_or(now, |next| next.begin), takes_over.is_none());
        if let Some(next) = takes_over {
            *flight = next;
            passed.extend(flight.advance(now, true));
        }
        if let Some(sample) = passed.last() {
            self.view = seen(sample);
        }
        self.painted = self.painted.max(flight.painted(now).unwrap_or(0.0));
        if now >= flight.end() {
            self.flight = None;
        }
        (colour, FlightLog { samples: passed, interval }.shots(SHOT_STEP))
    }

    /// What kind of task it is, its targets, and how they are served from where the vehicle is.
    fn assignment(&self, task: &Task, world: &VrWorld, settings: &VrSettings) -> (&'static str, Vec<Target>, Settings) {
        let start = Some(self.state);
        let looking = Settings { start, ..viewing() };
        let looked_at = |state: &VrState| world.hit(&state.nozzle).map(|hit| (hit.point, hit.normal));
        let target = |(point, normal)| Target { point, normal, dose: 0.0, time: None };
        match task {
            Task::Segment(segment) if segment.mode == VrMode::Painting => {
                let mut targets = targets(segment, &MeshSurface(&world.surface.world), &settings.targets());
                if settings.timing == Timing::Uniform {
                    level(&mut targets);
                }
                let mean = segment.states.iter().map(stand_off).sum::<f64>() / segment.states.len().max(1) as f64;
                ("paint", targets, Settings { start, ..settings.painting(mean) })
            }
            Task::Segment(segment) => {
                let mut places: Vec<Target> = segment.states.iter().filter_map(looked_at).map(target).collect();
                places.dedup_by(|b, a| (b.point - a.point).norm() < 0.05);
                ("view", pair(places), looking)
            }
            Task::Approach(state) if state.mode == VrMode::Painting => {
                let place = state.hit.map(|hit| target((hit.point, hit.normal)));
                let here = Settings { start, ..settings.painting(stand_off(state)) };
                // The hand's time stamps are none of a flight with the valve shut.
                let timing = Settings::default().timing;
                ("approach", pair(place.into_iter().collect()), Settings { timing, ..here })
            }
            Task::Approach(state) => ("approach", pair(looked_at(state).map(target).into_iter().collect()), looking),
            Task::Seek(state) => {
                let heading = Isometry3::rotation(nalgebra::Vector3::z() * state.cradle.heading);
                let ahead = world.cast(&state.cradle.position, &(heading * nalgebra::Vector3::x_axis()));
                ("seek", pair(ahead.map(|hit| target((hit.point, hit.normal))).into_iter().collect()), looking)
            }
        }
    }
}

/// The robot as long as it need not turn by more than `turn[0]` from a heading, nor pan by more than `turn[1]`, rad.
struct HeldHeading<'a> {
    robot: &'a Robot,
    heading: f64,
    turn: [f64; 2],
}

impl Tool for HeldHeading<'_> {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let turned = (heading - self.heading).sin().atan2((heading - self.heading).cos());
        self.robot
            .vehicle(nozzle, heading)
            .filter(|state| turned.abs() <= self.turn[0] && state.pan.abs() <= self.turn[1])
    }

    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        self.robot.spheres(vehicle, out);
    }
}

/// Distance of the gun from the surface as the robot will keep it: the brush size, m.
pub(super) fn stand_off(state: &VrState) -> f64 {
    let distance = state.hit.map_or(0.1, |hit| (hit.point - state.nozzle_position()).norm());
    distance.clamp(STAND_OFF[0], STAND_OFF[1])
}

/// One coat for all of the segment.
fn level(targets: &mut [Target]) {
    let steps = || targets.windows(2).map(|pair| (pair[1].point - pair[0].point).norm());
    let length: f64 = steps().sum();
    let volume: f64 = steps().zip(&*targets).map(|(step, target)| step * target.dose).sum();
    let last = targets.len() - 1;
    for target in &mut targets[..last] {
        target.dose = if length > 0.0 { volume / length } else { 0.0 };
    }
}

/// A planner needs a way: one place becomes two beside each other.
fn pair(mut places: Vec<Target>) -> Vec<Target> {
    if let [only] = places[..] {
        let side = nalgebra::Vector3::z().cross(&only.normal).try_normalize(1e-6).unwrap_or_else(nalgebra::Vector3::x);
        places.push(Target { point: only.point + side * SIDESTEP, ..only });
    }
    places
}

/// Share of the targets that are passed.
fn share_passed(times: &[f64], elapsed: f64) -> f64 {
    let after = times.partition_point(|time| *time <= elapsed);
    let Some(before) = after.checked_sub(1) else { return 0.0 };
    let within = times.get(after).map_or(0.0, |next| (elapsed - times[before]) / (next - times[before]));
    ((before as f64 + within) / (times.len() - 1).max(1) as f64).clamp(0.0, 1.0)
}

fn seen(sample: &FlightSample) -> VehicleView {
    let aim = sample.hit.unwrap_or(sample.nozzle + sample.axis.into_inner() * 0.1);
    VehicleView {
        world_from_body: sample.world_from_body,
        pan_tilt: sample.pan_tilt,
        nozzle: sample.nozzle,
        aim,
        flow: sample.flow,
    }
}

fn at_rest(state: &VehicleState, world: &VrWorld) -> VehicleView {
    let joints = Joints { pan: state.pan, tilt: state.tilt };
    let hover = Hover { position: state.position, heading: state.heading, joints };
    let nozzle = world.robot.chain.forward(&hover.world_from_body(), joints);
    VehicleView {
        world_from_body: hover.world_from_body(),
        pan_tilt: [state.pan, state.tilt],
        nozzle: nozzle.tip,
        aim: nozzle.tip + nozzle.direction.into_inner() * 0.1,
        flow: 0.0,
    }
}
