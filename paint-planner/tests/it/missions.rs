//! Strokes lifted onto a surface, ordered, planned, and accounted for.

use paint_planner::mission::{
    Chart, LiftedStrokes, MissionSettings, NoRehearsal, Route, Spray, TargetOutcomes, plan_mission, reachable_targets,
    reachable_texels,
};
use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::plan::NotServed;
use paint_planner::timing::TimingSettings;
use paint_planner::{Plan, Settings, Target, plan};

use crate::walls::{Arm, Wall};

/// The flat wall in texels of 1 cm, from `y = 0` to 1 m, with a seam at 50 cm: the plane ends there, the wall does not.
struct Picture {
    seam: bool,
}

impl Picture {
    fn at(y: f64, z: f64) -> (Point3<f64>, UnitVector3<f64>) {
        (Point3::new(0.0, 0.01 * y, 2.0 - 0.01 * z), -Vector3::x_axis())
    }
}

impl Chart for Picture {
    fn lift(&self, [x, y]: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        let end = if self.seam { 50.0 } else { 100.0 };
        (0.0..=end).contains(&x).then(|| Self::at(x, y))
    }

    fn lift_from(&self, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        self.seam.then(|| Self::at(x + dx, y + dy))
    }
}

/// Sprays at these places along a row, each of a microlitre.
fn row(places: impl IntoIterator<Item = f64>) -> Vec<Spray> {
    places.into_iter().map(|x| Spray { place: [x, 0.0], volume: 1e-9, stand_off: None }).collect()
}

fn lifted(chart: &Picture, strokes: &[Vec<Spray>]) -> Route {
    let lifted = LiftedStrokes::lift(chart, strokes, 2.0);
    lifted.ordered(None, &Settings::default()).expect("strokes that can be ordered")
}

#[test]
fn sprays_become_doses_between_the_borders_of_their_cells() {
    let route = lifted(&Picture { seam: false }, &[row([10.0, 12.0, 14.0])]);
    let y: Vec<f64> = route.targets.iter().map(|t| t.point.y).collect();
    for (y, expected) in y.iter().zip([0.09, 0.11, 0.13, 0.15]) {
        assert!((y - expected).abs() < 1e-12, "{y}");
    }
    // A microlitre over two centimetres.
    assert!(route.targets[..3].iter().all(|t| (t.dose - 5e-8).abs() < 1e-20) && route.targets[3].dose == 0.0);
    assert!((route.volume() - 3e-9).abs() < 1e-20 && route.lost_volume == 0.0);
}

#[test]
fn a_gap_in_a_stroke_is_bridged_with_the_valve_shut() {
    let route = lifted(&Picture { seam: false }, &[row([10.0, 12.0, 20.0, 22.0])]);
    let bare = route.targets.windows(2).filter(|pair| pair[0].dose == 0.0 && pair[1].point.y < 0.2);
    let metres: f64 = bare.map(|pair| (pair[1].point - pair[0].point).norm()).sum();
    assert!((metres - 0.06).abs() < 1e-12 && (route.volume() - 4e-9).abs() < 1e-20, "{metres}");
    assert!(route.targets.windows(2).all(|pair| (pair[1].point - pair[0].point).norm() < 0.0201));
}

#[test]
fn what_lies_beside_the_surface_is_lost_and_a_cell_goes_on_beyond_a_seam() {
    let beside = lifted(&Picture { seam: false }, &[row([96.0, 98.0, 104.0, 106.0])]);
    assert!((beside.lost_volume - 2e-9).abs() < 1e-20 && (beside.volume() - 2e-9).abs() < 1e-20);
    // The cell of a spray at the edge of the plane is drawn back to it without a seam, and whole with one.
    let last = |chart: &Picture, x: f64| lifted(chart, &[row([x - 2.0, x])]).targets.last().unwrap().point.y;
    assert!((last(&Picture { seam: false }, 99.5) - 1.0).abs() < 3e-3);
    assert!((last(&Picture { seam: true }, 49.5) - 0.505).abs() < 1e-12);
}

