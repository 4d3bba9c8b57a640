//! Flights between strokes that have something in their way.

use crate::walls::Arm;
use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::{Error, Hit, Plan, Settings, Surface, Target, Tool, VehicleState, plan};

/// A square pillar of 2.4 m without ends, with or without a pipe all around it in which the vehicle is.
struct Pillar {
    pipe: Option<f64>,
}

const HALF: f64 = 1.2;

impl Surface for Pillar {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let face = |axis: usize, side: f64| {
            let distance = (side * HALF - origin[axis]) / direction[axis];
            let point = origin + direction.into_inner() * distance;
            let mut normal = Vector3::zeros();
            normal[axis] = side;
            let outside = (origin[axis] - side * HALF) * side > 0.0;
            let on_face = point[1 - axis].abs() <= HALF && (0.0..=max).contains(&distance);
            (outside && on_face).then_some(Hit { point, normal: UnitVector3::new_unchecked(normal), distance })
        };
        [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].into_iter().find_map(|(axis, side)| face(axis, side))
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        let [x, y] = [point.x.abs() - HALF, point.y.abs() - HALF];
        let pillar = x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0).abs();
        let pipe = self.pipe.map_or(max, |radius| (radius - point.x.hypot(point.y)).abs());
        pillar.min(pipe).min(max)
    }
}

/// A stroke of 30 cm upwards on the face that looks along x times `side`.
fn stroke(side: f64) -> impl Iterator<Item = Target> {
    let normal = UnitVector3::new_unchecked(Vector3::x() * side);
    (0..=12).map(move |k| Target {
        point: Point3::new(side * HALF, 0.0, 1.0 + 0.025 * f64::from(k)),
        normal,
        dose: if k == 12 { 0.0 } else { 2e-6 },
        time: None,
        stand_off: None,
    })
}

fn least_gap(plan: &Plan, surface: &Pillar) -> f64 {
    let mut spheres = Vec::new();
    for k in 0..=(plan.trajectory.duration() / 0.02) as usize {
        let (sample, setpoint) = (plan.trajectory.sample(0.02 * k as f64), plan.setpoint(0.02 * k as f64));
        let (pan, tilt) = (setpoint.pan, setpoint.tilt);
        let state = VehicleState { position: sample.position, heading: sample.heading, pan, tilt };
        Arm::default().spheres(&state, &mut spheres);
    }
    spheres.iter().map(|(centre, radius)| surface.distance(centre, 9.0) - radius).fold(9.0, f64::min)
}

/// Nothing leads over a pillar without end, and whoever only backs off from one of its faces comes no nearer to the other.
#[test]
fn a_flight_goes_around_a_pillar() {
    let surface = Pillar { pipe: None };
    let targets: Vec<Target> = stroke(-1.0).chain(stroke(1.0)).chain(stroke(-1.0)).collect();
    let plan = plan(&targets, &surface, &Arm::default(), &Settings::default()).unwrap();
    assert!(plan.reachable.iter().all(|reached| *reached), "{:?}", plan.reachable);
    let gap = least_gap(&plan, &surface);
    assert!(gap > 0.0, "{gap} m");
    // Twice around half of the pillar, no nearer than the body is wide: a ball about the robot takes 1.3 m on either side.
    let way: f64 = plan.waypoints.windows(2).map(|pair| (pair[1].state.position - pair[0].state.position).norm()).sum();
    assert!((12.0..30.0).contains(&way), "{way} m");
}

/// The same in a pipe: where the ball about the robot does not fit between pillar and pipe no flight is found, and that is said.
#[test]
fn what_no_flight_leads_to_stays_bare() {
    let targets: Vec<Target> = stroke(-1.0).chain(stroke(1.0)).collect();
    let served = |radius: f64| {
        let plan = plan(&targets, &Pillar { pipe: Some(radius) }, &Arm::default(), &Settings::default()).unwrap();
        plan.reachable.iter().filter(|reached| **reached).count()
    };
    assert_eq!((served(6.0), served(2.6)), (26, 13));
    let alone = Settings {
        start: plan(&targets, &Pillar { pipe: None }, &Arm::default(), &Settings::default())
            .ok()
            .map(|plan| plan.vehicle[25]),
        ..Settings::default()
    };
    let refused = plan(&targets[..13], &Pillar { pipe: Some(2.6) }, &Arm::default(), &alone);
    assert!(matches!(refused, Err(Error::NoTransit { .. })), "{refused:?}");
}
