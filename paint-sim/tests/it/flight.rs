//! The closed loop: the figures of a painting flight, and the laws of its parts.

mod interlock;

use nalgebra::{Point3, Vector3};
use paint_sim::flight::*;
use paint_sim::{Error, FlightSettings, Shot, fly};

use crate::flight_scene::{outdoors, paint_hose, wall};
use crate::own_pan_tilt::{LaggingPanTilt, arm};
use crate::own_reference::{Ellipse, Still};

fn still() -> ReferenceState {
    let zero = Vector3::zeros();
    ReferenceState { velocity: zero, acceleration: zero, ..Ellipse { duration: 1.0 }.at(0.0) }
}

#[test]
fn the_spray_stays_on_its_line_in_wind() {
    for seed in 0..4 {
        let reference = Ellipse { duration: 60.0 };
        let log = fly(&reference, &mut arm(), &wall(), &outdoors(seed)).unwrap();
        let figures = log.statistics();
        assert_eq!((figures.open_samples, figures.missed_samples, log.samples.len()), (6001, 0, 6001));
        assert!(figures.hit_error_rms < 0.004 && figures.hit_error_p95 < 0.008, "{figures:?}");
        assert!(figures.nozzle_distance_std < 0.008, "{figures:?}");
        assert!(figures.localisation_error_rms < 0.004, "{figures:?}");
        let locked = FlightSettings { ptu_locked: true, ..outdoors(seed) };
        let locked = fly(&reference, &mut arm(), &wall(), &locked).unwrap().statistics();
        assert!(locked.hit_error_rms > 3.0 * figures.hit_error_rms, "{locked:?}");
    }
}

#[test]
fn without_disturbance_it_is_exact_and_with_slam_it_is_not() {
    let reference = Ellipse { duration: 30.0 };
    let calm =
        FlightSettings { wind: Wind::calm(), localisation: Localisation::perfect(), ..FlightSettings::default() };
    let log = fly(&reference, &mut LaggingPanTilt::new(0.0), &wall(), &calm).unwrap();
    // The reference starts with a jump to 0.4 m/s; after it the loop must have forgotten everything.
    let figures = FlightStatistics::of(&[&log.samples[500..]]);
    assert!(figures.hit_error_rms < 5e-4 && figures.position_error_rms < 3e-3, "{figures:?}");

    let slam = FlightSettings { localisation: Localisation::slam_7cm(), ..outdoors(1) };
    let figures = fly(&Ellipse { duration: 600.0 }, &mut arm(), &wall(), &slam).unwrap().statistics();
    // 60 time constants of the drift: its RMS is 7 cm within about 10 %.
    assert!((figures.localisation_error_rms - 0.07).abs() < 0.017, "{figures:?}");
    assert!(figures.hit_error_rms > 0.03, "{figures:?}");
}

#[test]
fn a_wrong_model_of_the_vehicle_is_forgiven() {
    let settings = outdoors(5);
    let airframe = Airframe {
        mass: 4.6,
        roll_time_constant: 0.15,
        pitch_time_constant: 0.21,
        pitch_gain: 0.85,
        drag: [0.1, 0.5, 0.0],
        ..settings.airframe
    };
    let mut controller = CascadedController::new(airframe, ControllerSettings::default());
    let reference = Ellipse { duration: 40.0 };
    let figures = fly_with(&reference, &mut controller, &mut arm(), &wall(), &settings).unwrap().statistics();
    assert!(figures.hit_error_rms < 0.006 && figures.nozzle_distance_std < 0.012, "{figures:?}");
}

