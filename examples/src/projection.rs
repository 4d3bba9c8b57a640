//! The plane a picture is thrown from onto a surface, as a slide projector would.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::Surface as _;
use serde::{Deserialize, Serialize};

use crate::surface::PaintSurface;

/// Nearer hits than this along the way to the viewer are the surface itself, metres.
const OWN_SURFACE: f64 = 0.01;

/// From where a picture is thrown.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Viewpoint {
    /// From far away in front, level: along the mean normal.
    Front,
    /// From a point, world frame, metres.
    Point(Point3<f64>),
}

/// The picture plane of a viewpoint, through the middle of the surface.
pub struct Projection {
    eye: Option<Point3<f64>>,
    centre: Point3<f64>,
    /// Towards the viewer, to the viewer's right, and up.
    towards: Vector3<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
}

impl Projection {
    /// The plane that a viewer sees upright. A surface without a front is seen from -x, the robot's side.
    pub fn new(viewpoint: Viewpoint, surface: &PaintSurface) -> Self {
        let positions = surface.disk().positions().iter().map(|p| Vector3::from(*p));
        let (low, high) =
            positions.fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(l, h), p| (l.inf(&p), h.sup(&p)));
        let centre = Point3::from(0.5 * (low + high));
        let facing = surface.facing();
        let front = Vector3::new(facing.x, facing.y, 0.0).try_normalize(0.1).unwrap_or(-Vector3::x());
        let (eye, towards) = match viewpoint {
            Viewpoint::Front => (None, front),
            Viewpoint::Point(eye) => (Some(eye), (eye - centre).try_normalize(1e-9).unwrap_or(front)),
        };
        // Straight from above or below, the front is what lies lower in the picture.
        let right = Vector3::z().cross(&towards).try_normalize(1e-3).unwrap_or_else(|| Vector3::z().cross(&front));
        Self { eye, centre, towards, right, up: towards.cross(&right) }
    }

    /// Right and up on the plane, metres, of a point of the surface; `None` behind the viewer.
    pub fn project(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        let scale = match self.eye {
            None => 1.0,
            Some(eye) => {
                let depth = (eye - point).dot(&self.towards);
                if depth <= 1e-6 {
                    return None;
                }
                (eye - self.centre).dot(&self.towards) / depth
            }
        };
        let offset = point - self.eye.unwrap_or(self.centre);
        Some([scale * offset.dot(&self.right), scale * offset.dot(&self.up)])
    }

    /// Whether the viewer sees a point of the surface: it faces the viewer, and nothing stands between.
    pub fn sees(&self, surface: &PaintSurface, point: &Point3<f64>, normal: &UnitVector3<f64>) -> bool {
        let way = self.eye.map_or(self.towards * 1e3, |eye| eye - point);
        let distance = way.norm();
        let Some(direction) = UnitVector3::try_new(way, 1e-9) else { return false };
        let start = point + direction.into_inner() * OWN_SURFACE;
        normal.dot(&direction) > 0.0 && surface.world.cast(&start, &direction, distance - OWN_SURFACE).is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_io::TriangleMesh;

    /// Two walls of 2 m by 2 m in one piece: the left half (y > 0) at x = 0, the right half goes back to x = 1.
    fn bent() -> PaintSurface {
        let corner = |k: u32| {
            let (column, row) = ((k % 9) as f32, (k / 9) as f32);
            [(0.25 * column - 1.0).max(0.0), 1.0 - 0.25 * column, 1.0 + 0.25 * row]
        };
        let quad = |a: u32| [[a, a + 1, a + 10], [a, a + 10, a + 9]];
        let faces = (0..64).flat_map(|k| quad(9 * (k / 8) + k % 8)).collect();
        let mesh = TriangleMesh { positions: (0..81).map(corner).collect(), faces, ..TriangleMesh::default() };
        PaintSurface::new(&mesh, 0.05, &|_| ()).unwrap()
    }

    /// Similar triangles: what lies twice as far from the eye is half as large, and the plane through the middle keeps its size.
    #[test]
    fn a_point_throws_in_perspective_and_the_front_does_not() {
        let surface = bent();
        // The middle of the box: x = 0.5, z = 2. The eye stands on its normal, a metre and a half before it.
        let eye = Point3::new(-1.0, 0.0, 2.0);
        let projection = Projection::new(Viewpoint::Point(eye), &surface);
        for (x, scale) in [(0.5, 1.0), (2.0, 0.5), (-0.25, 2.0)] {
            let [right, up] = projection.project(&Point3::new(x, -0.2, 2.3)).unwrap();
            assert!((right - 0.2 * scale).abs() < 1e-9 && (up - 0.3 * scale).abs() < 1e-9, "{x}: {right} {up}");
        }
        assert_eq!(projection.project(&Point3::new(-1.5, 0.0, 2.0)), None);

        let front = Projection::new(Viewpoint::Front, &surface);
        let at = |x: f64, y: f64| front.project(&Point3::new(x, y, 2.3)).unwrap();
        let facing = surface.facing();
        let along = Vector3::new(facing.x, facing.y, 0.0).normalize();
        // Moving along the direction of view changes nothing; up is up.
        let moved = front.project(&(Point3::new(0.0, 0.3, 2.3) + along * 0.7)).unwrap();
        assert!((moved[0] - at(0.0, 0.3)[0]).abs() < 1e-9 && (moved[1] - 0.3).abs() < 1e-9, "{moved:?}");
        assert!(at(0.0, 0.3)[0] < at(0.0, -0.3)[0], "y points to the viewer's left");
    }

    /// The part that goes back is hidden from an eye beside the wall's plane, and seen from before it.
    #[test]
    fn what_faces_away_is_not_seen() {
        let surface = bent();
        let normal = UnitVector3::new_normalize(Vector3::new(-1.0, -1.0, 0.0));
        let (left, right) = (Point3::new(0.0, 0.5, 2.0), Point3::new(0.5, -0.5, 2.0));
        let towards = |eye: Point3<f64>| Projection::new(Viewpoint::Point(eye), &surface);
        let before = towards(Point3::new(-2.0, -1.0, 2.0));
        assert!(before.sees(&surface, &left, &-Vector3::x_axis()) && before.sees(&surface, &right, &normal));
        let aside = towards(Point3::new(-0.5, 2.0, 2.0));
        assert!(aside.sees(&surface, &left, &-Vector3::x_axis()) && !aside.sees(&surface, &right, &normal));
        let behind = towards(Point3::new(2.0, 0.5, 2.0));
        assert!(!behind.sees(&surface, &left, &-Vector3::x_axis()));
    }
}
