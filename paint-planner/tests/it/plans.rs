//! What every plan has to keep.

use crate::walls::{Arm, Wall};
use paint_planner::nalgebra::{Point3, UnitQuaternion, UnitVector3, Vector3};
use paint_planner::plan::{NotServed, SmoothingPlanner};
use paint_planner::timing::TimingPolicy;
use paint_planner::{
    Error, Hit, NozzleState, OptimalPlanner, Plan, Planner, Settings, Surface, Target, Tool, VehicleState,
};

fn optimal(targets: &[Target], wall: &Wall, settings: &Settings) -> Result<Plan, Error> {
    OptimalPlanner::default().plan(targets, wall, &Arm::default(), settings)
}

/// Limits, joint limits, flow, distances, volumes and clearance of a plan.
fn assert_sound(plan: &Plan, targets: &[Target], settings: &Settings) {
    let e = plan.report.extrema;
    assert!(e.speed <= settings.timing.max_speed);
    assert!(e.acceleration <= settings.timing.max_acceleration);
    assert!(e.heading_rate <= settings.timing.max_heading_rate);
    assert!(plan.report.joint_rate <= settings.timing.max_joint_rate);
    assert!(plan.report.clearance > 0.0);
    assert!(plan.report.path_deviation <= settings.timing.tolerance);
    let steps = (plan.trajectory.duration() / 0.01).ceil();
    let mut before = plan.setpoint(0.0);
    for k in 0..=steps as usize {
        let setpoint = plan.setpoint(plan.trajectory.duration() * k as f64 / steps);
        let joints = (setpoint.pan - before.pan).abs().max((setpoint.tilt - before.tilt).abs());
        assert!(joints <= settings.timing.max_joint_rate * 0.01 + 1e-9);
        before = setpoint;
        assert!(setpoint.sample.velocity.norm() <= settings.timing.max_speed);
        assert!(setpoint.sample.acceleration.norm() <= settings.timing.max_acceleration);
        assert!((0.0..=settings.timing.max_flow * (1.0 + 1e-9)).contains(&setpoint.flow));
        assert!(setpoint.pan.abs() <= 90_f64.to_radians() && setpoint.tilt.abs() <= 45_f64.to_radians());
    }
    assert!((0..targets.len()).all(|i| plan.reachable[i] == plan.not_served[i].is_none()));
    let arm = Arm::default();
    for i in (0..targets.len()).filter(|&i| plan.reachable[i]) {
        let sample = plan.trajectory.sample(plan.target_time[i]);
        assert!((sample.position - plan.vehicle[i].position).norm() <= plan.report.path_deviation + 1e-9);
        assert!(arm.vehicle(&plan.nozzle[i], sample.heading).is_some());
        let distance = (plan.nozzle[i].position - targets[i].point).dot(&targets[i].normal);
        assert!((settings.nozzle.min - 1e-6..settings.nozzle.max + 1e-6).contains(&distance));
        if i + 1 < targets.len() && plan.flow[i] > 0.0 {
            let wanted = targets[i].dose * (targets[i + 1].point - targets[i].point).norm();
            assert!((plan.volume(i) - wanted).abs() <= 1e-9 * wanted);
        }
    }
}

#[test]
fn bumpy_wall_meets_the_published_deviations() {
    let wall = Wall::bumpy(0.12);
    let targets = wall.rows(4.0, 5, 0.2);
    let settings = Settings::default();
    let plan = optimal(&targets, &wall, &settings).unwrap();
    assert_eq!(plan.report.served, targets.len());
    assert_sound(&plan, &targets, &settings);
    // VR paper, section V: 4 mm in the mean, below 2 cm always.
    assert!(plan.report.normal_deviation_mean <= 0.004 && plan.report.normal_deviation_max <= 0.02);
    assert!(plan.trajectory.duration() < targets.len() as f64 * 0.025 / 0.25);
    let baseline = SmoothingPlanner.plan(&targets, &wall, &Arm::default(), &settings).unwrap();
    assert!(baseline.report.normal_deviation_mean >= 5.0 * plan.report.normal_deviation_mean);
    let faces = |(nozzle, target): (&NozzleState, &Target)| nozzle.direction.dot(&target.normal) < -0.8;
    assert!(baseline.nozzle.iter().zip(&targets).all(faces), "it sprays at the wall");
}

