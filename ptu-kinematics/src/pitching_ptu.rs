//! The pan-tilt unit on a vehicle that can pitch without flying off: undersides come into reach.

use nalgebra::{Isometry3, Matrix6xX, Point3, UnitQuaternion, UnitVector3, Vector3};

use crate::angle::{elevation_rotation, wrap};
use crate::chain::KinematicChain;
use crate::error::{Error, finite};
use crate::hover::{Hover, Nozzle};
use crate::joints::{Joints, Range};
use crate::pan_tilt::Ptu;

/// Room kept inside the tilt limits where the pitch begins to help, radians: rounding must not push the joint out.
const INSIDE: f64 = 1e-9;

/// Joints of a [`PitchingPtu`], radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PitchingJoints {
    /// Pitch of the body, nose up positive.
    pub pitch: f64,
    /// Pan of the unit in the pitched body.
    pub pan: f64,
    /// Tilt of the unit in the pitched body.
    pub tilt: f64,
}

/// A vehicle whose thrust can be vectored in its plane of symmetry, so that it hovers pitched, with the pan-tilt unit before it. The
/// pitch is a joint at the body origin, between the level frame that [`Hover`] places and the body.
///
/// The vehicle stays level as long as the tilt joint reaches the elevation; beyond, it takes the least pitch that lets the joint reach
/// it. The same direction therefore always has the same joints, and they change without jumps.
#[derive(Debug, Clone, PartialEq)]
pub struct PitchingPtu {
    ptu: Ptu,
    pitch_limits: Range,
}

impl PitchingPtu {
    /// A unit on a vehicle that hovers at any pitch within the limits.
    ///
    /// # Errors
    /// Limits that are not finite, in the wrong order, without the level pose, or beyond ±90°.
    pub fn new(ptu: Ptu, pitch_limits: Range) -> Result<Self, Error> {
        pitch_limits.check("pitch_limits")?;
        let widest = pitch_limits.min.abs().max(pitch_limits.max.abs());
        if !pitch_limits.contains(0.0) || widest > std::f64::consts::FRAC_PI_2 {
            let rule = "the pitch must have 0 within its limits and stay within ±π/2";
            return Err(Error::InvalidSetting { name: "pitch_limits", value: widest, rule });
        }
        Ok(Self { ptu, pitch_limits })
    }

    /// Pose of the body at a pitch.
    #[must_use]
    pub fn body(world_from_level: &Isometry3<f64>, pitch: f64) -> Isometry3<f64> {
        world_from_level * UnitQuaternion::from_rotation_matrix(&elevation_rotation(pitch))
    }

    /// The least pitch at which the tilt joint reaches a direction (level frame), limits of the pitch left aside.
    fn least_pitch(&self, direction: &Vector3<f64>) -> f64 {
        let s = self.ptu.settings();
        let lowest = (s.tilt_limits.min + s.gun_pitch + INSIDE).sin();
        let highest = (s.tilt_limits.max + s.gun_pitch - INSIDE).sin();
        let bound = direction.z.clamp(lowest, highest);
        if bound == direction.z {
            return 0.0;
        }
        // The body sees the height rho sin(phi - pitch): two pitches put it on the bound, and a circle of radius |z| at least meets it.
        let (rho, phi) = (direction.x.hypot(direction.z), direction.z.atan2(direction.x));
        let half = (bound / rho).clamp(-1.0, 1.0).asin();
        let (one, other) = (wrap(phi - half), wrap(phi + half - std::f64::consts::PI));
        // Both are the same for the vertical: the first has the spray before the vehicle.
        if one.abs() <= other.abs() + INSIDE { one } else { other }
    }

    /// Joints for a direction in the level frame.
    fn joints(&self, direction: &Vector3<f64>) -> PitchingJoints {
        let pitch = self.pitch_limits.clamp(self.least_pitch(direction));
        let in_body = elevation_rotation(pitch).inverse() * direction;
        let flat = in_body.x.hypot(in_body.y);
        let pan = if flat > 0.0 { in_body.y.atan2(in_body.x) } else { 0.0 };
        PitchingJoints { pitch, pan, tilt: in_body.z.atan2(flat) - self.ptu.settings().gun_pitch }
    }
}

impl KinematicChain for PitchingPtu {
    type Joints = PitchingJoints;

    fn limits(&self) -> Vec<Range> {
        let s = self.ptu.settings();
        vec![self.pitch_limits, s.pan_limits, s.tilt_limits]
    }

    fn forward(&self, world_from_body: &Isometry3<f64>, joints: &PitchingJoints) -> Nozzle {
        let PitchingJoints { pitch, pan, tilt } = *joints;
        self.ptu.forward(&Self::body(world_from_body, pitch), Joints { pan, tilt })
    }

    fn point(&self, azimuth: f64, elevation: f64) -> PitchingJoints {
        let level = elevation_rotation(elevation) * Vector3::x();
        self.joints(&(UnitQuaternion::from_axis_angle(&Vector3::z_axis(), azimuth) * level))
    }

    fn inverse(
        &self,
        tip: &Point3<f64>,
        direction: &UnitVector3<f64>,
        heading: f64,
    ) -> Result<Hover<PitchingJoints>, Error> {
        finite("tip", (*tip).into())?;
        finite("direction", direction.into_inner().into())?;
        finite("heading", [heading])?;
        let world_from_level = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
        let joints = self.joints(&world_from_level.inverse_transform_vector(direction));
        self.ptu.check_limits(Joints { pan: joints.pan, tilt: joints.tilt })?;
        let in_level = self.forward(&Isometry3::identity(), &joints).tip;
        Ok(Hover { position: tip - world_from_level * in_level.coords, heading, joints })
    }

    fn jacobian(&self, hover: &Hover<PitchingJoints>) -> Matrix6xX<f64> {
        let PitchingJoints { pitch, pan, tilt } = hover.joints;
        let body = Self::body(&hover.world_from_body(), pitch);
        let links = self.ptu.link_poses(Joints { pan, tilt });
        let (panned, tilted) = (body * links[0], body * links[0] * links[1]);
        let nozzle = self.forward(&hover.world_from_body(), &hover.joints);
        let mut jacobian = Matrix6xX::zeros(7);
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        // Pitch and tilt are positive upwards: right-handed turns about minus y.
        let axes = [
            (Vector3::z(), hover.position.coords),
            (body * -Vector3::y(), hover.position.coords),
            (body * Vector3::z(), panned.translation.vector),
            (tilted * -Vector3::y(), tilted.translation.vector),
        ];
        for (k, (axis, origin)) in axes.iter().enumerate() {
            jacobian.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&axis.cross(&(nozzle.tip.coords - origin)));
            jacobian.fixed_view_mut::<3, 1>(3, 3 + k).copy_from(&axis.cross(&nozzle.direction));
        }
        jacobian
    }

    fn members(&self, world_from_body: &Isometry3<f64>, joints: &PitchingJoints) -> Vec<Point3<f64>> {
        let PitchingJoints { pitch, pan, tilt } = *joints;
        self.ptu.members(&Self::body(world_from_body, pitch), &Joints { pan, tilt })
    }
}
