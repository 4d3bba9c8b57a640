//! Faults of a flight, and the valve that shuts because of them.

use nalgebra::Vector3;
use paint_sim::flight::*;
use paint_sim::{Error, FlightSettings, fly};

use super::{Ellipse, arm, outdoors, still, wall};

/// Outdoors with an interlock, and a valve that follows at once.
fn interlocked(seed: u64, faults: Faults) -> FlightSettings {
    let valve = Valve { dead_time: 0.0, lead: 0.0, interlock: Some(Interlock::default()) };
    FlightSettings { valve, faults, ..outdoors(seed) }
}

/// Stands still and sweeps the spray over the wall, to and fro.
struct Sweep {
    /// How far, m, and its angular frequency, rad/s.
    swing: f64,
    rate: f64,
}

const SLOW: Sweep = Sweep { swing: 0.08, rate: 0.8 };

impl Reference for Sweep {
    fn duration(&self) -> f64 {
        6.0
    }

    fn at(&self, t: f64) -> ReferenceState {
        let state = still();
        let to = self.swing * (self.rate * t).sin();
        ReferenceState { aim: state.aim.map(|aim| aim + Vector3::new(0.0, to, 0.0)), ..state }
    }
}

/// Whether the spray misses its aim, or is too near or too far, by a centimetre more than the interlock permits: its estimate lags.
fn beyond(sample: &FlightSample) -> bool {
    let ray = sample.aim.unwrap() - sample.nozzle;
    ray.cross(&sample.axis).norm() > 0.025 || (ray.dot(&sample.axis) - sample.wanted_distance).abs() > 0.06
}

#[test]
fn in_the_usual_wind_the_interlock_changes_nothing() {
    let reference = Ellipse { duration: 60.0 };
    let valve = Valve { interlock: Some(Interlock::default()), ..Valve::default() };
    for seed in 0..10 {
        let with = fly(&reference, &mut arm(), &wall(), &FlightSettings { valve, ..outdoors(seed) }).unwrap();
        assert_eq!(with, fly(&reference, &mut arm(), &wall(), &outdoors(seed)).unwrap());
        assert_eq!(with.statistics().held_samples, 0);
    }
}

#[test]
fn without_a_pose_the_valve_is_shut() {
    let faults = Faults { pose_lost: Some(3.0), ..Faults::default() };
    let reference = Ellipse { duration: 5.0 };
    let log = fly(&reference, &mut arm(), &wall(), &interlocked(1, faults)).unwrap();
    for sample in &log.samples {
        let lost = sample.time > 3.0 - 1e-9;
        assert_eq!((sample.flow > 0.0, sample.held), (!lost, lost), "at {}", sample.time);
    }
    assert_eq!(log.statistics().held_samples, 201);
    // Paint follows the command after the valve's dead time.
    let late = Valve { dead_time: 0.05, lead: 0.05, interlock: Some(Interlock::default()) };
    let late = FlightSettings { valve: late, ..interlocked(1, faults) };
    let log = fly(&reference, &mut arm(), &wall(), &late).unwrap();
    let last = log.samples.iter().filter(|s| s.flow > 0.0).map(|s| s.time).fold(0.0, f64::max);
    assert!((last - 3.04).abs() < 1e-9, "{last}");
}

/// At 3 s the localisation takes the robot to be 4 cm farther to a side: the valve is shut until the observer has forgotten that.
#[test]
fn after_a_jump_of_the_localisation_the_estimate_has_to_settle() {
    let shift = Vector3::new(0.0, 0.04, 0.0);
    let faults = Faults { mislocalised: Some(Mislocalised { from: 3.0, until: 9.0, shift }), ..Faults::default() };
    let reference = Ellipse { duration: 5.0 };
    let log = fly(&reference, &mut arm(), &wall(), &interlocked(1, faults)).unwrap();
    // exp(-16 t) of 4 cm is half of the miss of 1.5 cm after 0.105 s.
    let held = |from: f64, until: f64| {
        let within = log.samples.iter().filter(|s| s.time > from && s.time < until);
        (within.clone().filter(|s| s.held).count(), within.count())
    };
    assert_eq!(held(0.0, 2.995).0, 0);
    let (shut, all) = held(3.005, 3.095);
    assert!(shut == all && all >= 8, "{shut} of {all}");
    assert_eq!(held(3.5, 5.0).0, 0);
}

/// The pose is lost at 3 s, and 2 s later the flight ends with what was flown in its log.
#[test]
fn a_flight_without_a_pose_ends_and_keeps_its_log() {
    let reference = Ellipse { duration: 8.0 };
    let faults = Faults { pose_lost: Some(3.0), ..Faults::default() };
    let endless = interlocked(1, faults);
    let settings = FlightSettings { longest_without_pose: Some(2.0), ..endless };
    let mut sensor = PoseSensor::new(settings.localisation, CONTROL_STEP, settings.seed);
    let mut controller = CascadedController::new(settings.airframe, ControllerSettings::default());
    let mut log = FlightLog::default();
    let (mut gun, wall) = (arm(), wall());
    let ended = fly_recorded(&reference, &mut controller, &mut gun, &wall, &mut sensor, &settings, &mut log);
    assert!(matches!(ended, Err(Error::Localisation { time, .. }) if (time - 5.0).abs() < 0.011), "{ended:?}");
    let whole = fly(&reference, &mut arm(), &wall, &endless).unwrap();
    assert!((log.samples.len() as i64 - 500).abs() <= 1 && whole.samples.starts_with(&log.samples));
    assert!(fly(&reference, &mut arm(), &wall, &settings).is_err());
    let never = FlightSettings { longest_without_pose: Some(f64::NAN), ..settings };
    assert!(matches!(
        fly(&reference, &mut arm(), &wall, &never),
        Err(Error::OutOfRange { .. } | Error::NotFinite { .. })
    ));
}

