use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3};

use crate::settings::{Joints, Ptu};

/// The nozzle in the world: tip and spray direction (out of the gun).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nozzle {
    /// `p`, in metres.
    pub tip: Point3<f64>,
    /// `h`, unit length.
    pub direction: UnitVector3<f64>,
}

/// `Ry(-angle)`: the right-handed rotation about `-y`, which lifts the x axis by `angle`.
pub(crate) fn lift(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&-Vector3::y_axis(), angle)
}

impl Ptu {
    /// Forward kinematics from any attitude of the body (ours, axes of thesis Fig. 6.3).
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
        let body_from_nozzle =
            Rotation3::from_axis_angle(&Vector3::z_axis(), joints.pan) * lift(joints.tilt + self.settings.gun_pitch);
        let rotation = world_from_body.rotation * UnitQuaternion::from_rotation_matrix(&body_from_nozzle);
        Isometry3::from_parts(self.forward(world_from_body, joints).tip.into(), rotation)
    }
}
