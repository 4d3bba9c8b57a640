//! The hardware of a handheld robot: its sensors on motions in closed form, its slide and valve, and where the hand goes.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use paint_sim::gantry_robot::{
    HandMotion, HandSettings, InertialSensor, InertialSensorSettings, Pass, PoseSensor, PoseSensorSettings,
    RangeSensor, RangeSensorSettings, Stepper, StepperSettings, Valve, ValveSettings,
};
use paint_sim::surface::{Hit, Surface};

/// A turn at a constant rate about the robot's own axis, on a circle: the sensor says the rate, and the pull to the middle.
#[test]
fn an_inertial_sensor_says_its_own_rates_and_forces() {
    let silent = InertialSensorSettings { force_sigma: 0.0, force_bias: 0.0, rate_sigma: 0.0, rate_bias: 0.0 };
    let mut sensor = InertialSensor::new(silent, 1).unwrap();
    let (rate, radius) = (0.8, 0.5);
    let motion = |t: f64| {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rate * t);
        Isometry3::from_parts((turned * Vector3::x() * radius).into(), turned)
    };
    for time in [0.0, 1.7, 3.1] {
        let reading = sensor.measure(&motion, time);
        assert!((reading.angular_velocity - Vector3::z() * rate).norm() < 1e-9, "{}", reading.angular_velocity);
        let expected = Vector3::new(-rate * rate * radius, 0.0, 9.80665);
        assert!((reading.specific_force - expected).norm() < 1e-4, "{}", reading.specific_force);
    }
}

/// The wall x = 0.25 for who looks along x.
struct Wall;

impl Surface for Wall {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        let distance = (0.25 - origin.x) / direction.x;
        let hit = Hit { distance, face: 0, barycentric: [0.0; 2], normal: -Vector3::x() };
        (0.0..=max).contains(&distance).then_some(hit)
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        (0.25 - point.x).abs().min(max)
    }
}

/// Ten beams, two fans of five across each other, from a robot that stands askew: each says how far the wall is along it, no farther than its
/// range.
#[test]
fn a_range_sensor_sees_along_its_beams_as_far_as_its_range() {
    let settings = RangeSensorSettings { sigma: 0.0, ..RangeSensorSettings::default() };
    let mut sensor = RangeSensor::new(settings, 3).unwrap();
    let aside: Vec<f64> = sensor.directions().iter().map(|d| (d.y / d.x).atan() + (d.z / d.x).atan()).collect();
    // From -25 to 25 degrees: the middles of five equal parts.
    for (k, angle) in aside.iter().enumerate() {
        assert!((angle.to_degrees() - (10.0 * (k / 2) as f64 - 20.0)).abs() < 1e-9, "beam {k}: {angle}");
    }
    let pose = Isometry3::new(Vector3::new(0.02, 0.4, 1.0), Vector3::new(0.0, 0.1, -0.15));
    let (mut seen, mut beyond) = (0, 0);
    let measured = sensor.measure(&pose, &Wall);
    for (direction, distance) in sensor.directions().iter().zip(measured) {
        let expected = 0.23 / (pose.rotation * direction.into_inner()).x;
        match distance {
            Some(distance) => assert!((distance - expected).abs() < 1e-12 && expected <= 0.3),
            None => assert!(expected > 0.3),
        }
        seen += usize::from(distance.is_some());
        beyond += usize::from((0.25..=0.3).contains(&expected));
    }
    assert!(seen == 10 && beyond > 0, "{seen} {beyond}");
    let far = Isometry3::translation(-0.04, 0.0, 0.0);
    let seen: Vec<bool> = sensor.measure(&far, &Wall).iter().map(Option::is_some).collect();
    // 0.29 m ahead; 0.3 m at 14.8 degrees aside.
    let expected: Vec<bool> = aside.iter().map(|angle| angle.to_degrees().abs() < 14.8).collect();
    assert_eq!(seen, expected);
}

/// Between two places the hand comes back from the object, which is ahead along x, and never nearer than either of them.
#[test]
fn a_hand_retreats_between_two_places() {
    let steady = HandSettings { sway: 0.0, turn: 0.0, tremor: 0.0, ..HandSettings::default() };
    let pass = |z: f64| Pass { middle: Isometry3::translation(-0.3, 0.0, z), half_width: 0.03, duration: 2.0 };
    let hand = HandMotion::new(&[pass(0.0), pass(0.2)], steady, 1).unwrap();
    let x = |k: u32| hand.at(f64::from(k) * 1e-3).translation.x;
    let last = (hand.duration() / 1e-3) as u32;
    let (nearest, farthest) = (0..last).map(x).fold((f64::MIN, f64::MAX), |(n, f), x| (n.max(x), f.min(x)));
    assert!((nearest + 0.3).abs() < 1e-12 && (farthest + 0.45).abs() < 1e-6, "{nearest} {farthest}");
}