#[test]
fn no_nozzle_is_farther_off_a_normal_in_reach_than_permitted() {
    // Normals that change by more than the nozzles can follow smoothly.
    let wall = Wall::flat();
    let mut targets = wall.rows(1.0, 1, 0.2);
    for (i, target) in targets.iter_mut().enumerate() {
        let lean = if i % 2 == 0 { 0.3 } else { -0.3 };
        target.normal = UnitVector3::new_normalize(Vector3::new(-1.0, lean, 0.0));
    }
    let with = |deviation: f64| {
        let mut settings = Settings::default();
        settings.nozzle.deviation = deviation;
        settings.nozzle.ca = 5.0;
        optimal(&targets, &wall, &settings).unwrap().report
    };
    assert!(with(1.0).normal_deviation_max > 0.021);
    for deviation in [0.02, 0.015] {
        let report = with(deviation);
        assert_eq!(report.served, targets.len());
        // Nozzles lie on the bound to rounding.
        assert!(report.normal_deviation_max <= deviation + 1e-9, "{}", report.normal_deviation_max);
    }
    // Where the tilt joint ends, the incidence is the bound.
    let steep: Vec<Target> = wall
        .rows(1.0, 1, 0.2)
        .iter()
        .map(|t| {
            let (sin, cos) = 62_f64.to_radians().sin_cos();
            Target { normal: UnitVector3::new_normalize(Vector3::new(-cos, 0.0, -sin)), ..*t }
        })
        .collect();
    assert_eq!(optimal(&steep, &wall, &Settings::default()).unwrap().report.served, steep.len());
}

#[test]
fn rough_rock_with_overhangs_is_served_where_the_joints_allow() {
    let wall = Wall { bumps: 0.2, wavelength: 1.1, turn: 0.0 };
    let targets = wall.rows(2.5, 8, 0.1);
    let settings = Settings::default();
    let plan = optimal(&targets, &wall, &settings).unwrap();
    assert_sound(&plan, &targets, &settings);
    let limit = (44.0 + 25.0 - 1.0_f64).to_radians();
    let mut steep = 0;
    for (target, reachable) in targets.iter().zip(&plan.reachable) {
        let elevation = target.normal.z.abs().asin();
        if elevation > 45_f64.to_radians() && *reachable {
            steep += 1;
        }
        assert!(!*reachable || elevation <= limit + 1e-9);
    }
    assert!(steep > 0);
}

#[test]
fn turning_the_world_turns_the_plan() {
    let (plain, turned) = (Wall::bumpy(0.12), Wall { turn: 2.1, ..Wall::bumpy(0.12) });
    let settings = Settings::default();
    let a = optimal(&plain.rows(2.0, 3, 0.2), &plain, &settings).unwrap();
    let b = optimal(&turned.rows(2.0, 3, 0.2), &turned, &settings).unwrap();
    let world = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.1);
    for (p, q) in a.nozzle.iter().zip(&b.nozzle) {
        assert!((world * p.position - q.position).norm() < 1e-9);
        assert!((world * p.direction.into_inner() - q.direction.into_inner()).norm() < 1e-8);
    }
    assert!((a.trajectory.duration() - b.trajectory.duration()).abs() < 1e-7);
    for k in 0..200 {
        let t = a.trajectory.duration() * f64::from(k) / 199.0;
        let (p, q) = (a.trajectory.sample(t), b.trajectory.sample(t));
        assert!((world * p.position - q.position).norm() < 1e-7);
        assert!((p.heading + 2.1 - q.heading).sin().abs() < 1e-7);
    }
}

#[test]
fn planning_twice_gives_the_same_plan() {
    let wall = Wall::bumpy(0.15);
    let targets = wall.rows(1.0, 2, 0.2);
    let settings = Settings::default();
    assert_eq!(optimal(&targets, &wall, &settings).unwrap(), optimal(&targets, &wall, &settings).unwrap());
}

