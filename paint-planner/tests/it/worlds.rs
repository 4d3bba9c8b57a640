//! What room the surface leaves, and answers of a surface or a tool that cannot be.

use crate::walls::{Arm, Wall};
use paint_planner::mission::reachable_targets;
use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::plan::NotServed;
use paint_planner::{
    Error, Hit, NozzleState, OptimalPlanner, Plan, Planner, Settings, Surface, Target, Tool, VehicleState,
};

/// The flat wall x = 0 with a second wall in a plane `y = side` or `x = -gap`.
#[derive(Default)]
struct Room {
    side: Option<f64>,
    gap: Option<f64>,
}

impl Surface for Room {
    fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        Wall::flat().cast(o, d, max)
    }
    fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
        let side = self.side.map_or(max, |y| (p.y - y).abs());
        let gap = self.gap.map_or(max, |x| (p.x + x).abs());
        p.x.abs().min(side).min(gap).min(max)
    }
}

fn row() -> Vec<Target> {
    Wall::flat().rows(1.0, 1, 0.2)
}

#[test]
fn reach_is_what_the_room_and_the_joints_leave() {
    let (arm, settings) = (Arm::default(), Settings::default());
    // Body and clearance take 0.43 m on either side; turned far enough, the arm lets the body stand in between.
    for (gap, expected) in [(0.84, false), (0.92, true), (3.0, true)] {
        let reached = reachable_targets(&row(), &Room { gap: Some(gap), ..Room::default() }, &arm, &settings).unwrap();
        assert!(reached.iter().all(|reached| *reached == expected), "{gap} m: {reached:?}");
    }
    // 44 degrees of the tilt joint and 25 of incidence, less the room that a start keeps.
    for (elevation, expected) in [(67.5_f64, true), (69.5, false)] {
        let (sin, cos) = elevation.to_radians().sin_cos();
        let normal = UnitVector3::new_normalize(Vector3::new(-cos, 0.0, -sin));
        let target = Target { normal, ..row()[0] };
        let steep = reachable_targets(&[target, row()[1]], &Room::default(), &arm, &settings).unwrap();
        assert_eq!(steep, [expected, true], "{elevation} degrees");
    }
}

/// Least distance of the tool from the side wall and from the wall at the targets of a plan.
fn least_gap(plan: &Plan, room: &Room, targets: std::ops::Range<usize>) -> f64 {
    let mut spheres = Vec::new();
    targets.for_each(|i| Arm::default().spheres(&plan.vehicle[i], &mut spheres));
    spheres.iter().map(|(centre, radius)| room.distance(centre, 9.0) - radius).fold(9.0, f64::min)
}

#[test]
fn targets_keep_the_clearance_that_each_is_given() {
    let room = Room { side: Some(-0.44), ..Room::default() };
    let (targets, settings) = (row(), Settings::default());
    let plan = |clearance: &[Option<f64>]| {
        OptimalPlanner::default().plan_with_clearance(&targets, clearance, &room, &Arm::default(), &settings)
    };
    let usual = OptimalPlanner::default().plan(&targets, &room, &Arm::default(), &settings).unwrap();
    assert_eq!(plan(&vec![Some(settings.clearance); targets.len()]).unwrap(), usual);
    assert!(least_gap(&usual, &room, 0..6) < 0.09, "the side wall must matter");
    let mut clearance = vec![Some(settings.clearance); targets.len()];
    clearance[..6].fill(Some(0.1));
    let kept = plan(&clearance).unwrap();
    assert!(kept.reachable.iter().all(|r| *r) && least_gap(&kept, &room, 0..6) >= 0.1);
    clearance[20..24].fill(None);
    let bare = plan(&clearance).unwrap();
    let reason = |i| (20..24).contains(&i).then_some(NotServed::Excluded);
    assert!((0..targets.len()).all(|i| bare.not_served[i] == reason(i)));
    // As if more were asked for than there is.
    clearance[20..24].fill(Some(10.0));
    let far = plan(&clearance).unwrap();
    assert_eq!((far.reachable, far.target_time, far.waypoints), (bare.reachable, bare.target_time, bare.waypoints));
    assert!(matches!(plan(&clearance[1..]), Err(Error::Target { index: 40, .. })));
    clearance[7] = Some(f64::NAN);
    assert!(matches!(plan(&clearance), Err(Error::Target { index: 7, .. })));
}

/// A wall whose answers are spoilt.
struct Spoilt {
    cast: fn(Option<Hit>) -> Option<Hit>,
    distance: fn(f64) -> f64,
}

impl Surface for Spoilt {
    fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        (self.cast)(Wall::flat().cast(o, d, max))
    }
    fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
        (self.distance)(Wall::flat().distance(p, max))
    }
}

struct Lost;

impl Tool for Lost {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        Some(VehicleState { position: nozzle.position, heading, pan: f64::NAN, tilt: 0.0 })
    }
    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        out.push((vehicle.position, 0.05));
    }
}

#[test]
fn answers_that_cannot_be_are_refused() {
    let sound = Spoilt { cast: |hit| hit, distance: |d| d };
    let refusal = |targets: &[Target], surface: &Spoilt, tool: &dyn Tool| {
        let planned = OptimalPlanner::default().plan(targets, surface, tool, &Settings::default());
        let asked = reachable_targets(targets, surface, tool, &Settings::default());
        match (planned, asked) {
            (Ok(_), Ok(_)) => String::new(),
            (Err(Error::World { what, .. }), Err(Error::World { what: same, .. })) if what == same => what.to_owned(),
            other => panic!("{other:?}"),
        }
    };
    let arm = Arm::default();
    assert_eq!(refusal(&row(), &sound, &arm), "");
    assert!(refusal(&row(), &Spoilt { distance: |_| f64::NAN, ..sound }, &arm).contains("not a number"));
    assert!(refusal(&row(), &Spoilt { distance: |d| -d, ..sound }, &arm).contains("negative"));
    assert!(refusal(&row(), &Spoilt { cast: |_| None, ..sound }, &arm).contains("no ray"));
    let far = |hit: Option<Hit>| hit.map(|hit| Hit { distance: f64::NAN, ..hit });
    assert!(refusal(&row(), &Spoilt { cast: far, ..sound }, &arm).contains("hit"));
    assert!(refusal(&row(), &sound, &Lost).contains("tool"));
    // Normals into the wall: the gun would stand inside it.
    let inwards: Vec<Target> = row().iter().map(|t| Target { normal: -t.normal, ..*t }).collect();
    assert!(refusal(&inwards, &sound, &arm).contains("from behind"));
}