/// In a steady wind the body leans by `atan(drag v / g)`, and a gun on an arm would sink by its sine.
#[test]
fn the_gun_stays_in_its_place_when_the_body_leans_against_the_wind() {
    let arm_length = 0.5;
    let reference = ReferenceState { lever: Vector3::new(arm_length, 0.0, 0.0), ..still() };
    let settings = FlightSettings {
        wind: Wind { mean: Vector3::new(3.0, 0.0, 0.0), ..Wind::calm() },
        localisation: Localisation::perfect(),
        settle: 10.0,
        ..FlightSettings::default()
    };
    let lean = (settings.airframe.drag[0] * 3.0 / 9.80665).atan();
    let displaced = |lever_rate: f64| {
        let gains = ControllerSettings { lever_rate, ..ControllerSettings::default() };
        let mut controller = CascadedController::new(settings.airframe, gains);
        let log = fly_with(&Still(reference), &mut controller, &mut arm(), &wall(), &settings).unwrap();
        let gun = log.samples[0].world_from_body * Point3::new(arm_length, 0.0, 0.0);
        gun - (reference.position + reference.lever)
    };
    let left = displaced(0.0);
    // Against a wind from behind the body leans back: the nose rises.
    assert!((left.z - arm_length * lean.sin()).abs() < 2e-3, "{left}");
    let held = displaced(3.0);
    assert!(held.norm() < 1e-3, "{held}");
}

