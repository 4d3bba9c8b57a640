//! A vehicle of one's own that follows a hand: it takes flights, says where it is, and when it has arrived.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

use paint_planner::VehicleState;
use paint_planner::nalgebra::Point3;
use paint_planner::teleop::{
    Feedback, Flight, PlannedTask, RATE, TaskKind, Teleop, TeleopScene, TeleopSettings, Vehicle, VrMode, VrState,
};

use crate::teleop::state;
use crate::walls::{Arm, Wall};

/// Where the vehicle waits, m: the arm ends half a metre before the wall.
const HOME: Point3<f64> = Point3::new(-1.3, 0.0, 2.0);
/// Speed of the hand, m/s.
const HAND: f64 = 0.15;

/// An autopilot that is exactly where it should be, and keeps what it was given.
struct Autopilot {
    position: Point3<f64>,
    flights: Vec<Flight>,
    /// How much later than planned it comes to rest, s.
    late: f64,
    armed: bool,
}

impl Vehicle for Autopilot {
    type Error = &'static str;

    fn position(&self) -> Point3<f64> {
        self.position
    }

    fn fly(&mut self, flight: &Flight) -> Result<(), &'static str> {
        if !self.armed {
            return Err("not armed");
        }
        self.flights.push(flight.clone());
        Ok(())
    }

    fn has_finished(&self, flight: &Flight, now: f64) -> bool {
        now >= flight.end() + self.late
    }
}

impl Autopilot {
    fn new() -> Self {
        Self { position: HOME, flights: Vec::new(), late: 0.0, armed: true }
    }

    fn move_on(&mut self, now: f64) {
        if let Some(flight) = self.flights.iter().rev().find(|flight| flight.begin <= now) {
            self.position =
                flight.plan.trajectory.sample((now - flight.begin).min(flight.end() - flight.begin)).position;
        }
    }
}

fn teleop() -> Teleop {
    let home = VehicleState { position: HOME, heading: 0.0, pan: 0.0, tilt: 0.0 };
    Teleop::new(TeleopSettings::default(), home)
}

/// One tick: the state, the tasks, the flight.
fn tick(
    teleop: &mut Teleop,
    vehicle: &mut Autopilot,
    wall: &Wall,
    state: VrState,
) -> Result<(bool, Vec<PlannedTask>), &'static str> {
    let scene = TeleopScene { canvas: wall, surface: wall, tool: &Arm::default() };
    let paints = teleop.push(state);
    let mut planned = Vec::new();
    while let Some(task) = teleop.step(state.time, &scene, vehicle)? {
        planned.push(task);
    }
    vehicle.move_on(state.time);
    teleop.advance(state.time, vehicle);
    Ok((paints, planned))
}

/// States from the tick `first` on: a stroke of some metres that begins at `y`, then a released button.
fn stroke(first: u64, y: f64, length: f64) -> impl Iterator<Item = VrState> {
    let painting = (length / HAND * RATE).round() as u64;
    let at = move |k: u64| state(first + k, VrMode::Painting, y + HAND / RATE * k as f64);
    (0..=painting).map(at).chain([state(first + painting + 1, VrMode::Idle, y + length)])
}

/// Ticks until everything is flown.
fn rest(teleop: &mut Teleop, vehicle: &mut Autopilot, wall: &Wall, mut last: VrState) -> (Vec<PlannedTask>, VrState) {
    let mut planned = Vec::new();
    for _ in 0..100_000 {
        if teleop.is_done() {
            return (planned, last);
        }
        last.sequence += 1;
        last.time = last.sequence as f64 / RATE;
        planned.extend(tick(teleop, vehicle, wall, last).unwrap().1);
    }
    panic!("the vehicle never comes to rest");
}

#[test]
fn a_stroke_is_followed_without_a_halt_and_painted_once() {
    let (mut teleop, mut vehicle, wall) = (teleop(), Autopilot::new(), Wall::flat());
    let mut planned = Vec::new();
    let states: Vec<VrState> = stroke(0, 0.0, 1.5).collect();
    for state in &states {
        planned.extend(tick(&mut teleop, &mut vehicle, &wall, *state).unwrap().1);
    }
    assert!(teleop.lag() > 0.1);
    planned.extend(rest(&mut teleop, &mut vehicle, &wall, states[states.len() - 1]).0);
    // First it comes, then it paints; every task has its number.
    assert_eq!(planned[0].kind, TaskKind::Approach);
    assert!(planned[1..].iter().all(|task| task.kind == TaskKind::Paint && task.served == task.targets));
    assert!(planned.iter().enumerate().all(|(k, task)| task.number == k as u64 && task.flight.is_ok()));
    assert!(planned[1..].iter().all(|task| task.latency.is_some_and(|latency| latency > 0.0)));
    let flights = &vehicle.flights;
    assert!(flights.iter().filter(|flight| flight.takes_over).count() >= 3, "{}", flights.len());
    // A flight begins where the one before ends, or goes on in its motion.
    for pair in flights.windows(2) {
        let (before, after) = (&pair[0], &pair[1]);
        let here = before.plan.trajectory.sample(after.begin - before.begin);
        let there = after.plan.trajectory.sample(0.0);
        assert!((here.position - there.position).norm() < 1e-6 && (here.velocity - there.velocity).norm() < 1e-6);
        assert_eq!(after.takes_over, after.begin < before.end() - 1e-9);
    }
    // Every drop once: of a flight that is replaced only what it has sprayed until then.
    let mut volume = 0.0;
    for (k, flight) in flights.iter().enumerate() {
        let end = flights.get(k + 1).map_or(f64::INFINITY, |next| next.begin - flight.begin);
        let sprayed = (0..flight.targets.len()).filter(|&i| flight.plan.target_time[i] < end - 1e-9);
        volume += sprayed.map(|i| flight.plan.volume(i)).sum::<f64>();
    }
    let given = 1e-6 * 1.5 / HAND;
    assert!((volume / given - 1.0).abs() < 1e-6, "{volume} m^3 of {given}");
    assert!(teleop.lag() < 1e-9 && teleop.is_done());
}

