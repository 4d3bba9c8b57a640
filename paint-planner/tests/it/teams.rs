//! Several robots on one wall.

use paint_planner::mission::{
    LiftedStrokes, MissionPlan, MissionPlanner, MissionSettings, NoRehearsal, Team, Track, nearest_approach,
    plan_mission,
};
use paint_planner::nalgebra::Point3;
use paint_planner::plan::OptimalPlanner;
use paint_planner::{Error, Target};

use crate::walls::{Arm, Wall};

fn planned(strokes: &[Vec<Target>], team: Team) -> Result<MissionPlan, Error> {
    let settings = MissionSettings { team, ..MissionSettings::default() };
    plan_mission(strokes, &Wall::flat(), &Arm::default(), &NoRehearsal, settings)
}

/// Positions of all flights of a robot, by the mission's time.
fn track(mission: &MissionPlan, robot: usize) -> Track {
    let mut track = Track::default();
    for flight in mission.flights.iter().filter(|flight| flight.turn.robot == robot) {
        let trajectory = &flight.plan.trajectory;
        let looks = (trajectory.duration() / 0.05) as usize;
        let position = |k: usize| trajectory.sample(0.05 * k as f64).position;
        track.push(flight.start, 0.05, (0..=looks).map(position).collect());
    }
    track
}

fn strokes() -> Vec<Vec<Target>> {
    // Rows of ten metres, one over another.
    let row = |z: f64| {
        let mut row = Wall::flat().rows(10.0, 1, 0.2);
        for target in &mut row {
            target.point.z += z;
        }
        row
    };
    (0..6).map(|k| row(0.15 * f64::from(k))).collect()
}

fn sprayed(mission: &MissionPlan) -> f64 {
    let of = |flight: &paint_planner::mission::MissionFlight| {
        (0..flight.plan.flow.len()).map(|k| flight.plan.volume(k)).sum::<f64>()
    };
    mission.flights.iter().map(of).sum()
}

#[test]
fn two_robots_paint_the_same_in_little_more_than_half_the_time_and_stay_apart() {
    let strokes = strokes();
    let (one, two) = (
        planned(&strokes, Team::default()).unwrap(),
        planned(&strokes, Team { robots: 2, ..Team::default() }).unwrap(),
    );
    assert!((sprayed(&two) / sprayed(&one) - 1.0).abs() < 1e-9);
    assert_eq!(two.outcomes().not_served(), 0);
    assert!(two.duration() < 0.65 * one.duration(), "{} s, {} s", two.duration(), one.duration());
    assert!((one.duration() - one.flights.iter().map(|f| f.plan.trajectory.duration()).sum::<f64>()).abs() < 1e-9);
    let tracks = [track(&two, 0), track(&two, 1)];
    let nearest = nearest_approach(&tracks).unwrap();
    assert!(nearest >= 2.0, "{nearest} m");
    // Each robot's flights follow each other, from where the one before has ended.
    for robot in 0..2 {
        let own: Vec<_> = two.flights.iter().filter(|flight| flight.turn.robot == robot).collect();
        assert!(own.len() >= 2);
        for pair in own.windows(2) {
            let end = pair[0].start + pair[0].plan.trajectory.duration();
            let way = pair[0].plan.trajectory.sample(f64::MAX).position - pair[1].plan.trajectory.sample(0.0).position;
            assert!(pair[1].start >= end - 1e-9 && way.norm() < 1e-6, "{} {end}", pair[1].start);
        }
    }
}

/// The ground plans of hoses that hang from behind the cells never cross, as each robot stays in its own part of the wall.
#[test]
fn each_robot_stays_in_its_own_part() {
    let two = planned(&strokes(), Team { robots: 2, ..Team::default() }).unwrap();
    let y = |robot: usize| {
        two.flights
            .iter()
            .filter(move |f| f.turn.robot == robot)
            .flat_map(|f| f.route.targets.iter().map(|t| t.point.y))
    };
    assert!(y(0).fold(f64::MIN, f64::max) <= y(1).fold(f64::MAX, f64::min) + 0.1);
    // From the first moment on.
    for flight in &two.flights {
        let first = flight.plan.trajectory.sample(0.0).position.y;
        assert_eq!(flight.turn.robot, usize::from(first > y(1).fold(f64::MAX, f64::min) - 0.1), "{first} m");
    }
}

/// A second layer has room for one robot, where the second one's first layer ends.
#[test]
fn a_layer_without_room_for_all_is_flown_by_fewer() {
    let wide = strokes();
    let narrow: Vec<Vec<Target>> = wide
        .iter()
        .map(|row| row.iter().filter(|target| (7.0..9.0).contains(&target.point.y)).copied().collect())
        .collect();
    assert!(narrow.iter().all(|row: &Vec<Target>| row.len() > 5));
    let team = Team { robots: 2, ..Team::default() };
    let (planner, wall, arm) = (OptimalPlanner::default(), Wall::flat(), Arm::default());
    let settings = MissionSettings { team, ..MissionSettings::default() };
    let planner = MissionPlanner { planner: &planner, surface: &wall, tool: &arm, rehearsal: &NoRehearsal, settings };
    let mut mission = MissionPlan::default();
    for strokes in [wide, Vec::new(), narrow] {
        planner.add_strokes(&LiftedStrokes { strokes, lost_volume: 0.0 }, &mut mission).unwrap();
    }
    mission.schedule(&team).unwrap();
    assert_eq!([0, 1, 2].map(|layer| mission.robots(layer)), [2, 1, 0]);
    // From the ground, not from where the first layer has ended.
    let far = |k: usize| (7.0..9.0).contains(&mission.flights[k].plan.trajectory.sample(0.0).position.y);
    assert!((0..mission.flights.len()).filter(|k| mission.flights[*k].turn.layer == 1).take(1).all(far));
    let first_ends = |f: &&paint_planner::mission::MissionFlight| f.start + f.plan.trajectory.duration();
    let (first, second): (Vec<_>, Vec<_>) = mission.flights.iter().partition(|flight| flight.turn.layer == 0);
    let end = first.iter().map(first_ends).fold(0.0, f64::max);
    assert!(second.iter().all(|flight| flight.start >= end - 1e-9));
    assert_eq!(mission.outcomes().not_served(), 0);
}

#[test]
fn a_team_without_sense_is_refused() {
    for team in [Team { robots: 0, ..Team::default() }, Team { apart: f64::NAN, ..Team::default() }] {
        assert!(matches!(planned(&strokes(), team), Err(Error::Setting { .. })));
    }
}

#[test]
fn the_nearest_approach_is_that_of_flying_robots() {
    let at = |y: f64| Point3::new(0.0, y, 0.0);
    let (mut one, mut other) = (Track::default(), Track::default());
    one.push(0.0, 1.0, (0..=10).map(|k| at(f64::from(k))).collect());
    // From 20 to 13 m from 5 s on: 5 m apart when the first lands.
    other.push(5.0, 1.0, (0..=7).map(|k| at(20.0 - f64::from(k))).collect());
    assert_eq!(nearest_approach(&[one.clone(), other.clone()]), Some(5.0));
    // A second flight of the first, past the second one's place after that has landed.
    one.push(30.0, 1.0, (10..=20).map(|k| at(f64::from(k))).collect());
    assert_eq!(nearest_approach(&[one.clone(), other]), Some(5.0));
    assert_eq!(nearest_approach(&[one, Track::default()]), None);
}
