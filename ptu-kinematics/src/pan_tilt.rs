//! The pan-tilt unit: closed forms for everything.

use nalgebra::{Isometry3, Matrix6, Matrix6xX, Point3, UnitQuaternion, UnitVector3, Vector3};

use crate::aim::{Aim, aim_in_body};
use crate::angle::{elevation_rotation, wrap};
use crate::chain::KinematicChain;
use crate::error::{Error, finite};
use crate::hover::{Hover, Nozzle};
use crate::joints::{Joints, Range};
#[cfg(feature = "urdf")]
use crate::pan_tilt_urdf::{UrdfJointSigns, read_settings};
use crate::settings::PtuSettings;
use crate::trace::event;
#[cfg(feature = "urdf")]
use crate::trace::span;
use crate::urdf_writer;

/// `∂(p, h) / ∂(r, ψ, θ₁, θ₂)`: rows are tip (3) and direction (3), columns position (3), heading, pan, tilt.
pub type Jacobian = Matrix6<f64>;

/// Airframe, arm, pan-tilt unit and gun, with checked settings. All methods are pure.
#[derive(Debug, Clone, PartialEq)]
pub struct Ptu {
    settings: PtuSettings,
}

impl Ptu {
    /// Checks the settings: everything finite, limits ordered, tilt limits within ±90°.
    pub fn new(settings: PtuSettings) -> Result<Self, Error> {
        finite("body_from_pan_axis", settings.body_from_pan_axis.into())?;
        finite("pan_from_tilt_axis", settings.pan_from_tilt_axis.into())?;
        finite("tilt_from_tip", settings.tilt_from_tip.into())?;
        finite("gun_pitch", [settings.gun_pitch])?;
        settings.pan_limits.check("pan_limits")?;
        settings.tilt_limits.check("tilt_limits")?;
        let widest = settings.tilt_limits.min.abs().max(settings.tilt_limits.max.abs());
        if widest > std::f64::consts::FRAC_PI_2 {
            // Beyond the vertical the same direction has two joint solutions, and the closed form would miss one.
            let rule = "tilt must stay within ±π/2";
            return Err(Error::InvalidSetting { name: "tilt_limits", value: widest, rule });
        }
        Ok(Self { settings })
    }

    /// Builds the chain that ends at link `nozzle_link`, whose x axis is the spray axis. Walking from the root link,
    /// the first moving joint is pan (axis ±z of the body), the second tilt (axis ±y of the panned frame); everything
    /// else must be fixed. Limits come from the joints' `<limit lower= upper=>`; a continuous joint keeps ±π (pan).
    #[cfg(feature = "urdf")]
    pub fn from_urdf(text: &str, nozzle_link: &str) -> Result<(Self, UrdfJointSigns), Error> {
        span!("from_urdf");
        let (settings, signs) = read_settings(text, nozzle_link)?;
        Ok((Self::new(settings)?, signs))
    }

    /// This chain as URDF, for viewers and planners: links `body`, `pan`, `tilt` and `nozzle`, whose x axis is the spray axis; joints with the
    /// names of the links that they move, angles as here. `max_rate`: of the servos, rad/s.
    #[must_use]
    pub fn to_urdf(&self, robot: &str, max_rate: f64) -> String {
        urdf_writer::write(&self.settings, robot, max_rate)
    }

    /// The settings it was made from.
    pub fn settings(&self) -> &PtuSettings {
        &self.settings
    }

    /// The nearest joint angles within the limits.
    pub fn clamp(&self, joints: Joints) -> Joints {
        Joints { pan: self.settings.pan_limits.clamp(joints.pan), tilt: self.settings.tilt_limits.clamp(joints.tilt) }
    }

    /// Refuses joint angles outside the limits, naming the first that is.
    pub fn check_limits(&self, joints: Joints) -> Result<(), Error> {
        for (joint, value, range) in
            [("pan", joints.pan, self.settings.pan_limits), ("tilt", joints.tilt, self.settings.tilt_limits)]
        {
            if !range.contains(value) {
                event!(debug, joint, value, "outside the limits");
                return Err(Error::OutOfLimits { joint, value, min: range.min, max: range.max });
            }
        }
        Ok(())
    }

    /// Forward kinematics from any attitude of the body (axes of thesis Fig. 6.3).
    pub fn forward(&self, world_from_body: &Isometry3<f64>, joints: Joints) -> Nozzle {
        let s = &self.settings;
        let (sin_pan, cos_pan) = joints.pan.sin_cos();
        let panned = |v: Vector3<f64>| Vector3::new(cos_pan * v.x - sin_pan * v.y, sin_pan * v.x + cos_pan * v.y, v.z);
        let (sin_tilt, cos_tilt) = joints.tilt.sin_cos();
        let c = s.tilt_from_tip;
        let lifted = Vector3::new(cos_tilt * c.x - sin_tilt * c.z, c.y, sin_tilt * c.x + cos_tilt * c.z);
        let tip_in_body = s.body_from_pan_axis + panned(s.pan_from_tilt_axis + lifted);
        let (sin_axis, cos_axis) = (joints.tilt + s.gun_pitch).sin_cos();
        let direction_in_body = panned(Vector3::new(cos_axis, 0.0, sin_axis));
        Nozzle {
            tip: world_from_body * Point3::from(tip_in_body),
            direction: UnitVector3::new_unchecked(world_from_body.rotation * direction_in_body),
        }
    }

