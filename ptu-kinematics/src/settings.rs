//! The constants of the hardware.

use nalgebra::Vector3;

use crate::joints::Range;

/// The hardware constants of airframe, arm, pan-tilt unit and gun. Metres and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PtuSettings {
    /// `b`: body origin to a point on the pan axis, in body axes. Default (0.45, 0, 0.05): the papers name the
    /// arm but print no length; this one carries the gun clear of the rotors.
    pub body_from_pan_axis: Vector3<f64>,
    /// `a`: that point to the tilt axis, in the panned frame. Default (0.03, 0, 0.04).
    pub pan_from_tilt_axis: Vector3<f64>,
    /// `c`: tilt axis to the nozzle tip, in the tilted frame. Default (0.12, 0, 0.02).
    pub tilt_from_tip: Vector3<f64>,
    /// `μ`: angle of the spray axis above the x axis of the tilted frame. Default 0.
    pub gun_pitch: f64,
    /// Pan limits. Default ±90° (thesis, Paper II, section 3: two AX-12A servos).
    pub pan_limits: Range,
    /// Tilt limits. Default ±45°.
    pub tilt_limits: Range,
}

impl Default for PtuSettings {
    fn default() -> Self {
        Self {
            body_from_pan_axis: Vector3::new(0.45, 0.0, 0.05),
            pan_from_tilt_axis: Vector3::new(0.03, 0.0, 0.04),
            tilt_from_tip: Vector3::new(0.12, 0.0, 0.02),
            gun_pitch: 0.0,
            pan_limits: Range::symmetric(std::f64::consts::FRAC_PI_2),
            tilt_limits: Range::symmetric(std::f64::consts::FRAC_PI_4),
        }
    }
}