/// A gun that does not turn misses with every gust, and its paint is held back as any other's.
#[test]
fn a_locked_gun_paints_only_where_it_happens_to_aim() {
    let reference = Ellipse { duration: 20.0 };
    let locked = FlightSettings { ptu_locked: true, ..interlocked(2, Faults::default()) };
    let log = fly(&reference, &mut arm(), &wall(), &locked).unwrap();
    let [open, held] = [log.samples.iter().filter(|s| s.flow > 0.0).count(), log.statistics().held_samples];
    assert!(open > 20 && held > 20, "{open} open, {held} held");
    assert!(log.samples.windows(2).all(|pair| !(beyond(&pair[0]) && beyond(&pair[1]) && pair[1].flow > 0.0)));
    let free = FlightSettings { valve: Valve { interlock: None, ..locked.valve }, ..locked };
    let log = fly(&reference, &mut arm(), &wall(), &free).unwrap();
    assert!(log.samples.iter().any(|s| beyond(s) && s.flow > 0.0), "nothing to prevent");
}

/// The same with a valve that is late: what is left for the prediction is enough.
#[test]
fn no_paint_leaves_more_than_a_spot_beside_its_aim() {
    let reference = Ellipse { duration: 20.0 };
    let (spot, valve) = (0.035, Valve { interlock: Some(Interlock::within(0.035)), ..Valve::default() });
    for seed in 0..10 {
        let locked = FlightSettings { ptu_locked: true, valve, ..outdoors(seed) };
        let log = fly(&reference, &mut arm(), &wall(), &locked).unwrap();
        let miss = |s: &FlightSample| (s.aim.unwrap() - s.nozzle).cross(&s.axis).norm();
        let most = log.samples.iter().filter(|s| s.flow > 0.0).map(miss).fold(0.0, f64::max);
        assert!(most > 0.5 * spot && most <= spot, "{seed}: {most} m");
    }
}

/// A valve takes 50 ms to shut: by then the spray of a joint that sticks has moved on.
#[test]
fn a_gun_that_sticks_paints_no_farther_than_a_spot_beside_its_aim() {
    let (spot, valve) = (0.025, Valve { interlock: Some(Interlock::within(0.025)), ..Valve::default() });
    for sweep in [SLOW, Sweep { swing: 0.04, rate: 4.0 }, Sweep { swing: 0.02, rate: 10.0 }] {
        let mut farthest = 0.0_f64;
        for seed in 0..40 {
            let faults = Faults { servos_stuck: Some(2.0 + 0.1 * seed as f64), ..Faults::default() };
            let flown = FlightSettings { valve, faults, ..outdoors(seed) };
            let log = fly(&sweep, &mut arm(), &wall(), &flown).unwrap();
            let miss = |s: &FlightSample| (s.aim.unwrap() - s.nozzle).cross(&s.axis).norm();
            farthest = log.samples.iter().filter(|s| s.flow > 0.0).map(miss).fold(farthest, f64::max);
        }
        assert!(farthest > 0.5 * spot && farthest <= spot, "{} m at {} rad/s: {farthest} m", sweep.swing, sweep.rate);
    }
}

#[test]
fn stuck_servos_and_gusts_beyond_the_limits_shut_the_valve() {
    let gust = Gust { time: 3.0, velocity: Vector3::new(3.0, -18.0, 0.0) };
    let cases: [(&str, &dyn Reference, Faults); 2] = [
        ("stuck", &SLOW, Faults { servos_stuck: Some(3.0), ..Faults::default() }),
        ("gust", &Ellipse { duration: 4.5 }, Faults { gust: Some(gust), ..Faults::default() }),
    ];
    for (name, reference, faults) in cases {
        for seed in 0..20 {
            let log = fly(reference, &mut arm(), &wall(), &interlocked(seed, faults)).unwrap();
            assert!(log.samples.iter().all(|s| s.time > 3.0 || !s.held), "{name} {seed}: held before the fault");
            assert!(log.samples.iter().any(beyond), "{name} {seed}: no effect");
            for pair in log.samples.windows(2) {
                let late = beyond(&pair[0]) && beyond(&pair[1]) && pair[1].flow > 0.0;
                assert!(!late, "{name} {seed}: paint misses at {}", pair[1].time);
            }
            let blind = interlocked(seed, faults);
            let blind = FlightSettings { valve: Valve { interlock: None, ..blind.valve }, ..blind };
            let log = fly(reference, &mut arm(), &wall(), &blind).unwrap();
            assert!(log.samples.iter().any(|s| beyond(s) && s.flow > 0.0), "{name} {seed}: nothing to prevent");
        }
    }
}

#[test]
fn faults_and_interlocks_out_of_range_are_refused() {
    let refused = |settings: &FlightSettings| {
        let flown = fly(&Ellipse { duration: 1.0 }, &mut arm(), &wall(), settings);
        matches!(flown, Err(Error::OutOfRange { .. } | Error::NotFinite { .. }))
    };
    let gust = Gust { time: 1.0, velocity: Vector3::new(f64::NAN, 0.0, 0.0) };
    assert!(refused(&interlocked(0, Faults { gust: Some(gust), ..Faults::default() })));
    let wind = Wind { mean: Vector3::new(0.0, f64::NAN, 0.0), ..Wind::default() };
    assert!(refused(&FlightSettings { wind, ..outdoors(0) }));
    assert!(refused(&interlocked(0, Faults { pose_lost: Some(-1.0), ..Faults::default() })));
    let valve = Valve { interlock: Some(Interlock { miss: 0.0, distance: 0.05 }), ..Valve::default() };
    assert!(refused(&FlightSettings { valve, ..outdoors(0) }));
}
