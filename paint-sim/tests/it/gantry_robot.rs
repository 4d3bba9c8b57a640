//! What the sensors of a handheld robot say of motions in closed form, and where the hand goes.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use paint_sim::gantry_robot::{
    HandMotion, HandSettings, InertialSensor, InertialSensorSettings, Pass, RangeSensor, RangeSensorSettings,
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
