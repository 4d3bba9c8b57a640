//! Pointing the spray axis at a target.

use nalgebra::Point3;

use crate::angle::wrap;
use crate::error::Error;
use crate::joints::Joints;
use crate::settings::PtuSettings;

/// Where to turn the gun, and what is left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Pan and tilt within the limits.
    pub joints: Joints,
    /// Distance from the nozzle tip to the target along the line between them, metres.
    pub distance: f64,
    /// Angle between the spray axis and the line from the tip to the target; zero unless clamped. Radians.
    pub pointing_error: f64,
    /// Whether a limit was in the way.
    pub clamped: bool,
}

/// The solution without limits for a target in body axes.
pub(crate) fn aim_in_body(s: &PtuSettings, target: &Point3<f64>) -> Result<Aim, Error> {
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
    Ok(Aim { joints: Joints { pan: wrap(pan), tilt: wrap(tilt) }, distance, pointing_error: 0.0, clamped: false })
}
