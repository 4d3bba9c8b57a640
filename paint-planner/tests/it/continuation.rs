//! A plan that goes on in flight instead of halting.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

use paint_planner::teleop::continue_plan;
use paint_planner::{Error, OptimalPlanner, Plan, Planner, Settings, Target, VehicleState};

use crate::walls::{Arm, Wall};

/// A plan along the wall from `from` to `to` metres, and its targets, one centimetre apart.
fn along_the_wall(from: f64, to: f64, start: Option<VehicleState>) -> (Vec<Target>, Plan) {
    let count = ((to - from) / 0.01_f64).round() as usize;
    let target = |k: usize| Wall::flat().target(from + 0.01 * k as f64, 2.0, if k < count { 1e-6 } else { 0.0 });
    let targets: Vec<Target> = (0..=count).map(target).collect();
    let plan = OptimalPlanner::default().plan(
        &targets,
        &Wall::flat(),
        &Arm::default(),
        &Settings { start, ..Settings::default() },
    );
    (targets, plan.unwrap())
}

#[test]
fn a_plan_that_goes_on_in_flight_keeps_state_limits_and_paint() {
    let (targets, flying) = along_the_wall(0.0, 0.5, None);
    let (next, halting) = along_the_wall(0.5, 1.0, flying.waypoints.last().map(|w| w.state));
    let settings = Settings::default();
    let earliest = flying.trajectory.duration() - 1.2;
    let on = continue_plan(&flying, &targets, earliest, &next, &Wall::flat(), &Arm::default(), &settings).unwrap();
    assert!(on.at >= earliest && on.at < earliest + 0.1, "{} {earliest}", on.at);
    // Position, velocity, acceleration and heading go on; the vehicle is in motion.
    let (before, after) = (flying.trajectory.sample(on.at), on.plan.trajectory.sample(0.0));
    assert!(before.velocity.norm() > 0.1);
    assert!((before.position - after.position).norm() < 1e-12 && (before.velocity - after.velocity).norm() < 1e-9);
    assert!((before.acceleration - after.acceleration).norm() < 1e-9 && (before.heading - after.heading).abs() < 1e-12);
    // Within the limits everywhere, at rest at the end, and there sooner than over a halt.
    let extrema = on.plan.trajectory.extrema();
    assert!(extrema.speed <= settings.timing.max_speed && extrema.acceleration <= settings.timing.max_acceleration);
    let end = on.plan.trajectory.duration();
    assert!(on.plan.trajectory.sample(end).velocity.norm() < 1e-9);
    let least =
        (0..100).map(|k| on.plan.trajectory.sample(0.006 * end * f64::from(k)).velocity.norm()).fold(1.0, f64::min);
    assert!(least > 0.05, "{least} m/s");
    let over_a_halt = flying.trajectory.duration() - on.at + halting.trajectory.duration();
    assert!(end < over_a_halt - 0.5, "{end} s, over a halt {over_a_halt} s");
    // What was left of the first plan and all of the second one: the paint of every centimetre is given once.
    let first = targets.len() - 1 - on.remaining;
    assert_eq!((on.targets.len(), on.targets[0]), (on.remaining + next.len(), targets[first]));
    assert!(on.targets.windows(2).all(|pair| ((pair[1].point - pair[0].point).norm() - 0.01).abs() < 1e-9));
    let volume: f64 = (0..on.targets.len()).map(|k| on.plan.volume(k)).sum();
    let expected = 1e-8 * (on.targets.len() - 1) as f64;
    assert!((volume / expected - 1.0).abs() < 1e-9, "{volume} m^3 of {expected}");
    // It can be continued in its turn.
    let (more, _) = along_the_wall(1.0, 1.3, None);
    let again =
        continue_plan(&on.plan, &on.targets, end - 1.2, &more, &Wall::flat(), &Arm::default(), &settings).unwrap();
    assert_eq!(again.targets.last().unwrap().point.y, more.last().unwrap().point.y);
}

/// A vehicle that has gone round once, and looks at the wall at 360 degrees: it goes on from there, and does not turn back to 0.
#[test]
fn a_heading_goes_on_from_the_turn_it_is_in() {
    use std::f64::consts::TAU;
    let (_, plain) = along_the_wall(0.0, 0.5, None);
    let start = VehicleState { heading: plain.vehicle[0].heading + TAU, ..plain.vehicle[0] };
    let (targets, flying) = along_the_wall(0.0, 0.5, Some(start));
    let (next, _) = along_the_wall(0.5, 1.0, None);
    let earliest = flying.trajectory.duration() - 1.2;
    let on = continue_plan(&flying, &targets, earliest, &next, &Wall::flat(), &Arm::default(), &Settings::default())
        .unwrap();
    let begin = flying.trajectory.sample(on.at).heading;
    assert!((begin - TAU).abs() < 1.0, "{begin}");
    let end = on.plan.trajectory.duration();
    for k in 0..=200 {
        let heading = on.plan.trajectory.sample(end * f64::from(k) / 200.0).heading;
        assert!((heading - begin).abs() < 1.0, "{heading} after {begin}");
    }
}

#[test]
fn a_plan_that_cannot_go_on_says_so() {
    let (targets, flying) = along_the_wall(0.0, 0.3, None);
    let (next, _) = along_the_wall(0.3, 0.6, None);
    let on = |earliest, next: &[Target]| {
        continue_plan(&flying, &targets, earliest, next, &Wall::flat(), &Arm::default(), &Settings::default())
    };
    // Too late; a place behind the wall.
    assert!(matches!(on(flying.trajectory.duration(), &next), Err(Error::Continuation { .. })));
    let hidden: Vec<Target> = next.iter().map(|t| Target { normal: -t.normal, ..*t }).collect();
    assert!(on(flying.trajectory.duration() - 1.0, &hidden).is_err());
}
