//! The nozzle program in the printed variables.

use crate::walls::{Arm, Wall};
use paint_planner::nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use paint_planner::nozzle::Mode;
use paint_planner::{Hit, NozzleState, OptimalPlanner, Planner, Settings, Surface, Target};

/// A wall of which every point has a triangle of some millimetres about it.
struct Faceted(Wall);

impl Surface for Faceted {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        self.0.cast(origin, direction, max)
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.0.distance(point, max)
    }

    fn facet(&self, point: &Point3<f64>) -> Option<[Point3<f64>; 3]> {
        let normal = self.0.target(point.y, point.z, 0.0).normal;
        let across = normal.cross(&Vector3::z()).normalize();
        let up = normal.cross(&across);
        // Counter-clockwise about the normal.
        Some([0.3_f64, 2.3, 4.3].map(|angle| point + (across * angle.cos() + up * angle.sin()) * 0.004))
    }
}

#[test]
fn paper_exact_mode_stays_within_the_planes_on_the_mesh_s_triangles() {
    let (wall, settings) = (Faceted(Wall::bumpy(0.1)), {
        let mut settings = Settings::default();
        settings.nozzle.incidence = 0.06;
        settings
    });
    let targets = wall.0.rows(1.0, 1, 0.2);
    let planner = OptimalPlanner { mode: Mode::PaperExact, ..OptimalPlanner::default() };
    let beyond = |surface: &dyn Surface| {
        let plan = planner.plan(&targets, surface, &Arm::default(), &settings).unwrap();
        let of = |(nozzle, target): (&NozzleState, &Target)| {
            let facet = wall.facet(&target.point).unwrap();
            let outside = |k: usize| {
                let edge = (facet[(k + 1) % 3] - facet[k]).normalize();
                let from = nozzle.position - facet[k];
                // How far the nozzle is outside of the edge, less what the cone of the incidence gives at its height.
                from.dot(&edge.cross(&target.normal)) - 0.06_f64.tan() * from.dot(&target.normal)
            };
            (0..3).map(outside).fold(f64::MIN, f64::max)
        };
        plan.nozzle.iter().zip(&targets).map(of).fold(f64::MIN, f64::max)
    };
    let (with, without) = (beyond(&wall), beyond(&wall.0));
    assert!(with < 1e-6 && without > 1e-3, "{with} {without}");
}

#[test]
fn paper_exact_mode_depends_on_the_world_frame_and_the_sequential_mode_does_not() {
    let plan = |mode: Mode, turn: f64| {
        let wall = Wall { turn, ..Wall::bumpy(0.1) };
        let targets = wall.rows(1.0, 1, 0.2);
        let plan = OptimalPlanner { mode, ..OptimalPlanner::default() }
            .plan(&targets, &wall, &Arm::default(), &Settings::default())
            .unwrap();
        let back =
            Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -turn));
        let deviations = plan.nozzle.iter().zip(&targets).map(|(n, t)| t.normal_deviation(&n.position));
        assert!(deviations.fold(0.0, f64::max) < 0.02);
        plan.nozzle.iter().map(|n| back * n.position).collect::<Vec<Point3<f64>>>()
    };
    let spread = |mode: Mode| {
        let (a, b) = (plan(mode, 0.0), plan(mode, 0.9));
        a.iter().zip(&b).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
    };
    // Eqs. (4)-(5) compare world x with the azimuth: at 0.9 rad the rows bind differently.
    assert!(spread(Mode::PaperExact) > 1e-4);
    assert!(spread(Mode::Sequential) < 1e-9);
}