#[test]
fn the_valve_answers_late() {
    let mut valve =
        Valve::new(ValveSettings { open_delay: 4e-3, close_delay: 2e-3, ..ValveSettings::default() }).unwrap();
    valve.command(0.0, true);
    assert!((valve.open_share(0.0, 0.01) - 0.6).abs() < 1e-9);
    valve.command(0.01, false);
    assert!((valve.open_share(0.01, 0.02) - 0.2).abs() < 1e-9);
    // Told to open and at once to shut: it never opens.
    valve.command(0.02, true);
    valve.command(0.021, false);
    assert_eq!((valve.open_share(0.02, 0.03), valve.switched), (0.0, 4));
}

/// The integral of the flow in closed form: of bursts that open it wholly, of one too short for that, and of one that is shut again before it has
/// fallen.
#[test]
fn a_valve_ramps_and_passes_what_its_ramps_say() {
    let settings = ValveSettings { open_delay: 7.3e-3, close_delay: 4.1e-3, rise: 12e-3, fall: 20e-3 };
    for interval in [1e-3, 5e-3, 10e-3] {
        for (commands, flow) in [(60, 2e-6), (8, 1e-6), (1, 1e-6)] {
            let burst = f64::from(commands) * interval;
            let passed: f64 =
                settings.through(&vec![flow; commands as usize], interval).unwrap().iter().sum::<f64>() * interval;
            // It opens for the burst, longer by the difference of the delays.
            let opens = (burst + 4.1e-3 - 7.3e-3).max(0.0);
            let peak = (opens / 12e-3).min(1.0);
            let closed = flow * (opens * peak - 0.5 * peak * peak * 12e-3 + 0.5 * peak * peak * 20e-3);
            let closed = if peak < 1.0 { flow * (0.5 * opens * peak + 0.5 * peak * peak * 20e-3) } else { closed };
            assert!((passed - closed).abs() < 1e-9 * flow, "{interval} {commands}: {passed} {closed}");
        }
    }
    // Half shut when it opens again: up from there.
    let mut valve = Valve::new(ValveSettings { open_delay: 0.0, close_delay: 0.0, rise: 0.1, fall: 0.2 }).unwrap();
    valve.command(0.0, true);
    assert!((valve.open_share(0.0, 0.1) - 0.5).abs() < 1e-12 && (valve.open_share(0.1, 0.2) - 1.0).abs() < 1e-12);
    valve.command(0.2, false);
    assert!((valve.open_share(0.2, 0.3) - 0.75).abs() < 1e-12);
    valve.command(0.3, true);
    assert!((valve.open_share(0.3, 0.4) - 0.875).abs() < 1e-12 && valve.open_share(0.4, 0.5) == 1.0);
}

/// A new flow comes as late as an opening does; while it shuts it passes the last.
#[test]
fn a_flow_that_changes_comes_late_too() {
    let settings = ValveSettings { open_delay: 0.025, close_delay: 0.025, rise: 0.0, fall: 0.02 };
    let passed = settings.through(&[0.0, 4.0, 4.0, 1.0, 0.0, 0.0, 0.0], 0.01).unwrap();
    // Open from 35 to 65 ms with the flow of 25 ms ago, then down from 1 in 20 ms.
    let expected = [0.0, 0.0, 0.0, 2.0, 4.0, 2.5, 1.0 * 0.5 + 0.5 * 0.875, 0.5, 0.0625, 0.0];
    for (k, expected) in expected.iter().enumerate() {
        assert!((passed[k] - expected).abs() < 1e-12, "{k}: {passed:?}");
    }
    assert!(settings.through(&[f64::NAN], 0.01).is_err() && settings.through(&[1.0], 0.0).is_err());
    assert!(settings.through(&[], 0.01).unwrap().iter().all(|flow| *flow == 0.0));
}

