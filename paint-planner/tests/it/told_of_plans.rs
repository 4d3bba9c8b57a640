//! What a plan tells of itself: which limits bind, and how much of a stroke is painted when.

use paint_planner::plan::Setpoint;
use paint_planner::teleop::Flight;
use paint_planner::timing::{TimingPolicy, TimingSettings};
use paint_planner::{Settings, plan};

use crate::walls::{Arm, Wall};

/// Only the limit that is given is near: it binds for as long as what it limits is as large as it may be.
#[test]
fn the_limit_that_binds_is_told_by_its_share_of_the_time() {
    let wall = Wall::flat();
    let targets = wall.rows(2.0, 2, 0.3);
    let plan = plan(&targets, &wall, &Arm::default(), &Settings::default()).unwrap();
    let far = TimingSettings {
        policy: TimingPolicy::GradientPreserving,
        max_speed: 1e3,
        max_acceleration: 1e3,
        max_spray_acceleration: 1e3,
        max_heading_rate: 1e3,
        max_joint_rate: 1e3,
        max_flow: 1e3,
        ..Settings::default().timing
    };
    let setpoints: Vec<_> = plan.setpoints(0.02).map(|(_, setpoint)| setpoint).collect();
    let share = |of: &dyn Fn(&Setpoint) -> bool| {
        setpoints.iter().filter(|setpoint| of(setpoint)).count() as f64 / setpoints.len() as f64
    };
    let sprays = |setpoint: &Setpoint| setpoint.flow > 0.0;
    let longest = setpoints.chunk_by(|a, b| sprays(a) && sprays(b)).map(<[_]>::len).max().unwrap();
    let none = plan.binding_limits(&far);
    assert_eq!((none.none, none.spot_speed + none.flow + none.speed), (1.0, 0.0));
    assert!((none.longest_spraying_without - 0.02 * longest as f64).abs() < 1e-9, "{none:?}");

    // Nine tenths of the limit is as large as it may be.
    let flow = plan.flow.iter().copied().fold(0.0, f64::max);
    let by_flow = plan.binding_limits(&TimingSettings { max_flow: flow, ..far.clone() });
    let expected = share(&|setpoint| setpoint.flow > 0.9 * flow);
    assert!(expected > 0.1 && expected < 0.9 && (by_flow.flow - expected).abs() < 1e-9, "{by_flow:?} {expected}");
    assert!((by_flow.none - (1.0 - expected)).abs() < 1e-9);
    let speed = plan.report.extrema.speed;
    let by_speed = plan.binding_limits(&TimingSettings { max_speed: speed, ..far.clone() });
    let expected = share(&|setpoint| setpoint.sample.velocity.norm() > 0.9 * speed);
    assert!(expected > 0.1 && (by_speed.speed - expected).abs() < 1e-9, "{by_speed:?} {expected}");
    // The limit of spraying holds while there is spray.
    let by_spray = plan.binding_limits(&TimingSettings { max_spray_acceleration: 1e-9, ..far });
    let expected = share(&|setpoint| sprays(setpoint) && setpoint.sample.acceleration.norm() > 0.9e-9);
    assert!(expected > 0.1 && (by_spray.acceleration - expected).abs() < 1e-9, "{by_spray:?} {expected}");
}

/// Between two targets the share of a stroke that is painted grows with time.
#[test]
fn a_flight_tells_how_much_of_its_stroke_is_painted() {
    let wall = Wall::flat();
    let targets = wall.rows(1.0, 1, 0.2);
    let plan = plan(&targets, &wall, &Arm::default(), &Settings::default()).unwrap();
    let (times, duration, last) = (plan.target_time.clone(), plan.trajectory.duration(), targets.len() - 1);
    let pattern = Some([2.0, 3.0]);
    let flight = Flight { number: 0, begin: 5.0, plan, targets, stand_off: 0.1, colour: 0, pattern, takes_over: false };
    for (k, share) in [(0, 0.1), (7, 0.5), (last - 1, 0.9)] {
        let painted = flight.painted(5.0 + times[k] + share * (times[k + 1] - times[k])).unwrap();
        assert!((painted - (2.0 + 3.0 * (k as f64 + share) / last as f64)).abs() < 1e-9, "{k} {share}: {painted}");
    }
    assert_eq!([0.0, 1e3].map(|now| flight.painted(now)), [Some(2.0), Some(5.0)]);
    assert!((flight.end() - 5.0 - duration).abs() < 1e-12);
}