#[test]
fn the_same_seed_is_the_same_flight() {
    let run = |seed| fly(&Ellipse { duration: 5.0 }, &mut arm(), &wall(), &outdoors(seed)).unwrap();
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn every_noise_follows_the_seed() {
    let gusts = Wind { gust_sigma: 0.5, ..Wind::calm() };
    let exact = Localisation::perfect();
    let cases = [
        ("gusts", gusts, exact),
        ("white position noise", Wind::calm(), Localisation { position_noise: 0.003, ..exact }),
        ("white attitude noise", Wind::calm(), Localisation { attitude_noise: 0.003, ..exact }),
        ("position drift", Wind::calm(), Localisation { position_drift: 0.003, ..exact }),
        ("attitude drift", Wind::calm(), Localisation { attitude_drift: 0.003, ..exact }),
    ];
    let run = |wind, localisation, seed| {
        let settings = FlightSettings { wind, localisation, seed, settle: 0.5, ..FlightSettings::default() };
        fly(&Ellipse { duration: 1.0 }, &mut arm(), &wall(), &settings).unwrap()
    };
    for (name, wind, localisation) in cases {
        assert_eq!(run(wind, localisation, 7), run(wind, localisation, 7), "{name}");
        assert_ne!(run(wind, localisation, 7), run(wind, localisation, 8), "{name} is the same for every seed");
    }
    // Without any of them the seed means nothing.
    assert_eq!(run(Wind::calm(), exact, 7), run(Wind::calm(), exact, 8));
}

#[test]
fn the_log_holds_the_sprayed_volume() {
    let log = fly(&Still(still()), &mut arm(), &wall(), &FlightSettings::default()).unwrap();
    let volume: f64 = log.shots(0.0).iter().map(|shot| shot.volume).sum();
    assert!((volume - 5e-7 * 0.01 * 201.0).abs() < 1e-18);
    // A valve that is not led opens later by its dead time; nothing is sprayed before the reference begins.
    let valve = Valve { dead_time: 0.3, lead: 0.0, ..Valve::default() };
    let late = fly(&Still(still()), &mut arm(), &wall(), &FlightSettings { valve, ..FlightSettings::default() });
    assert_eq!(late.unwrap().samples.iter().position(|s| s.flow > 0.0), Some(30));
}

#[test]
fn shots_of_a_longer_step_carry_the_same_paint() {
    let log = fly(&Ellipse { duration: 5.0 }, &mut arm(), &wall(), &outdoors(3)).unwrap();
    let (each, merged) = (log.shots(0.0), log.shots(0.01));
    assert_eq!(each.len(), log.samples.iter().filter(|s| s.flow > 0.0).count());
    assert!(merged.len() * 2 < each.len() && !merged.is_empty());
    let total = |shots: &[Shot]| shots.iter().map(|s| s.volume).sum::<f64>();
    assert!((total(&each) / total(&merged) - 1.0).abs() < 1e-12);
    let mean = |shots: &[Shot]| shots.iter().map(|s| s.origin.coords * s.volume).sum::<Vector3<f64>>() / total(shots);
    assert!((mean(&each) - mean(&merged)).norm() < 1e-12);
    for pair in merged.windows(2) {
        assert!((pair[1].origin - pair[0].origin).norm() < 0.03, "no gaps");
    }
}

#[test]
fn the_hose_pulls_as_a_catenary() {
    // Solved independently by bisection in Python, with 9.81 m/s^2.
    let gravity = GRAVITY / 9.81;
    let hose = HoseModel { base_on_floor: false, ..paint_hose() };
    let ends = hose.catenary(1.5, 2.6).unwrap();
    for (value, expected) in [
        (ends.parameter, 0.2719322),
        (ends.horizontal, 0.3201185 * gravity),
        (ends.vertical_top, 4.4857186 * gravity),
        (ends.vertical_bottom, -1.4002814 * gravity),
    ] {
        assert!((value - expected).abs() < 6e-8, "{ends:?}");
    }
    let weight = 0.12 * 5.0 * GRAVITY;
    let mut horizontal = 4.2;
    while horizontal > 1e-9 {
        let ends = hose.catenary(horizontal, 2.6).unwrap();
        assert!((ends.vertical_top - ends.vertical_bottom - weight).abs() < 1e-9 * (1.0 + ends.vertical_top));
        horizontal *= 0.7;
    }
    // Straight above: half of (L + h) hangs on the vehicle.
    assert!((hose.catenary(0.0, 2.6).unwrap().vertical_top - 0.5 * 0.12 * GRAVITY * 7.6).abs() < 1e-12);
    let pull = hose.force(&Point3::new(-1.0, 0.0, 2.6)).unwrap();
    assert!((pull - Vector3::new(-0.3201185, 0.0, -4.4857186) * gravity).amax() < 6e-8);
    // On a floor the slack lies down.
    let lying = paint_hose().force(&Point3::new(-1.0, 0.0, 2.6)).unwrap();
    assert!((lying - Vector3::new(0.0, 0.0, -0.12 * GRAVITY * 2.6)).amax() < 1e-12);
    for (l, h) in [(5.0, 0.0), (4.0, 3.0), (1.0, 6.0)] {
        assert!(matches!(hose.catenary(l, h), Err(Error::HoseTooShort { .. })));
    }
}

#[test]
fn attitude_follows_with_its_first_order_lag() {
    let airframe = Airframe::default();
    let mut vehicle = Vehicle::at_rest(Point3::origin(), 0.5);
    let command = Command { roll: 0.1, pitch: -0.2, yaw_rate: 0.3, thrust: 0.0 };
    let zero = Vector3::zeros();
    for _ in 0..250 {
        vehicle.step(&airframe, &command, &zero, &zero, 1e-3);
    }
    let reached = |lag: f64| 1.0 - (-0.25 / lag).exp();
    assert!((vehicle.attitude[0] - 1.017 * 0.1 * reached(0.1847)).abs() < 1e-14);
    assert!((vehicle.attitude[1] + 0.789 * 0.2 * reached(0.175)).abs() < 1e-14);
    assert!((vehicle.yaw_rate - 0.3 * reached(0.15)).abs() < 1e-14);
    assert!((vehicle.attitude[2] - (0.5 + 0.3 * (0.25 - 0.15 * reached(0.15)))).abs() < 1e-13);
}

#[test]
fn drag_carries_the_vehicle_with_the_wind() {
    let airframe = Airframe::default();
    let mut vehicle = Vehicle::at_rest(Point3::origin(), 0.0);
    let command = Command { thrust: airframe.mass * GRAVITY, ..Command::default() };
    let wind = Vector3::new(3.0, -1.0, 0.5);
    for _ in 0..2000 {
        vehicle.step(&airframe, &command, &wind, &Vector3::zeros(), 1e-3);
    }
    // v' = -d (v - w), up to the step of the integrator.
    for i in 0..3 {
        let expected = wind[i] * (1.0 - (-airframe.drag[i] * 2.0).exp());
        assert!((vehicle.velocity[i] - expected).abs() < 2e-4 * wind[i].abs());
    }
    // A force of one newton sideways accelerates by F/m.
    let mut pushed = Vehicle::at_rest(Point3::origin(), 0.0);
    pushed.step(&airframe, &command, &Vector3::zeros(), &Vector3::y(), 1e-3);
    assert!((pushed.acceleration - Vector3::y() / 4.2).amax() < 1e-15);
}

#[test]
fn the_pan_tilt_unit_hits_what_it_is_told_to() {
    let unit = IdealPanTilt::default();
    let body = Vehicle { attitude: [0.1, -0.2, 2.0], ..Vehicle::at_rest(Point3::new(1.0, 2.0, 3.0), 0.0) };
    let body = body.world_from_body();
    let aim = body * Point3::new(0.9, 0.15, -0.1);
    let angles = unit.command(&body, &aim);
    let (tip, axis) = unit.nozzle(&body, angles);
    assert!((aim - tip).cross(&axis).norm() < 1e-14 && (aim - tip).dot(&axis) > 0.0);
    // Positive pan is to the left, positive tilt upwards.
    assert!(angles[0] > 0.0 && angles[1] < 0.0);
    // Behind its back it stops at the limits.
    let limits = [90.0_f64.to_radians(), 45.0_f64.to_radians()];
    assert_eq!(unit.command(&body, &(body * Point3::new(-5.0, 0.1, 50.0))), limits);
}

#[test]
fn bad_flights_are_refused() {
    let run = |state: ReferenceState, settings: &FlightSettings| {
        fly(&Still(state), &mut arm(), &wall(), settings).unwrap_err()
    };
    let good = FlightSettings::default();
    let nan = ReferenceState { heading: f64::NAN, ..still() };
    assert!(matches!(run(nan, &good), Error::BadCallback { who: "the reference", .. }));
    let odd = FlightSettings { log_rate: 3, ..good };
    assert!(matches!(run(still(), &odd), Error::OutOfRange { what: "log_rate", .. }));
    let massless = FlightSettings { airframe: Airframe { mass: 0.0, ..good.airframe }, ..good };
    assert!(matches!(run(still(), &massless), Error::OutOfRange { what: "airframe.mass", .. }));
    let short = FlightSettings { hose: Some(HoseModel { length: 1.0, ..paint_hose() }), ..good };
    assert!(matches!(run(still(), &short), Error::HoseTooShort { .. }));
    let storm = FlightSettings { wind: Wind { mean: Vector3::new(0.0, 90.0, 0.0), ..good.wind }, ..good };
    assert!(matches!(run(still(), &storm), Error::Diverged { .. }));
}

/// The gains of an observer whose poles are all at `z = exp(-w dt)` (three of translation, two of yaw, one of roll and pitch): what one
/// pose changes in an estimate at rest.
#[test]
fn one_pose_changes_the_estimate_by_the_gains_of_its_poles() {
    let (dt, settings) = (0.02, ObserverSettings::default());
    let start = nalgebra::Isometry3::translation(1.0, 2.0, 3.0);
    let mut estimator = Estimator::new(Airframe::default(), settings, &start);
    let (shift, [roll, pitch, yaw]) = (Vector3::new(0.01, -0.02, 0.03), [0.02, -0.01, 0.04]);
    let turned = nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    estimator.update(&nalgebra::Isometry3::from_parts((start.translation.vector + shift).into(), turned), dt);
    let found = *estimator.estimate();
    let z = (-settings.translation * dt).exp();
    let near = |a: Vector3<f64>, b: Vector3<f64>| assert!((a - b).norm() < 1e-9 * b.norm(), "{a} {b}");
    near(found.position.coords - start.translation.vector, shift * (1.0 - z.powi(3)));
    near(found.velocity, shift * (1.5 * (1.0 - z).powi(2) * (1.0 + z) / dt));
    near(found.disturbance, shift * ((1.0 - z).powi(3) / (dt * dt)));
    let z = (-settings.attitude * dt).exp();
    near(Vector3::from(found.attitude), Vector3::new((1.0 - z) * roll, (1.0 - z) * pitch, (1.0 - z * z) * yaw));
    assert!((found.yaw_rate - (1.0 - z).powi(2) / dt * yaw).abs() < 1e-9, "{}", found.yaw_rate);
}
