//! The constants of the pan-tilt unit from a URDF file: body - (fixed) - pan - (fixed) - tilt - (fixed) - nozzle.

use nalgebra::{Isometry3, Vector3};

use crate::error::Error;
use crate::joints::Range;
use crate::settings::PtuSettings;
use crate::urdf::{UrdfJoint, fault, read_chain};

/// How the URDF's joint angles map to those of this crate: multiply by the sign. Pan is positive to the left, tilt is positive upwards;
/// a URDF whose tilt axis is `+y` counts downwards and gets -1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UrdfJointSigns {
    /// +1 or -1.
    pub pan: f64,
    /// +1 or -1.
    pub tilt: f64,
}

/// Axes closer than this to parallel count as parallel.
const PARALLEL: f64 = 1e-6;

/// See `Ptu::from_urdf`.
pub(crate) fn read_settings(text: &str, nozzle_link: &str) -> Result<(PtuSettings, UrdfJointSigns), Error> {
    let chain = read_chain(text, nozzle_link)?;
    let moving: Vec<usize> = (0..chain.len()).filter(|&k| chain[k].axis.is_some()).collect();
    let [pan_at, tilt_at] = moving[..] else {
        return Err(fault(nozzle_link, format!("{} moving joints lead here, expected pan and tilt", moving.len())));
    };
    let product =
        |joints: &[UrdfJoint]| joints.iter().fold(Isometry3::identity(), |pose, j| pose * j.parent_from_child);
    let body_from_pan = product(&chain[..=pan_at]);
    let pan_from_tilt = product(&chain[pan_at + 1..=tilt_at]);
    let tilt_from_nozzle = product(&chain[tilt_at + 1..]);
    let (pan, tilt) = (&chain[pan_at], &chain[tilt_at]);

    // At zero joint angles all our frames are parallel to the body: rotate everything there once.
    let pan_axis = body_from_pan.rotation * pan.axis.unwrap_or_default();
    let tilt_axis = body_from_pan.rotation * pan_from_tilt.rotation * tilt.axis.unwrap_or_default();
    let pan_sign = sign_along(&pan_axis, &Vector3::z(), &pan.name, "pan must turn about the body's z axis")?;
    let tilt_sign = sign_along(&tilt_axis, &-Vector3::y(), &tilt.name, "tilt must turn about the body's y axis")?;
    let body_from_nozzle = body_from_pan * pan_from_tilt * tilt_from_nozzle;
    let spray = body_from_nozzle.rotation * Vector3::x();
    if spray.y.abs() > PARALLEL {
        return Err(fault(nozzle_link, "its x axis (the spray) must lie in the body's xz plane at zero angles".into()));
    }
    let settings = PtuSettings {
        body_from_pan_axis: body_from_pan.translation.vector,
        pan_from_tilt_axis: body_from_pan.rotation * pan_from_tilt.translation.vector,
        tilt_from_tip: body_from_pan.rotation * pan_from_tilt.rotation * tilt_from_nozzle.translation.vector,
        gun_pitch: spray.z.atan2(spray.x),
        pan_limits: pan.limits(pan_sign).unwrap_or(Range::symmetric(std::f64::consts::PI)),
        tilt_limits: tilt.limits(tilt_sign).unwrap_or(Range::symmetric(std::f64::consts::FRAC_PI_2)),
    };
    Ok((settings, UrdfJointSigns { pan: pan_sign, tilt: tilt_sign }))
}

fn sign_along(axis: &Vector3<f64>, expected: &Vector3<f64>, joint: &str, rule: &str) -> Result<f64, Error> {
    let along = axis.dot(expected);
    if 1.0 - along.abs() > PARALLEL { Err(fault(joint, rule.into())) } else { Ok(along.signum()) }
}
