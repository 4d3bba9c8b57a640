//! One line of the flight log.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

/// The state of a flight at one moment. World frame, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightSample {
    /// Time of the reference, s.
    pub time: f64,
    /// True pose.
    pub world_from_body: Isometry3<f64>,
    /// True velocity of the body's centre, m/s.
    pub velocity: Vector3<f64>,
    /// Its acceleration, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Roll, pitch and yaw, rad.
    pub attitude: [f64; 3],
    /// What the controller takes for the position.
    pub estimated_position: Point3<f64>,
    /// What the reference wants at this time.
    pub reference_position: Point3<f64>,
    /// Pan and tilt.
    pub pan_tilt: [f64; 2],
    /// Pan and tilt that would hit the aim from the TRUE pose at this time, within the unit's limits; the actual ones
    /// where there is no aim.
    pub desired_pan_tilt: [f64; 2],
    /// Tip of the nozzle.
    pub nozzle: Point3<f64>,
    /// Spray direction.
    pub axis: UnitVector3<f64>,
    /// The point that the reference wants to hit at this time.
    pub aim: Option<Point3<f64>>,
    /// Where the spray's axis meets the surface.
    pub hit: Option<Point3<f64>>,
    /// Distance from the nozzle to `hit` along the axis, m; infinite where nothing is hit.
    pub distance: f64,
    /// The distance that the reference wants, m.
    pub wanted_distance: f64,
    /// Flow that leaves the nozzle, m^3/s.
    pub flow: f64,
    /// Whether the interlock keeps the valve shut although the reference asks for paint.
    pub held: bool,
}
