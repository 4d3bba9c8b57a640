//! A surface of one's own: two methods.

use paint_planner::mission::reachable_targets;
use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::{Hit, Settings, Surface, Target, plan};

use crate::walls::Arm;

/// A ball about the origin.
struct Ball {
    radius: f64,
}

impl Surface for Ball {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let along = -origin.coords.dot(direction);
        let distance = along - (along * along - origin.coords.norm_squared() + self.radius * self.radius).sqrt();
        let point = origin + direction.into_inner() * distance;
        let normal = UnitVector3::new_normalize(point.coords);
        (0.0..=max).contains(&distance).then_some(Hit { point, normal, distance })
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        (point.coords.norm() - self.radius).abs().min(max)
    }
}

/// A quarter of a circle of latitude.
fn parallel(latitude: f64) -> Vec<Target> {
    let target = |k: u32| {
        let ((sin, cos), (north, level)) = ((0.02 * f64::from(k)).sin_cos(), latitude.sin_cos());
        let normal = UnitVector3::new_normalize(Vector3::new(cos * level, sin * level, north));
        Target { point: Point3::from(normal.into_inner() * 1.5), normal, dose: 1e-6, time: None, stand_off: None }
    };
    (0..80).map(target).collect()
}

#[test]
fn a_nozzle_goes_around_a_ball_at_the_stand_off() {
    let (ball, settings) = (Ball { radius: 1.5 }, Settings::default());
    let targets = parallel(0.3);
    let plan = plan(&targets, &ball, &Arm::default(), &settings).unwrap();
    assert_eq!(plan.report.served, targets.len());
    for (nozzle, target) in plan.nozzle.iter().zip(&targets) {
        assert!((nozzle.position.coords.norm() - 1.6).abs() < 1e-2, "{}", nozzle.position.coords.norm());
        assert!(nozzle.direction.angle(&-target.normal) < 0.1);
    }
    // The pole is out of the joints' reach, a ball of which only the shell is there is not.
    let reached = |latitude: f64| reachable_targets(&parallel(latitude), &ball, &Arm::default(), &settings).unwrap();
    assert!(reached(0.9).iter().all(|reached| *reached) && reached(1.3).iter().all(|reached| !reached));
}
