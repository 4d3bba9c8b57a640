use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use crate::error::{Error, finite};
use crate::settings::{Joints, Ptu};
use crate::wrap;

/// A hovering robot: level body at a position and heading, and its joint angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hover {
    /// Body origin `r` in the world, metres.
    pub position: Point3<f64>,
    /// Heading `ψ` about the world's up axis, radians.
    pub heading: f64,
    /// Pan and tilt.
    pub joints: Joints,
}

impl Hover {
    /// The body pose: `Rz(ψ)` at `r`.
    pub fn world_from_body(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.position),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.heading),
        )
    }
}

impl Ptu {
    /// Inverse kinematics in hover: the one body position and the joint angles that bring the nozzle tip to `tip`
    /// spraying along `direction`, with the body at `heading`. A vertical direction leaves pan free; it is set to 0.
    ///
    /// Fails with [`Error::OutOfLimits`] when a joint cannot reach its angle; see [`Ptu::inverse_unlimited`].
    pub fn inverse(&self, tip: &Point3<f64>, direction: &UnitVector3<f64>, heading: f64) -> Result<Hover, Error> {
        finite("tip", (*tip).into())?;
        finite("direction", direction.into_inner().into())?;
        finite("heading", [heading])?;
        let hover = self.inverse_unlimited(tip, direction, heading);
        self.check_limits(hover.joints)?;
        Ok(hover)
    }

    /// The same without looking at the joint limits. Non-finite input gives non-finite output.
    pub fn inverse_unlimited(&self, tip: &Point3<f64>, direction: &UnitVector3<f64>, heading: f64) -> Hover {
        let s = &self.settings;
        let horizontal = direction.x.hypot(direction.y);
        let (cos_azimuth, sin_azimuth, pan) = if horizontal > 0.0 {
            (direction.x / horizontal, direction.y / horizontal, wrap(direction.y.atan2(direction.x) - heading))
        } else {
            (heading.cos(), heading.sin(), 0.0)
        };
        let tilt = direction.z.atan2(horizontal) - s.gun_pitch;
        let (sin_tilt, cos_tilt) = tilt.sin_cos();
        let c = s.tilt_from_tip;
        let from_pan_axis =
            s.pan_from_tilt_axis + Vector3::new(cos_tilt * c.x - sin_tilt * c.z, c.y, sin_tilt * c.x + cos_tilt * c.z);
        let (sin_heading, cos_heading) = heading.sin_cos();
        let rotate =
            |v: Vector3<f64>, cos: f64, sin: f64| Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
        let position = tip
            - rotate(s.body_from_pan_axis, cos_heading, sin_heading)
            - rotate(from_pan_axis, cos_azimuth, sin_azimuth);
        Hover { position, heading, joints: Joints { pan, tilt } }
    }
}
