use nalgebra::{Isometry3, Point3};

use crate::error::{Error, finite};
use crate::settings::{Joints, Ptu};
use crate::wrap;

/// Where to turn the gun, and what is left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Pan and tilt within the limits.
    pub joints: Joints,
    /// Distance from the nozzle tip to the target along the line between them, metres.
    pub distance: f64,
    /// Angle between the spray axis and the line from the tip to the target; zero unless clamped. Radians.
    pub miss: f64,
    /// Whether a limit was in the way.
    pub clamped: bool,
}

impl Ptu {
    /// Points the spray axis at `target` from any body pose, roll and pitch included (thesis Eq. (6.1), rederived).
    ///
    /// The spray axis need not meet the pan or the tilt axis: with `e` its lateral offset and `η` its height over the
    /// tilt axis, pan is corrected by `asin(e/ρ)` and tilt by `asin(η/k)`. Angles beyond the limits are clamped and the
    /// remaining miss is returned. Fails with [`Error::TooClose`] when the target lies inside those offsets or behind
    /// the nozzle.
    pub fn aim(&self, world_from_body: &Isometry3<f64>, target: &Point3<f64>) -> Result<Aim, Error> {
        finite("target", (*target).into())?;
        let in_body = world_from_body.inverse_transform_point(target);
        finite("target in body axes", in_body.into())?;
        let exact = self.aim_in_body(&in_body)?;
        let joints = self.clamp(exact.joints);
        if joints == exact.joints {
            return Ok(exact);
        }
        let nozzle = self.forward(&Isometry3::identity(), joints);
        let line = in_body - nozzle.tip;
        let miss = nozzle.direction.cross(&line).norm().atan2(nozzle.direction.dot(&line));
        Ok(Aim { joints, distance: line.norm(), miss, clamped: true })
    }

    /// The unclamped solution for a target in body axes.
    fn aim_in_body(&self, target: &Point3<f64>) -> Result<Aim, Error> {
        let s = &self.settings;
        let (a, c) = (s.pan_from_tilt_axis, s.tilt_from_tip);
        let p = target - Point3::from(s.body_from_pan_axis);
        let (sin_pitch, cos_pitch) = s.gun_pitch.sin_cos();
        let lateral = a.y + c.y;
        // The tip in the frame of the spray axis: `along` it and `above` the tilt axis.
        let along = c.x * cos_pitch + c.z * sin_pitch;
        let above = c.z * cos_pitch - c.x * sin_pitch;

        let rho = p.x.hypot(p.y);
        if rho <= lateral.abs() {
            return Err(Error::TooClose { axis: "pan", distance: rho, offset: lateral.abs() });
        }
        let pan = p.y.atan2(p.x) - (lateral / rho).asin();
        let q = (rho * rho - lateral * lateral).sqrt() - a.x;
        let w = p.z - a.z;
        let k = q.hypot(w);
        if k <= above.abs() {
            return Err(Error::TooClose { axis: "tilt", distance: k, offset: above.abs() });
        }
        let tilt = w.atan2(q) - (above / k).asin() - s.gun_pitch;
        let distance = (k * k - above * above).sqrt() - along;
        if distance <= 0.0 {
            return Err(Error::TooClose { axis: "nozzle", distance: k, offset: along.hypot(above) });
        }
        Ok(Aim { joints: Joints { pan: wrap(pan), tilt: wrap(tilt) }, distance, miss: 0.0, clamped: false })
    }
}
