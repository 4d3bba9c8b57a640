//! The simulated vehicle that flies one task after the other, on the session's clock.

use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use paint_planner::session::{RATE, Segment, Task, VrMode, VrState, latency_in_time, targets};
use paint_planner::{NozzleState, Plan, Settings, Target, Tool, VehicleState, plan};
use paint_sim::flight::{FlightSample, Localisation};
use paint_sim::{FlightLog, FlightSettings, Shot};
use ptu_kinematics::{Hover, Joints, ServoSettings};

use super::error::VrError;
use super::settings::{STAND_OFF, Timing, VrSettings, viewing};
use super::world::VrWorld;
use crate::adapters::{MeshSurface, PlanReference, Robot, ServoPanTilt};

/// Time that planning takes on the session's clock, s: one tick. The measured time is reported, but must not change what is flown.
const PLANNING: f64 = 1.0 / RATE;
/// Motion of the nozzle that one shot stands for, m.
const SHOT_STEP: f64 = 0.005;
/// Turn that counts as none, rad, a little more than half a bin of the planner's headings; and the pan up to which the heading is held.
const HELD: f64 = 0.05;
const HELD_PAN: f64 = 0.7;
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
    duration: f64,
    log: FlightLog,
    /// Samples whose paint has landed.
    landed: usize,
    colour: u8,
    /// The part of the pattern that it paints: where it begins, its length, m, and when each target is passed, s.
    pattern: Option<(f64, f64, Vec<f64>)>,
}

/// The vehicle.
pub(super) struct Vehicle {
    /// Where it is when the last flight has ended.
    state: VehicleState,
    view: VehicleView,
    flight: Option<Flight>,
    count: u64,
    /// Length of the pattern that its nozzle has painted, m.
    painted: f64,
}

impl Vehicle {
    /// At rest before the surface.
    pub(super) fn new(world: &VrWorld) -> Self {
        let state = world.home;
        Self { state, view: at_rest(&state, world), flight: None, count: 0, painted: 0.0 }
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
            self.take_off(plan, painted, &planner, now + PLANNING, world, settings)?;
        } else if let Some(segment) = painted {
            // What cannot be flown is not caught up with either.
            self.painted = segment.start + segment.length;
        }
        Ok(Some(record))
    }

    /// Plans with the heading that the vehicle has, if that serves every target: segments that follow each other are then flown without
    /// a turn in between, which would cost more than the segment itself.
    fn plan(&self, targets: &[Target], world: &VrWorld, planner: &Settings) -> Result<Plan, paint_planner::Error> {
        let wall = MeshSurface(&world.surface.world);
        let held = HeldHeading { robot: &world.robot, heading: self.state.heading };
        match plan(targets, &wall, &held, planner) {
            Ok(plan) if plan.report.served == targets.len() => Ok(plan),
            _ => plan(targets, &wall, &world.robot, planner),
        }
    }

    fn take_off(
        &mut self,
        plan: &Plan,
        painted: Option<&Segment>,
        planner: &Settings,
        begin: f64,
        world: &VrWorld,
        settings: &VrSettings,
    ) -> Result<(), VrError> {
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
        let log = paint_sim::fly(&reference, &mut gun, &world.surface.world, &flight)?;
        if let Some(last) = plan.waypoints.last() {
            self.state = last.state;
        }
        self.flight = Some(Flight {
            begin,
            duration: plan.trajectory.duration(),
            log,
            landed: 0,
            colour: painted.and_then(|segment| segment.states.first()).map_or(0, |state| state.colour),
            pattern: painted.map(|segment| (segment.start, segment.length, plan.target_time.clone())),
        });
        Ok(())
    }

    /// Flies on until `now`; the paint that has left the nozzle since, and which.
    pub(super) fn advance(&mut self, now: f64) -> (u8, Vec<Shot>) {
        let Some(flight) = &mut self.flight else { return (0, Vec::new()) };
        let elapsed = now - flight.begin;
        let reached = ((elapsed / flight.log.interval).floor().max(-1.0) as i64 + 1) as usize;
        let reached = reached.min(flight.log.samples.len());
        let passed = flight.log.samples[flight.landed.min(reached)..reached].to_vec();
        flight.landed = flight.landed.max(reached);
        if let Some(sample) = passed.last() {
            self.view = seen(sample);
        }
        if let Some((start, length, times)) = &flight.pattern {
            self.painted = self.painted.max(start + length * share_passed(times, elapsed));
        }
        let shots = FlightLog { samples: passed, interval: flight.log.interval }.shots(SHOT_STEP);
        let colour = flight.colour;
        if elapsed >= flight.duration {
            self.flight = None;
        }
        (colour, shots)
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

/// The robot as long as it need not turn.
struct HeldHeading<'a> {
    robot: &'a Robot,
    heading: f64,
}

impl Tool for HeldHeading<'_> {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let turned = (heading - self.heading).sin().atan2((heading - self.heading).cos());
        self.robot.vehicle(nozzle, heading).filter(|state| turned.abs() <= HELD && state.pan.abs() <= HELD_PAN)
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
