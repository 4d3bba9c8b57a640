//! Joint angles and their limits.

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

    pub(crate) fn check(&self, name: &'static str) -> Result<(), Error> {
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