#[test]
fn gradient_preserving_timing_keeps_the_ratios_and_the_volume() {
    let wall = Wall::flat();
    let mut targets = wall.rows(2.0, 1, 0.2);
    let mut time = 0.0;
    for (i, target) in targets.iter_mut().enumerate() {
        target.time = Some(time);
        target.dose = 1e-6 * (1.0 + (i as f64 * 0.1).sin());
        time += if (30..40).contains(&i) { 0.06 } else { 0.03 };
    }
    let mut settings = Settings::default();
    settings.timing.policy = TimingPolicy::GradientPreserving;
    let plan = optimal(&targets, &wall, &settings).unwrap();
    assert_sound(&plan, &targets, &settings);
    // Away from the ends, where the vehicle starts and halts, the slow third stays exactly twice as slow.
    let interval = |i: usize| plan.target_time[i + 1] - plan.target_time[i];
    assert!((interval(35) / interval(28) - 2.0).abs() < 1e-9);
    // 2.5 cm in 0.03 s is faster than 0.5 m/s by 5/3.
    assert!(plan.report.stretch >= 5.0 / 3.0);
    targets[5].time = None;
    assert!(matches!(optimal(&targets, &wall, &settings), Err(Error::Target { index: 5, .. })));
}

#[test]
fn strokes_apart_are_joined_by_clear_flights() {
    // Two strokes on both sides of a ridge that juts out by more than the stand-off.
    let wall = Wall { bumps: 0.45, wavelength: 6.0, turn: 0.0 };
    let mut targets: Vec<Target> = (0..20).map(|i| wall.target(0.2 + 0.02 * f64::from(i), 1.5, 1e-6)).collect();
    targets.extend((0..20).map(|i| wall.target(5.6 + 0.02 * f64::from(i), 1.7, 1e-6)));
    let first = wall.target(0.0, 1.5, 0.0);
    let pose = |x: f64| VehicleState {
        position: first.point + first.normal.into_inner() * x,
        heading: 0.2,
        pan: 0.0,
        tilt: 0.0,
    };
    let settings = Settings { start: Some(pose(3.0)), goal: Some(pose(2.5)), ..Settings::default() };
    let plan = optimal(&targets, &wall, &settings).unwrap();
    assert_eq!(plan.report.served, 40);
    assert_sound(&plan, &targets, &settings);
    assert!((plan.trajectory.sample(0.0).position - pose(3.0).position).norm() < 1e-9);
    assert!((plan.trajectory.sample(1e9).position - pose(2.5).position).norm() < 1e-9);
    let halfway = plan.setpoint(0.5 * (plan.target_time[19] + plan.target_time[20]));
    assert!(halfway.transit && halfway.flow == 0.0);
    assert_eq!(plan.flow[19], 0.0);
}

#[test]
fn starting_at_the_first_waypoint_changes_nothing() {
    let wall = Wall::bumpy(0.1);
    let targets = wall.rows(1.0, 1, 0.2);
    let plan = optimal(&targets, &wall, &Settings::default()).unwrap();
    let settings = Settings { start: Some(plan.vehicle[0]), goal: Some(plan.vehicle[40]), ..Settings::default() };
    let again = optimal(&targets, &wall, &settings).unwrap();
    assert_sound(&again, &targets, &settings);
    assert!((again.trajectory.duration() / plan.trajectory.duration() - 1.0).abs() < 0.05);
}

#[test]
fn a_stroke_without_a_way_to_it_is_dropped() {
    // An infinite second wall between the first two strokes.
    struct Cut(Wall);
    impl Surface for Cut {
        fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
            self.0.cast(o, d, max)
        }
        fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
            self.0.distance(p, max).min((p.y - 10.0).abs())
        }
    }
    let wall = Cut(Wall::flat());
    let stroke = |y: f64| (0..20).map(move |i| Wall::flat().target(y + 0.02 * f64::from(i), 1.5, 1e-6));
    let targets: Vec<Target> = stroke(5.0).chain(stroke(15.0)).chain(stroke(6.0)).collect();
    let settings = Settings::default();
    let plan = OptimalPlanner::default().plan(&targets, &wall, &Arm::default(), &settings).unwrap();
    assert_sound(&plan, &targets, &settings);
    for (i, reachable) in plan.reachable.iter().enumerate() {
        assert_eq!(*reachable, !(20..40).contains(&i));
        assert_eq!(plan.not_served[i], (!reachable).then_some(NotServed::NoTransit));
    }
}