#[test]
fn a_vehicle_that_is_late_gets_its_next_task_when_it_has_arrived() {
    let (mut teleop, mut vehicle, wall) = (teleop(), Autopilot { late: 0.7, ..Autopilot::new() }, Wall::flat());
    for state in stroke(0, 0.0, 0.05) {
        tick(&mut teleop, &mut vehicle, &wall, state).unwrap();
    }
    rest(&mut teleop, &mut vehicle, &wall, state(31, VrMode::Idle, 0.05));
    let [approach, paint] = &vehicle.flights[..] else { panic!("{} flights", vehicle.flights.len()) };
    assert!(paint.begin >= approach.end() + 0.7 && paint.begin < approach.end() + 0.7 + 3.0 / RATE);
}

#[test]
fn a_flight_that_is_not_taken_is_none_of_the_session() {
    let (mut teleop, mut vehicle, wall) = (teleop(), Autopilot { armed: false, ..Autopilot::new() }, Wall::flat());
    assert_eq!(tick(&mut teleop, &mut vehicle, &wall, state(0, VrMode::Painting, 0.0)).unwrap_err(), "not armed");
    vehicle.armed = true;
    let (mut number, mut last) = (None, state(0, VrMode::Painting, 0.0));
    for state in stroke(1, 0.0, 0.05) {
        number = number.or(tick(&mut teleop, &mut vehicle, &wall, state).unwrap().1.first().map(|task| task.number));
        last = state;
    }
    rest(&mut teleop, &mut vehicle, &wall, last);
    assert_eq!((number.unwrap_or(vehicle.flights[0].number), vehicle.flights[0].takes_over), (0, false));
}

#[test]
fn what_no_vehicle_can_fly_is_said_and_not_waited_for() {
    // The hand paints from behind the wall: normals point away from where the arm can be.
    let (mut teleop, mut vehicle, wall) = (teleop(), Autopilot::new(), Wall::flat());
    let mut planned = Vec::new();
    let mut last = state(0, VrMode::Idle, 0.0);
    for mut state in stroke(0, 0.0, 0.3) {
        if let Some(hit) = &mut state.hit {
            hit.normal = -hit.normal;
        }
        planned.extend(tick(&mut teleop, &mut vehicle, &wall, state).unwrap().1);
        last = state;
    }
    planned.extend(rest(&mut teleop, &mut vehicle, &wall, last).0);
    assert!(planned.iter().all(|task| task.flight.is_err() && task.served == 0), "{planned:?}");
    assert!(vehicle.flights.is_empty() && planned.len() > 1 && teleop.lag() < 1e-9);
}

#[test]
fn what_is_kept_can_be_taken_back_and_is_flown_when_it_is_asked_for() {
    let (mut teleop, mut vehicle, wall) = (teleop(), Autopilot::new(), Wall::flat());
    teleop.set_live(false);
    let mut last = state(0, VrMode::Idle, 0.0);
    for state in stroke(0, 0.0, 0.3).chain(stroke(300, 0.5, 0.3)) {
        let (paints, planned) = tick(&mut teleop, &mut vehicle, &wall, state).unwrap();
        assert!(paints == (state.mode == VrMode::Painting) && planned.is_empty());
        last = state;
    }
    // From too far away nothing is kept, and the person hears of it once.
    for k in 600..605 {
        let mut far = state(k, VrMode::Painting, 0.2);
        far.nozzle.translation.vector.x = -1.2;
        assert!(!tick(&mut teleop, &mut vehicle, &wall, far).unwrap().0);
    }
    assert_eq!(teleop.take_feedback(), [Feedback::MoveCloser { distance: 1.2 }]);
    // The second stroke, and the middle of the first.
    assert!((teleop.undo().first().unwrap().hit.unwrap().point.y - 0.5).abs() < 1e-12);
    let erased = teleop.erase(&Point3::new(0.0, 0.15, 2.0), 0.05);
    assert!(erased.iter().all(|state| (state.hit.unwrap().point.y - 0.15).abs() <= 0.05) && erased.len() > 50);
    // What is left of the first are two strokes: one of them is taken back.
    let back = teleop.clone().undo();
    assert!(!back.is_empty() && back.iter().filter_map(|state| state.hit).all(|hit| hit.point.y > 0.2));
    teleop.fly_strokes();
    last.sequence = 700;
    rest(&mut teleop, &mut vehicle, &wall, last);
    let ends = |flight: &Flight| [0, flight.targets.len() - 1].map(|k| flight.targets[k].point.y);
    let [first, second] = &vehicle.flights[..] else { panic!("{} flights", vehicle.flights.len()) };
    for (end, wanted) in ends(first).into_iter().chain(ends(second)).zip([0.0, 0.1, 0.2, 0.3]) {
        assert!((end - wanted).abs() < 0.003, "{end} {wanted}");
    }
    assert!(teleop.undo().is_empty());
}
