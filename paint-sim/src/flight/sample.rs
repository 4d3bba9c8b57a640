//! One line of the flight log.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use super::pan_tilt::PanTilt;
use super::reference::ReferenceState;
use super::vehicle::Vehicle;
use crate::error::Error;
use crate::surface::Surface;

/// The spray is followed this far, m.
const MAX_SPRAY_DISTANCE: f64 = 10.0;

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

impl FlightSample {
    /// What is to be seen at a time of the flight with the valve shut: nozzle and hit from the true pose beside what the reference wants.
    ///
    /// # Errors
    /// A pan-tilt unit whose nozzle is not finite.
    pub fn measured(
        time: f64,
        vehicle: &Vehicle,
        estimated_position: Point3<f64>,
        pan_tilt: [f64; 2],
        wanted: &ReferenceState,
        ptu: &dyn PanTilt,
        surface: &dyn Surface,
    ) -> Result<Self, Error> {
        let world_from_body = vehicle.world_from_body();
        let (nozzle, axis) = ptu.nozzle(&world_from_body, pan_tilt);
        if !nozzle.iter().chain(axis.iter()).all(|v| v.is_finite()) {
            return Err(Error::BadCallback { who: "the pan-tilt unit", time });
        }
        let distance = surface.cast(&nozzle, &axis, MAX_SPRAY_DISTANCE).map(|hit| hit.distance);
        Ok(Self {
            time,
            world_from_body,
            velocity: vehicle.velocity,
            acceleration: vehicle.acceleration,
            attitude: vehicle.attitude,
            estimated_position,
            reference_position: wanted.position,
            pan_tilt,
            desired_pan_tilt: wanted.aim.map_or(pan_tilt, |aim| ptu.command(&world_from_body, &aim)),
            nozzle,
            axis,
            aim: wanted.aim,
            hit: distance.map(|d| nozzle + axis.as_ref() * d),
            distance: distance.unwrap_or(f64::INFINITY),
            wanted_distance: wanted.nozzle_distance,
            flow: 0.0,
            held: false,
        })
    }
}