    /// Pose of the nozzle frame: origin at the tip, x along the spray, y left.
    pub fn world_from_nozzle(&self, world_from_body: &Isometry3<f64>, joints: Joints) -> Isometry3<f64> {
        self.link_poses(joints).iter().fold(*world_from_body, |pose, link| pose * link)
    }

    /// The links one after the other, each in the frame of the one before: `body_from_pan`, `pan_from_tilt`,
    /// `tilt_from_nozzle`. The nozzle's x axis is the spray axis.
    pub fn link_poses(&self, joints: Joints) -> [Isometry3<f64>; 3] {
        let s = &self.settings;
        let raised = |angle| UnitQuaternion::from_rotation_matrix(&elevation_rotation(angle));
        let panned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), joints.pan);
        [
            Isometry3::from_parts(s.body_from_pan_axis.into(), panned),
            Isometry3::from_parts(s.pan_from_tilt_axis.into(), raised(joints.tilt)),
            Isometry3::from_parts(s.tilt_from_tip.into(), raised(s.gun_pitch)),
        ]
    }

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

    /// The analytic Jacobian of the nozzle with respect to the hover state. Each rotation column is
    /// `axis × (p - point on the axis)` for the tip and `axis × h` for the direction.
    pub fn jacobian(&self, hover: &Hover) -> Jacobian {
        let s = &self.settings;
        let world_from_body = hover.world_from_body();
        let nozzle = self.forward(&world_from_body, hover.joints);
        let azimuth = hover.heading + hover.joints.pan;
        let (sin, cos) = azimuth.sin_cos();
        let a = s.pan_from_tilt_axis;
        let pan_axis_point = world_from_body * nalgebra::Point3::from(s.body_from_pan_axis);
        let tilt_axis_point = pan_axis_point + Vector3::new(cos * a.x - sin * a.y, sin * a.x + cos * a.y, a.z);
        let up = Vector3::z();
        // Tilt is positive upwards: a right-handed rotation about minus the panned y axis.
        let tilt_axis = Vector3::new(sin, -cos, 0.0);
        let h = nozzle.direction.into_inner();

        let mut jacobian = Jacobian::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let axes = [(up, hover.position), (up, pan_axis_point), (tilt_axis, tilt_axis_point)];
        for (k, (axis, point)) in axes.into_iter().enumerate() {
            jacobian.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&axis.cross(&(nozzle.tip - point)));
            jacobian.fixed_view_mut::<3, 1>(3, 3 + k).copy_from(&axis.cross(&h));
        }
        jacobian
    }

    /// Points the spray axis at `target` from any body pose, roll and pitch included (thesis Eq. (6.1), rederived).
    ///
    /// The spray axis need not meet the pan or the tilt axis: with `e` its lateral offset and `η` its height over the
    /// tilt axis, pan is corrected by `asin(e/ρ)` and tilt by `asin(η/k)`. Angles beyond the limits are clamped and the
    /// remaining pointing error is returned. Fails with [`Error::TooClose`] when the target lies inside those offsets or behind
    /// the nozzle.
    pub fn aim(&self, world_from_body: &Isometry3<f64>, target: &Point3<f64>) -> Result<Aim, Error> {
        finite("target", (*target).into())?;
        let in_body = world_from_body.inverse_transform_point(target);
        finite("target in body axes", in_body.into())?;
        let exact = aim_in_body(&self.settings, &in_body)?;
        let joints = self.clamp(exact.joints);
        if joints == exact.joints {
            return Ok(exact);
        }
        let nozzle = self.forward(&Isometry3::identity(), joints);
        let line = in_body - nozzle.tip;
        let pointing_error = nozzle.direction.cross(&line).norm().atan2(nozzle.direction.dot(&line));
        Ok(Aim { joints, distance: line.norm(), pointing_error, clamped: true })
    }
}

impl KinematicChain for Ptu {
    type Joints = Joints;

    fn limits(&self) -> Vec<Range> {
        vec![self.settings.pan_limits, self.settings.tilt_limits]
    }

    fn forward(&self, world_from_body: &Isometry3<f64>, joints: &Joints) -> Nozzle {
        Ptu::forward(self, world_from_body, *joints)
    }

    fn point(&self, azimuth: f64, elevation: f64) -> Joints {
        Joints { pan: azimuth, tilt: elevation - self.settings.gun_pitch }
    }

    fn spray_angles(&self, joints: &Joints) -> [f64; 2] {
        [joints.pan, joints.tilt + self.settings.gun_pitch]
    }

    fn inverse(&self, tip: &Point3<f64>, direction: &UnitVector3<f64>, heading: f64) -> Result<Hover, Error> {
        Ptu::inverse(self, tip, direction, heading)
    }

    fn jacobian(&self, hover: &Hover) -> Matrix6xX<f64> {
        Matrix6xX::from_column_slice(Ptu::jacobian(self, hover).as_slice())
    }

    /// The pan axis and the tip: both axes lie so near each other that one straight member covers them.
    fn members(&self, world_from_body: &Isometry3<f64>, joints: &Joints) -> Vec<Point3<f64>> {
        let shoulder = world_from_body * Point3::from(self.settings.body_from_pan_axis);
        vec![shoulder, Ptu::forward(self, world_from_body, *joints).tip]
    }
}
