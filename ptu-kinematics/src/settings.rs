use nalgebra::Vector3;

use crate::error::{Error, finite};

/// Closed interval of a joint, in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Range {
    /// Lower end.
    pub min: f64,
    /// Upper end.
    pub max: f64,
}

impl Range {
    /// The interval `[-half, half]`.
    pub fn symmetric(half: f64) -> Self {
        Self { min: -half, max: half }
    }

    /// Whether the angle lies inside, ends included.
    pub fn contains(&self, angle: f64) -> bool {
        (self.min..=self.max).contains(&angle)
    }

    /// The nearest angle inside.
    pub fn clamp(&self, angle: f64) -> f64 {
        angle.max(self.min).min(self.max)
    }

    fn check(&self, name: &'static str) -> Result<(), Error> {
        finite(name, [self.min, self.max])?;
        if self.min > self.max {
            return Err(Error::InvalidSetting { name, value: self.min, rule: "min must not exceed max" });
        }
        Ok(())
    }
}

/// Both joint angles in radians: pan about the body's up axis (left positive), tilt up positive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Joints {
    /// `θ₁`.
    pub pan: f64,
    /// `θ₂`.
    pub tilt: f64,
}

/// The hardware constants of airframe, arm, pan-tilt unit and gun. Metres and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PtuSettings {
    /// `b`: body origin to a point on the pan axis, in body axes. Default (0.45, 0, 0.05), ours: the papers name the
    /// arm but print no length; this one carries the gun clear of the rotors.
    pub body_from_pan_axis: Vector3<f64>,
    /// `a`: that point to the tilt axis, in the panned frame. Default (0.03, 0, 0.04), ours.
    pub pan_from_tilt_axis: Vector3<f64>,
    /// `c`: tilt axis to the nozzle tip, in the tilted frame. Default (0.12, 0, 0.02), ours.
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

/// The kinematic chain, with checked settings. All methods are pure.
#[derive(Debug, Clone, PartialEq)]
pub struct Ptu {
    pub(crate) settings: PtuSettings,
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
                return Err(Error::OutOfLimits { joint, value, min: range.min, max: range.max });
            }
        }
        Ok(())
    }
}
