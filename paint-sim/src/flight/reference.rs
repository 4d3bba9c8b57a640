//! What the flight is asked to do.

use nalgebra::{Point3, Vector3};

/// The wanted state at one moment. World frame (z up), SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceState {
    /// Position of the body's centre, m.
    pub position: Point3<f64>,
    /// Its velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Its acceleration, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Heading (yaw) of the body's x axis from the world's x axis about z, rad.
    pub heading: f64,
    /// Its rate, rad/s.
    pub heading_rate: f64,
    /// From the body's centre to the point about which the gun turns, at a level attitude, world frame, m: that point is kept in
    /// its place when the body tilts against wind and hose. Zero leaves it to the body.
    pub lever: Vector3<f64>,
    /// The point on the surface that the spray shall hit; `None` sends the pan-tilt unit to rest.
    pub aim: Option<Point3<f64>>,
    /// Wanted distance from the nozzle to the surface along the spray, m.
    pub nozzle_distance: f64,
    /// Wanted flow, m^3/s; zero closes the valve.
    pub flow: f64,
}

impl ReferenceState {
    pub(crate) fn is_finite(&self) -> bool {
        let scalars = [self.heading, self.heading_rate, self.nozzle_distance, self.flow];
        let aim = self.aim.unwrap_or_else(Point3::origin);
        let vectors = [self.position.coords, self.velocity, self.acceleration, self.lever, aim.coords];
        scalars.iter().all(|v| v.is_finite()) && vectors.iter().flatten().all(|v| v.is_finite())
    }
}

/// A planned flight.
pub trait Reference {
    /// How long it lasts, s.
    fn duration(&self) -> f64;

    /// The wanted state at `t`; asked for a little before zero and after the end as well, where it should stand still.
    fn at(&self, t: f64) -> ReferenceState;
}