#[test]
fn unreachable_targets_are_skipped_not_fatal() {
    let wall = Wall::flat();
    let mut targets = wall.rows(1.0, 1, 0.2);
    for target in &mut targets[18..22] {
        target.normal = -Vector3::z_axis();
    }
    let settings = Settings::default();
    let plan = optimal(&targets, &wall, &settings).unwrap();
    assert_sound(&plan, &targets, &settings);
    assert_eq!(plan.report.served, targets.len() - 4);
    assert_eq!(plan.not_served[18..22], [Some(NotServed::OutOfReach); 4]);
    assert!(plan.reachable[17] && !plan.reachable[18] && !plan.reachable[21] && plan.reachable[22]);
    assert!(plan.flow[17..22].iter().all(|flow| *flow == 0.0));
    assert!(plan.target_time.windows(2).all(|pair| pair[1] > pair[0]));
    for target in &mut targets {
        target.normal = -Vector3::z_axis();
    }
    assert_eq!(optimal(&targets, &wall, &settings), Err(Error::NothingReachable { count: 41 }));
}

#[test]
fn bad_input_is_named() {
    let wall = Wall::flat();
    let good = wall.rows(0.5, 1, 0.2);
    let settings = Settings::default();
    assert_eq!(optimal(&[], &wall, &settings), Err(Error::TooFewTargets { count: 0 }));
    assert_eq!(optimal(&good[..1], &wall, &settings), Err(Error::TooFewTargets { count: 1 }));
    let mut bad = good.clone();
    bad[3].point.y = f64::NAN;
    assert!(matches!(optimal(&bad, &wall, &settings), Err(Error::Target { index: 3, .. })));
    let mut bad = good.clone();
    bad[4].normal = UnitVector3::new_unchecked(Vector3::new(0.0, f64::NAN, 0.0));
    assert!(matches!(optimal(&bad, &wall, &settings), Err(Error::Target { index: 4, .. })));
    let mut bad = good.clone();
    bad[5].dose = -1.0;
    assert!(matches!(optimal(&bad, &wall, &settings), Err(Error::Target { index: 5, .. })));
    let mut broken = settings.clone();
    broken.timing.max_speed = 0.0;
    assert!(matches!(optimal(&good, &wall, &broken), Err(Error::Setting { name: "timing.max_speed", .. })));
    // Targets on one spot are no reason to fail.
    let plan = optimal(&vec![good[0]; 4], &wall, &settings).unwrap();
    assert!(plan.trajectory.duration().is_finite() && plan.report.normal_deviation_max < 1e-6);
}

#[test]
fn nozzles_look_at_their_targets_within_the_cone() {
    let wall = Wall::bumpy(0.15);
    let targets = wall.rows(2.0, 1, 0.2);
    let settings = Settings::default();
    let plan = optimal(&targets, &wall, &settings).unwrap();
    for (NozzleState { position, direction }, target) in plan.nozzle.iter().zip(&targets) {
        let line = target.point - position;
        assert!(direction.angle(&line) <= settings.nozzle.cone / 2.0 + 1e-9);
        assert!((-line).angle(&target.normal) <= settings.nozzle.incidence + 1e-9);
    }
}

#[test]
fn the_greatest_flow_slows_a_rich_stroke() {
    let wall = Wall::flat();
    let mut targets = wall.rows(2.0, 1, 0.2);
    for target in &mut targets {
        // At the wanted 0.4 m/s this takes 4e-6 m^3/s, twice what the nozzle gives.
        target.dose = 1e-5;
    }
    let settings = Settings::default();
    let plan = optimal(&targets, &wall, &settings).unwrap();
    assert_sound(&plan, &targets, &settings);
    let most = plan.flow.iter().fold(0.0_f64, |most, flow| most.max(*flow));
    assert!(most > 0.95 * settings.timing.max_flow, "{most}");
    assert!(plan.trajectory.duration() >= 1e-5 * 2.0 / settings.timing.max_flow);
    let mut strong = settings.clone();
    strong.timing.max_flow = 1e-4;
    let fast = optimal(&targets, &wall, &strong).unwrap();
    assert!(fast.flow.iter().any(|flow| *flow > 1.5 * settings.timing.max_flow));
    assert!(fast.trajectory.duration() < 0.7 * plan.trajectory.duration());
}

