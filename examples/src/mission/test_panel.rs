//! A stroke over a flat wall, for the tests of the mission's parts.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::{Plan, Target};
use paint_sim::flight::FlightLog;
use ptu_kinematics::Ptu;

use super::fly::fly_three;
use super::settings::MissionSettings;
use crate::adapters::{MeshSurface, Robot};
use crate::mesh_io::TriangleMesh;
use crate::surface::PaintSurface;

/// A wall in the plane x = 0, two metres wide, from one to three metres up, painted from smaller x.
pub(super) fn surface() -> PaintSurface {
    PaintSurface::new(&mesh(), 0.0125, &|_| ()).unwrap()
}

/// The same as a mesh.
pub(super) fn mesh() -> TriangleMesh {
    let corner = |k: u32| [0.0, 1.0 - 0.25 * (k % 9) as f32, 1.0 + 0.25 * (k / 9) as f32];
    let mut mesh = TriangleMesh { positions: (0..81).map(corner).collect(), ..TriangleMesh::default() };
    for row in 0..8 {
        for column in 0..8 {
            let a = 9 * row + column;
            mesh.faces.extend([[a, a + 1, a + 10], [a, a + 10, a + 9]]);
        }
    }
    mesh
}

/// A wave of one metre, its normals tilted to both sides.
pub(super) fn targets() -> Vec<Target> {
    let target = |i: i32| {
        let s = 0.025 * f64::from(i);
        let normal = Vector3::new(-1.0, 0.4 * (5.0 * s).sin(), 0.3 * (4.0 * s).cos());
        let point = Point3::new(0.0, 0.5 - s, 2.0 + 0.1 * (3.0 * s).sin());
        Target { point, normal: UnitVector3::new_normalize(normal), dose: 1e-6, time: None, stand_off: None }
    };
    (0..40).map(target).collect()
}

/// A plan for the wave.
pub(super) fn plan(surface: &PaintSurface, robot: &Robot, settings: &MissionSettings) -> Plan {
    paint_planner::plan(&targets(), &MeshSurface(&surface.world), robot, &settings.planner).unwrap()
}

/// The plan, and its flight with motion capture.
pub(super) fn flown(settings: &MissionSettings) -> (Plan, FlightLog) {
    let (surface, robot) = (surface(), Robot::new(Ptu::new(settings.ptu).unwrap()));
    let plan = plan(&surface, &robot, settings);
    let (flight, _) = fly_three(&plan, &surface.world, &robot, settings, 0).unwrap();
    (plan, flight)
}