#[test]
fn texels_are_reached_as_if_each_were_asked_about() {
    // A wall that leans back more from row to row: the tilt joint ends somewhere.
    struct Leaning(f64);
    impl Chart for Leaning {
        fn lift(&self, [x, y]: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
            let (sin, cos) = (self.0 * y).sin_cos();
            Some((Point3::new(0.0, 0.02 * x, 2.0), UnitVector3::new_normalize(Vector3::new(-cos, 0.0, -sin))))
        }
    }
    let (width, height, settings) = (12, 45, Settings::default());
    let mut occupied = vec![true; width * height];
    occupied[..width].fill(false);
    let reached =
        reachable_texels(&occupied, width, &Leaning(0.035), &Wall::flat(), &Arm::default(), &settings).unwrap();
    // 44 degrees of the joint and 25 of incidence, less a degree: rows of two degrees.
    let limit = 68_f64.to_radians() / 0.035;
    for (texel, reached) in reached.iter().enumerate() {
        let row = (texel / width) as f64;
        assert!(*reached == (occupied[texel] && row < limit) || (row - limit).abs() < 3.0, "row {row}");
    }
    assert!(reached.iter().any(|r| *r) && reached[reached.len() - 1..] == [false]);
    // Wherever the last row lies in its cell of three, no texel is reached that by itself is not.
    for lean in [0.0345, 0.035, 0.0355, 0.036] {
        let chart = Leaning(lean);
        let reached = reachable_texels(&occupied, width, &chart, &Wall::flat(), &Arm::default(), &settings).unwrap();
        let target = |texel: usize| {
            let (point, normal) = chart.lift([(texel % width) as f64, (texel / width) as f64]).unwrap();
            Target { point, normal, dose: 0.0, time: None, stand_off: None }
        };
        let targets: Vec<Target> = (0..reached.len()).map(target).collect();
        let alone = reachable_targets(&targets, &Wall::flat(), &Arm::default(), &settings).unwrap();
        assert!(reached.iter().zip(&alone).all(|(reached, alone)| *alone || !reached), "{lean}");
    }
}

/// A rich stroke is flown as slowly as the valve asks, in every flight of a mission.
#[test]
fn a_mission_keeps_the_limit_of_the_valve() {
    let (wall, usual) = (Wall::flat(), Settings::default());
    let strokes = [wall.rows(1.0, 1, 0.2)];
    let greatest = |planner: Settings| {
        let settings = MissionSettings { planner, ..MissionSettings::default() };
        let mission = plan_mission(&strokes, &wall, &Arm::default(), &NoRehearsal, settings).unwrap();
        mission.flights.iter().flat_map(|flight| flight.plan.flow.clone()).fold(0.0, f64::max)
    };
    let free = greatest(usual.clone());
    let timing = TimingSettings { max_flow: 0.5 * free, ..usual.timing.clone() };
    let limited = greatest(Settings { timing, ..usual });
    assert!(limited > 0.4 * free && limited <= 0.5 * free * (1.0 + 1e-9), "{free} {limited}");
}

#[test]
fn every_target_counts_once_and_with_its_reason() {
    let (targets, settings) = (Wall::flat().rows(1.0, 1, 0.2), Settings::default());
    let mut plan = plan(&targets, &Wall::flat(), &Arm::default(), &settings).unwrap();
    let painted = targets.len() - 1;
    let count = |targets: &[Target], plan: &Plan| {
        let mut outcomes = TargetOutcomes::default();
        outcomes.add_flight(targets, plan);
        outcomes
    };
    assert_eq!(count(&targets, &plan), TargetOutcomes { targets: painted, ..TargetOutcomes::default() });
    // A stretch without a word, one that no flight leads to, and one that a rehearsal gave up beside something hidden.
    for k in (10..14).chain(20..23).chain([30]) {
        plan.flow[k] = 0.0;
    }
    plan.not_served[20..24].fill(Some(NotServed::NoTransit));
    plan.not_served[30..32].copy_from_slice(&[Some(NotServed::Hidden), Some(NotServed::Excluded)]);
    let mut outcomes = count(&targets, &plan);
    assert_eq!((outcomes.without_heading, outcomes.without_transit, outcomes.excluded), (4, 3, 1));
    outcomes.add_refused(&targets[..8], NotServed::TooNear);
    assert_eq!((outcomes.targets, outcomes.too_near, outcomes.not_served()), (painted + 7, 7, 15));
    let expected = "15 of 47 targets not served (4 without a heading, 7 too near something, 3 without a flight to them, \
                    1 left bare after the rehearsal)";
    assert_eq!(outcomes.summary(), expected);
}
