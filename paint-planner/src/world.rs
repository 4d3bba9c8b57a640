//! What the planners need from the world: a surface to measure against and a tool to place.

use crate::target::NozzleState;
use nalgebra::{Point3, UnitVector3, Vector3};

/// Where a ray meets the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// The point in the world, m.
    pub point: Point3<f64>,
    /// Outward normal there.
    pub normal: UnitVector3<f64>,
    /// Distance from the origin of the ray, m.
    pub distance: f64,
}

/// The surface to paint, which is also the obstacle.
pub trait Surface: Sync {
    /// First hit of the ray within `max_distance` metres.
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max_distance: f64) -> Option<Hit>;

    /// Unsigned distance from `point` to the surface, clipped at `max`, m.
    ///
    /// Must not change faster than the point moves (as every true distance does): the collision checks skip queries on
    /// the strength of that.
    fn distance(&self, point: &Point3<f64>, max: f64) -> f64;

    /// Corners of the mesh's triangle under a point of the surface, counter-clockwise as seen from outside, m: the paper-exact mode puts its
    /// planes on their edges. `None`, as it is here, for a surface that is not made of triangles.
    fn facet(&self, point: &Point3<f64>) -> Option<[Point3<f64>; 3]> {
        let _ = point;
        None
    }
}

/// Pose of the vehicle in hover and of its pan-tilt unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VehicleState {
    /// Body origin in the world, m.
    pub position: Point3<f64>,
    /// Heading about world z, rad.
    pub heading: f64,
    /// Pan joint, rad, positive to the left.
    pub pan: f64,
    /// Tilt joint, rad, positive upwards.
    pub tilt: f64,
}

impl VehicleState {
    /// Unit vector the vehicle looks along, horizontal.
    pub(crate) fn forward(&self) -> Vector3<f64> {
        Vector3::new(self.heading.cos(), self.heading.sin(), 0.0)
    }

    /// Unit vector along the spray, made horizontal.
    pub(crate) fn spray_azimuth(&self) -> Vector3<f64> {
        let azimuth = self.heading + self.pan;
        Vector3::new(azimuth.cos(), azimuth.sin(), 0.0)
    }
}

/// The vehicle with arm, pan-tilt unit and gun.
pub trait Tool: Sync {
    /// Hover inverse kinematics: the vehicle state that puts the nozzle at `nozzle` with the given heading, or `None`
    /// outside the joint limits.
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState>;

    /// Appends the collision body as (centre in world, radius) spheres, m: always the same number in the same order.
    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>);

    /// Where the nozzle of a vehicle is and where it sprays: what [`vehicle`](Self::vehicle) undoes. A plan opens the valve only while the
    /// spray meets its aim; `None`, as it is here, for a tool that cannot tell.
    fn nozzle(&self, vehicle: &VehicleState) -> Option<NozzleState> {
        let _ = vehicle;
        None
    }

    /// Whether the vehicle may be in this state for reasons beside joints and collisions, such as a [`Tether`](crate::constraints::Tether). Asked at every
    /// target, and every 5 cm of the flights between strokes.
    fn permits(&self, vehicle: &VehicleState) -> bool {
        let _ = vehicle;
        true
    }
}