#[test]
fn the_greatest_heading_rate_slows_a_turn() {
    // A gun that pans by six degrees only: the body has to follow the normals of the wall.
    let (wall, arm) = (Wall::bumpy(0.15), Arm { max_pan: 0.1, ..Arm::default() });
    let targets = wall.rows(2.0, 1, 0.2);
    let with_limit = |rate: f64| {
        let mut settings = Settings::default();
        settings.timing.max_heading_rate = rate;
        let plan = OptimalPlanner::default().plan(&targets, &wall, &arm, &settings).unwrap();
        assert_sound(&plan, &targets, &settings);
        let steps = 2000;
        let rates = (0..=steps).map(|k| {
            let t = plan.trajectory.duration() * f64::from(k) / f64::from(steps);
            plan.trajectory.sample(t).heading_rate.abs()
        });
        (rates.fold(0.0, f64::max), plan.trajectory.duration())
    };
    let (free, quick) = with_limit(10.0);
    let limit = 0.25 * free;
    assert!(free > 0.02, "the wall must ask for a turn: {free}");
    let (held, slow) = with_limit(limit);
    assert!(held <= limit && held > 0.6 * limit, "{held} of {limit}");
    assert!(slow > 1.2 * quick, "{slow} after {quick}");
}

#[test]
fn the_greatest_joint_rate_slows_what_the_gun_has_to_turn() {
    let wall = Wall::bumpy(0.15);
    // Two rows far apart: the joints move on the strokes, and on the flight between them.
    let targets = wall.rows(2.0, 2, 0.8);
    let with_limit = |rate: f64| {
        let mut settings = Settings::default();
        settings.timing.max_joint_rate = rate;
        let plan = optimal(&targets, &wall, &settings).unwrap();
        assert_sound(&plan, &targets, &settings);
        let at = |k: i32| plan.setpoint(plan.trajectory.duration() * f64::from(k) / 20_000.0);
        let step = plan.trajectory.duration() / 20_000.0;
        let rates = (0..20_000).map(|k| {
            let (a, b) = (at(k), at(k + 1));
            (b.pan - a.pan).abs().max((b.tilt - a.tilt).abs()) / step
        });
        (rates.fold(0.0, f64::max), plan.report.joint_rate, plan.trajectory.duration())
    };
    let (free, certified, quick) = with_limit(100.0);
    assert!(free > 0.2 && free <= certified * (1.0 + 1e-9) && free > 0.9 * certified, "{free} of {certified}");
    let limit = 0.25 * free;
    let (held, _, slow) = with_limit(limit);
    assert!(held <= limit * (1.0 + 1e-9) && held > 0.9 * limit, "{held} of {limit}");
    assert!(slow > 1.2 * quick, "{slow} after {quick}");
}

#[test]
fn hidden_targets_are_not_served() {
    // A board before the middle third of the wall, 6 cm off: the nozzle stands behind it at 10 cm.
    struct Board(Wall);
    fn before_the_board(p: &Point3<f64>) -> bool {
        (0.7..1.3).contains(&p.y)
    }
    impl Surface for Board {
        fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
            let distance = (-0.06 - o.x) / d.x;
            let point = o + d.into_inner() * distance;
            if (0.0..max).contains(&distance) && before_the_board(&point) {
                return Some(Hit { point, normal: -Vector3::x_axis(), distance });
            }
            self.0.cast(o, d, max)
        }
        fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
            // The board is thin and in nobody's way: this is about sight alone.
            self.0.distance(p, max)
        }
    }
    let targets = Wall::flat().rows(2.0, 1, 0.2);
    let settings = Settings::default();
    let plan = OptimalPlanner::default().plan(&targets, &Board(Wall::flat()), &Arm::default(), &settings).unwrap();
    for (target, reachable) in targets.iter().zip(&plan.reachable) {
        // Near the edge the nozzle may look past it.
        let edge = (target.point.y - 0.7).abs().min((target.point.y - 1.3).abs());
        assert!(edge < 0.06 || *reachable != before_the_board(&target.point), "{}", target.point);
    }
    assert_eq!(plan.not_served[40], Some(NotServed::Hidden));
}

#[cfg(feature = "clarabel")]
#[test]
fn plans_do_not_depend_on_who_solves_their_programs() {
    use paint_planner::nozzle::Clarabel;
    let wall = Wall::bumpy(0.1);
    let targets = wall.rows(1.0, 1, 0.2);
    let general = OptimalPlanner { solver: &Clarabel::default(), ..OptimalPlanner::default() };
    let own = optimal(&targets, &wall, &Settings::default()).unwrap();
    let other = general.plan(&targets, &wall, &Arm::default(), &Settings::default()).unwrap();
    for (a, b) in own.nozzle.iter().zip(&other.nozzle) {
        assert!((a.position - b.position).norm() < 1e-6 && a.direction.angle(&b.direction) < 1e-5);
    }
}
