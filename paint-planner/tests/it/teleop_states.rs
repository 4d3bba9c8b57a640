//! States of the hand: the clock they are put on, the targets they become, what is refused.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

use paint_planner::nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};
use paint_planner::teleop::{
    CradlePose, PaintHit, RATE, Resampler, Segment, SessionSettings, TargetSettings, VrMode, VrState, targets,
};
use paint_planner::timing::TimingPolicy;
use paint_planner::{Error, OptimalPlanner, Planner, Settings};

use crate::teleop::{hit, state};
use crate::walls::{Arm, Wall};

#[test]
fn states_at_any_rate_become_ninety_a_second() {
    // 60 Hz on a clock of its own, the hand at 0.3 m/s.
    let raw = |k: u64, mode| {
        let seconds = k as f64 / 60.0;
        VrState { sequence: k, time: 1000.0 + seconds, ..state(k, mode, 0.3 * seconds) }
    };
    let mut resampler = Resampler::new(SessionSettings::default());
    let mut ticks = Vec::new();
    for k in 0..=120 {
        resampler.push(raw(k, VrMode::Painting), &mut ticks);
    }
    assert_eq!(ticks.len(), 181);
    for (k, tick) in ticks.iter().enumerate() {
        let seconds = k as f64 / RATE;
        assert_eq!((tick.sequence, tick.time), (k as u64, seconds));
        assert!((tick.hit.unwrap().point.y - 0.3 * seconds).abs() < 1e-9, "{k}");
        assert!((tick.nozzle_position().y - 0.3 * seconds).abs() < 1e-9, "{k}");
    }
    // Out of order, then a gap: nothing is invented.
    resampler.push(raw(119, VrMode::Painting), &mut ticks);
    resampler.push(raw(240, VrMode::Painting), &mut ticks);
    assert_eq!(ticks.len(), 181);
    let counts = resampler.counts();
    assert_eq!((counts.states, counts.not_later, counts.missing_ticks), (123, 1, 179));
    // A press counts from its own tick on: it is not drawn out to the idle state before it.
    let mut resampler = Resampler::new(SessionSettings::default());
    let mut ticks = Vec::new();
    for (k, mode) in [(0, VrMode::Idle), (1, VrMode::Painting), (2, VrMode::Painting)] {
        resampler.push(raw(k, mode), &mut ticks);
    }
    let modes: Vec<VrMode> = ticks.iter().map(|tick| tick.mode).collect();
    assert_eq!(modes, [VrMode::Idle, VrMode::Idle, VrMode::Painting, VrMode::Painting]);
}

/// A body that turns through the back: every tick lies between its two states the shorter way, at the share of the time.
#[test]
fn a_heading_goes_through_half_a_turn_the_shorter_way() {
    use std::f64::consts::PI;
    for (first, rate) in [(PI - 0.05, 0.6), (0.05 - PI, -0.6)] {
        let heading = |seconds: f64| {
            let turned = first + rate * seconds;
            turned.sin().atan2(turned.cos())
        };
        let mut resampler = Resampler::new(SessionSettings::default());
        let mut ticks = Vec::new();
        for k in 0..=30 {
            let seconds = k as f64 / 30.0;
            let cradle = CradlePose { heading: heading(seconds), ..state(k, VrMode::Idle, 0.0).cradle };
            resampler.push(VrState { time: seconds, cradle, ..state(k, VrMode::Idle, 0.0) }, &mut ticks);
        }
        assert_eq!(ticks.len(), 91);
        for (k, tick) in ticks.iter().enumerate() {
            let off = tick.cradle.heading - heading(k as f64 / RATE);
            assert!(off.sin().abs() < 1e-9 && off.cos() > 0.0, "tick {k}: {off}");
        }
    }
}

