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
