//! A rehearsal of one's own: flies a plan and tells where it came too near.

use std::cell::Cell;

use paint_planner::mission::{MarginRehearsal, MissionSettings, NearMiss, NoRehearsal, Rehearsal, gap, plan_mission};
use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::plan::NotServed;
use paint_planner::{Error, Hit, Plan, Surface, Tool, VehicleState};

use crate::walls::{Arm, Wall};

/// The flat wall x = 0 and another across it at y = -0.44, so that the first targets have little room.
struct Corner;

impl Surface for Corner {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        Wall::flat().cast(origin, direction, max)
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        point.x.abs().min((point.y + 0.44).abs()).min(max)
    }
}

/// A side wind that pushes the vehicle by some metres.
struct SideWind {
    push: f64,
    flights: Cell<usize>,
}

/// What may go wrong in this simulation.
#[derive(Debug)]
enum Trouble {
    Planner,
    NoFuel,
}

impl From<Error> for Trouble {
    fn from(_: Error) -> Self {
        Self::Planner
    }
}

impl SideWind {
    /// Moments at which the pushed arm has less than `margin` metres.
    fn near(&self, plan: &Plan, margin: f64) -> Vec<NearMiss> {
        let mut near = Vec::new();
        for (time, s) in plan.setpoints(0.05) {
            let position = s.sample.position - Vector3::y() * self.push;
            let mut spheres = Vec::new();
            let state = VehicleState { position, heading: s.sample.heading, pan: s.pan, tilt: s.tilt };
            Arm::default().spheres(&state, &mut spheres);
            near.push(NearMiss { time, missing: margin - gap(&spheres, &Corner, 1.0) });
        }
        near.retain(|near| near.missing > 0.0);
        near
    }
}

impl Rehearsal for SideWind {
    type Error = Trouble;

    fn near_misses(&self, plan: &Plan) -> Result<Vec<NearMiss>, Trouble> {
        self.flights.set(self.flights.get() + 1);
        if self.push > 9.0 {
            return Err(Trouble::NoFuel);
        }
        Ok(self.near(plan, 0.01))
    }
}

#[test]
fn what_comes_too_near_keeps_off_until_no_rehearsal_does() {
    let (strokes, arm, settings) = ([Wall::flat().rows(1.0, 1, 0.2)], Arm::default(), MissionSettings::default());
    let calm = plan_mission(&strokes, &Corner, &arm, &NoRehearsal, settings.clone()).unwrap();
    let wind = SideWind { push: 0.08, flights: Cell::new(0) };
    assert!(!wind.near(&calm.flights[0].plan, 0.01).is_empty(), "the wind does not matter");
    let kept = plan_mission(&strokes, &Corner, &arm, &wind, settings.clone()).unwrap();
    let flight = &kept.flights[0];
    assert!(flight.kept_off() > 0 && flight.kept_off() < strokes[0].len() && flight.excluded() == 0);
    assert!(wind.near(&flight.plan, 0.01).is_empty() && wind.flights.get() > 1);
    // The very corner has no room for that.
    let outcomes = kept.outcomes();
    assert!(outcomes.not_served() < 6 && outcomes.not_served() == outcomes.without_heading, "{outcomes:?}");
    // A simulation that breaks down is no near miss.
    let storm = SideWind { push: 10.0, flights: Cell::new(0) };
    assert!(matches!(plan_mission(&strokes, &Corner, &arm, &storm, settings), Err(Trouble::NoFuel)));
}

#[test]
fn what_always_comes_too_near_is_left_out_and_says_so() {
    let (strokes, arm) = ([Wall::flat().rows(1.0, 1, 0.2)], Arm::default());
    // Something is always touched at the tenth target, however far off it is passed.
    let touched = |plan: &Plan| {
        let time = plan.reachable[10].then(|| plan.target_time[10]);
        time.into_iter().map(|time| NearMiss { time, missing: 1e-3 }).collect::<Vec<NearMiss>>()
    };
    let settings = MissionSettings { flights: 1, ..MissionSettings::default() };
    let mission = plan_mission(&strokes, &Wall::flat(), &arm, &touched, settings).unwrap();
    let flight = &mission.flights[0];
    // The target, the one after it, and two beside each.
    let left: Vec<usize> =
        (0..strokes[0].len()).filter(|&k| flight.plan.not_served[k] == Some(NotServed::Excluded)).collect();
    assert_eq!(left, [8, 9, 10, 11, 12, 13]);
    assert_eq!((flight.excluded(), mission.outcomes().excluded), (6, 7));
}

/// A gust in the first flight alone: what is given up there is flown once more, by itself.
#[test]
fn what_a_flight_gives_up_is_flown_once_more() {
    let (strokes, arm) = ([Wall::flat().rows(1.0, 1, 0.2)], Arm::default());
    let count = strokes[0].len();
    let gust = |plan: &Plan| {
        let first = plan.target_time.len() == count && plan.reachable[10];
        first.then(|| NearMiss { time: plan.target_time[10], missing: 1e-3 }).into_iter().collect::<Vec<NearMiss>>()
    };
    let planned = |flights: usize, shortest_retry: f64| {
        let settings = MissionSettings { flights, shortest_retry, ..MissionSettings::default() };
        plan_mission(&strokes, &Wall::flat(), &arm, &gust, settings).unwrap()
    };
    let mission = planned(2, 0.05);
    let [first, second] = &mission.flights[..] else { panic!("{} flights", mission.flights.len()) };
    let bare: Vec<usize> = (0..count - 1).filter(|&k| first.plan.flow[k] == 0.0).collect();
    assert!(bare.len() >= 6 && bare.windows(2).all(|pair| pair[1] == pair[0] + 1), "{bare:?}");
    let expected: Vec<_> = (bare[0]..=bare[0] + bare.len()).map(|k| strokes[0][k].point).collect();
    let mut again: Vec<_> = second.route.targets.iter().map(|target| target.point).collect();
    // It may be flown from either end.
    if again[0] != expected[0] {
        again.reverse();
    }
    assert_eq!(again, expected);
    assert!(bare.iter().all(|&k| first.route.targets[k].dose == 0.0), "paint is doubled");
    assert_eq!(mission.outcomes().not_served(), 0);
    // Not where there is no further flight, and not if it is too short.
    assert_eq!(planned(1, 0.05).flights.len(), 1);
    assert_eq!(planned(2, 1.0).flights.len(), 1);
}

#[test]
fn a_margin_holds_between_the_targets_too() {
    let (strokes, arm, settings) = ([Wall::flat().rows(1.0, 1, 0.2)], Arm::default(), MissionSettings::default());
    let margin = MarginRehearsal { surface: &Corner, tool: &arm, margin: 0.1 };
    let calm = plan_mission(&strokes, &Corner, &arm, &NoRehearsal, settings.clone()).unwrap();
    assert!(!margin.near_misses(&calm.flights[0].plan).unwrap().is_empty());
    let kept = plan_mission(&strokes, &Corner, &arm, &margin, settings).unwrap();
    let still = SideWind { push: 0.0, flights: Cell::new(0) };
    assert!(still.near(&kept.flights[0].plan, 0.1).is_empty());
}