#[test]
fn targets_keep_volume_gradient_and_time() {
    // Half a second standing, then 30 cm at 0.3 m/s, then 30 cm at 0.6 m/s, always 1 ml/s.
    let mut states: Vec<VrState> = (0..45).map(|k| state(k, VrMode::Painting, 0.0)).collect();
    states.extend((0..90).map(|k| state(45 + k, VrMode::Painting, 0.3 / RATE * k as f64)));
    states.extend((0..=45).map(|k| state(135 + k, VrMode::Painting, 0.3 + 0.6 / RATE * k as f64)));
    let segment = Segment { mode: VrMode::Painting, states, start: 0.0, length: 0.6 };
    let found = targets(&segment, &Wall::flat(), &TargetSettings::default());
    assert_eq!(found.len(), 61);
    let volume: f64 = found.windows(2).map(|pair| pair[0].dose * (pair[1].point - pair[0].point).norm()).sum();
    assert!((volume - 1e-6 * 2.0).abs() < 1e-14, "{volume}");
    for (k, target) in found.iter().enumerate() {
        assert!((target.point.y - 0.01 * k as f64).abs() < 1e-9);
        assert!(target.normal.dot(&-Vector3::x()) > 1.0 - 1e-12);
        // Flow over speed, except where the pause went.
        let dose = if k >= 30 { 1e-6 / 0.6 } else { 1e-6 / 0.3 };
        assert!(k == 0 || k == 29 || k == 60 || (target.dose - dose).abs() < 1e-10, "{k}: {}", target.dose);
    }
    assert!(found[0].dose > 10.0 * found[1].dose && found[60].dose == 0.0);
    assert!((found[40].time.unwrap() - (1.5 + 0.1 / 0.6)).abs() < 1e-6);
    assert!(found.windows(2).all(|pair| pair[0].time < pair[1].time));
    // The planner takes them as they are.
    let timing = paint_planner::timing::TimingSettings {
        policy: TimingPolicy::GradientPreserving,
        ..Settings::default().timing
    };
    let settings = Settings { timing, ..Settings::default() };
    let plan = OptimalPlanner::default().plan(&found, &Wall::flat(), &Arm::default(), &settings).unwrap();
    let flown: f64 = (0..found.len()).map(|k| plan.volume(k)).sum();
    assert!((flown - volume).abs() < 1e-9 * volume);
}

#[test]
fn normals_are_those_of_the_footprint() {
    // A hit on one facet of a ridge that points up at 45 degrees: the mean is that of both sides.
    struct Ridge;
    impl paint_planner::Surface for Ridge {
        fn cast(&self, o: &Point3<f64>, _: &UnitVector3<f64>, _: f64) -> Option<paint_planner::Hit> {
            let side = if o.z > 2.0 { 1.0 } else { -1.0 };
            let normal = UnitVector3::new_normalize(Vector3::new(-1.0, 0.0, side));
            Some(paint_planner::Hit { point: *o, normal, distance: 0.05 })
        }
        fn distance(&self, _: &Point3<f64>, max: f64) -> f64 {
            max
        }
    }
    let at = |y: f64| PaintHit { point: Point3::new(0.0, y, 2.0), normal: -Vector3::x_axis() };
    let states =
        (0..2).map(|k| VrState { hit: Some(at(0.02 * k as f64)), ..state(k, VrMode::Painting, 0.0) }).collect();
    let segment = Segment { mode: VrMode::Painting, states, start: 0.0, length: 0.02 };
    let found = targets(&segment, &Ridge, &TargetSettings::default());
    // One normal of the hit, two in six exactly on the ridge, which count as below.
    let up = found[0].normal.z / -found[0].normal.x;
    assert!(up.abs() < 0.35, "{up}");
}

#[test]
fn a_dab_is_two_targets_with_its_paint() {
    let dab = Segment {
        mode: VrMode::Painting,
        states: (0..9).map(|k| state(k, VrMode::Painting, 0.4)).collect(),
        start: 0.0,
        length: 0.0,
    };
    let found = targets(&dab, &Wall::flat(), &TargetSettings::default());
    assert_eq!(found.len(), 2);
    let way = (found[1].point - found[0].point).norm();
    assert!((way - 0.005).abs() < 1e-12 && (found[0].dose * way - 8.0 / RATE * 1e-6).abs() < 1e-15);
    // One state is a tick long.
    let tick = Segment { states: vec![state(0, VrMode::Painting, 0.4)], ..dab.clone() };
    let found = targets(&tick, &Wall::flat(), &TargetSettings::default());
    assert!(found.len() == 2 && (found[0].dose * 0.005 - 1e-6 / RATE).abs() < 1e-15, "{found:?}");
    let nothing = Segment { states: Vec::new(), ..dab };
    assert!(targets(&nothing, &Wall::flat(), &TargetSettings::default()).is_empty());
}

#[test]
fn states_that_no_headset_sends_are_refused_by_name() {
    let good = state(7, VrMode::Painting, 0.0);
    good.check().unwrap();
    let refused = |bad: VrState, word: &str| {
        let Err(Error::VrState { sequence: 7, what }) = bad.check() else { panic!("{word}: {:?}", bad.check()) };
        assert!(what.contains(word), "{what}");
    };
    let mut bad = good;
    bad.nozzle.rotation = UnitQuaternion::new_unchecked(bad.nozzle.rotation.into_inner() * 2.0);
    refused(bad, "quaternion");
    refused(VrState { version: 2, ..good }, "version");
    refused(VrState { time: f64::NAN, ..good }, "time");
    refused(VrState { nozzle: Isometry3::translation(f64::INFINITY, 0.0, 0.0), ..good }, "nozzle");
    refused(VrState { cradle: CradlePose { heading: f64::NAN, ..good.cradle }, ..good }, "cradle");
    let point = Point3::new(1e9, 0.0, 0.0);
    refused(VrState { hit: Some(PaintHit { point, ..hit(0.0) }), ..good }, "hit");
    refused(VrState { flow: -1.0, ..good }, "flow");
}