#[test]
fn the_slide_keeps_its_limits_and_stops_at_its_ends() {
    let settings = StepperSettings::default();
    let mut stepper = Stepper::new(settings, 0.05).unwrap();
    let (mut speed, dt) = (0.0, 5e-3);
    for k in 0..400 {
        let target = if k < 100 { 0.09 } else { 0.02 };
        stepper.step(target, 0.0, dt);
        assert!((stepper.speed() - speed).abs() <= settings.max_acceleration * dt + 1e-12);
        assert!(stepper.speed().abs() <= settings.max_speed + 1e-12);
        speed = stepper.speed();
        // Hardly farther than where it is told to go: it brakes before.
        assert!((0.02 - 1e-3..=0.09 + 1e-3).contains(&stepper.position()), "{}", stepper.position());
        if k == 99 {
            assert!((stepper.position() - 0.09).abs() < 1e-4, "{}", stepper.position());
        }
    }
    assert!((stepper.position() - 0.02).abs() < 1e-4 && stepper.limit_hits == 0);
    let steps = stepper.position() / settings.step;
    assert!((steps - steps.round()).abs() < 1e-6);
    (0..100).for_each(|_| stepper.step(-0.05, 0.0, dt));
    assert_eq!((stepper.position(), stepper.limit_hits), (0.0, 1));
}

#[test]
fn sensors_are_as_noisy_as_they_say_and_the_seed_decides() {
    let pose = Isometry3::translation(0.1, 0.2, 0.3);
    let settings = PoseSensorSettings { loss_rate: 1.0, loss_duration: 0.2, ..PoseSensorSettings::default() };
    let run = |seed: u64| {
        let mut sensor = PoseSensor::new(settings, seed).unwrap();
        (0..20_000).map(|k| sensor.measure(&pose, f64::from(k) * 0.01, 0.01)).collect::<Vec<_>>()
    };
    let seen = run(1);
    assert!(seen == run(1) && seen != run(2));
    let found: Vec<_> = seen.iter().flatten().collect();
    let squared: f64 = found.iter().map(|p| (p.translation.vector - pose.translation.vector).norm_squared()).sum();
    assert!(((squared / 3.0 / found.len() as f64).sqrt() / 2e-3 - 1.0).abs() < 0.03);
    let turned: f64 = found.iter().map(|p| p.rotation.angle().powi(2)).sum();
    let sigma = (turned / 3.0 / found.len() as f64).sqrt();
    assert!((sigma.to_degrees() / 0.2 - 1.0).abs() < 0.03, "{} degrees", sigma.to_degrees());
    // Gaps of 0.2 s begin once a second of tracking: a sixth of the time is lost.
    let lost = 1.0 - found.len() as f64 / 20_000.0;
    assert!((lost - 1.0 / 6.0).abs() < 0.035, "{lost}");
}

#[test]
fn the_hand_sweeps_as_wide_and_as_fast_as_it_is_told() {
    let steady = HandSettings { sway: 0.0, turn: 0.0, tremor: 0.0, ..HandSettings::default() };
    let pass = |x: f64| Pass { middle: Isometry3::translation(x, 0.0, 0.0), half_width: 0.03, duration: 10.0 };
    let hand = HandMotion::new(&[pass(0.0), pass(0.1)], steady, 1).unwrap();
    let y = |t: f64| hand.at(t).translation.y;
    let times = || (0..9000).map(|k| f64::from(k) * 1e-3);
    let widest = times().map(|t| y(t).abs()).fold(0.0, f64::max);
    let fastest = times().map(|t| (y(t + 1e-3) - y(t)).abs() / 1e-3).fold(0.0, f64::max);
    assert!((widest - 0.03).abs() < 1e-6 && (fastest - 0.1).abs() < 1e-4);
    // Every part takes as long as the one before it, with the change to it.
    let [one, two, three] = [1, 2, 3].map(|parts| {
        let passes: Vec<_> = (0..parts).map(|k| pass(0.1 * f64::from(k))).collect();
        HandMotion::new(&passes, steady, 1).unwrap().duration()
    });
    assert!(two > one + 5.0 && (three - two - (two - one)).abs() < 1e-9, "{one} {two} {three}");
    // No jumps, also not from one part to the next, and an inertial sensor at rest feels gravity.
    let whole = (hand.duration() / 1e-3) as i32;
    let moved = |k: i32| {
        (hand.at(f64::from(k + 1) * 1e-3).translation.vector - hand.at(f64::from(k) * 1e-3).translation.vector).norm()
    };
    assert!((0..whole).map(moved).fold(0.0, f64::max) < 4e-4);
    let silent = InertialSensorSettings { force_sigma: 0.0, force_bias: 0.0, rate_sigma: 0.0, rate_bias: 0.0 };
    let mut sensor = InertialSensor::new(silent, 1).unwrap();
    let turned = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.5);
    let motion = |t: f64| Isometry3::from_parts(Vector3::new(0.0, 0.0, 0.5 * t * t).into(), turned);
    let reading = sensor.measure(&motion, 3.0);
    assert!((turned * reading.specific_force - Vector3::new(0.0, 0.0, 10.80665)).norm() < 1e-6);
}
