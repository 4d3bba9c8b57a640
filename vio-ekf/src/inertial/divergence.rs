//! The divergence test: limits on the state beyond which an estimate is given up.

use std::fmt;

use super::core_state::CoreState;
use super::covariance::Covariance;
use super::error_state;

/// The divergence test: the estimate is given up when any of these is exceeded. All ours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct DivergenceSettings {
    /// Speed, m/s.
    pub max_speed: f64,
    /// Standard deviation of the velocity along its worst axis, m/s: dead reckoning has lasted too long.
    pub max_velocity_sigma: f64,
    /// Bias of the gyroscope, rad/s.
    pub max_gyro_bias: f64,
    /// Bias of the accelerometer, m/s².
    pub max_accel_bias: f64,
    /// Outliers in a row: images in which most of at least five landmarks fail their gate, or poses that do.
    pub max_consecutive_outliers: u32,
}

impl Default for DivergenceSettings {
    fn default() -> Self {
        Self {
            max_speed: 30.0,
            max_velocity_sigma: 1.0,
            max_gyro_bias: 0.5,
            max_accel_bias: 3.0,
            max_consecutive_outliers: 10,
        }
    }
}

/// Which limit of [`DivergenceSettings`] was exceeded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DivergenceCause {
    /// The speed, or a number that is not finite.
    Speed,
    /// A bias.
    Bias,
    /// The uncertainty of the velocity.
    Uncertainty,
    /// Measurements fail their gate, one after the other.
    ConsecutiveOutliers,
}

impl fmt::Display for DivergenceCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Speed => "the speed ran away",
            Self::Bias => "a bias grew beyond what a sensor has",
            Self::Uncertainty => "nothing was seen for too long",
            Self::ConsecutiveOutliers => {
                "images and inertial samples contradict each other: check axes, calibration and clocks of both"
            }
        })
    }
}

/// The first of the limits that the core of the state exceeds.
pub(crate) fn exceeded_limit(
    core: &CoreState,
    covariance: &Covariance,
    settings: &DivergenceSettings,
) -> Option<DivergenceCause> {
    let rows = error_state::VELOCITY..error_state::VELOCITY + 3;
    let velocity_variance = rows.map(|row| covariance.variance(row)).fold(0.0, f64::max);
    // NaN is beyond all limits.
    let exceeds = |value: f64, limit: f64| value.is_nan() || value > limit;
    if exceeds(core.velocity.norm(), settings.max_speed) || !core.position.norm_squared().is_finite() {
        Some(DivergenceCause::Speed)
    } else if exceeds(core.gyro_bias.norm(), settings.max_gyro_bias)
        || exceeds(core.accel_bias.norm(), settings.max_accel_bias)
    {
        Some(DivergenceCause::Bias)
    } else if exceeds(velocity_variance, settings.max_velocity_sigma * settings.max_velocity_sigma) {
        Some(DivergenceCause::Uncertainty)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn limits_are_within_what_is_allowed_and_not_a_number_is_beyond_all() {
        let settings = DivergenceSettings {
            max_speed: 4.0,
            max_velocity_sigma: 0.5,
            max_gyro_bias: 0.25,
            max_accel_bias: 2.0,
            ..DivergenceSettings::default()
        };
        let at_all_limits = CoreState {
            velocity: Vector3::y() * 4.0,
            gyro_bias: Vector3::z() * 0.25,
            accel_bias: Vector3::x() * 2.0,
            position: Vector3::zeros(),
            attitude: UnitQuaternion::identity(),
        };
        let mut covariance = Covariance::new(error_state::CORE, error_state::CORE);
        covariance.inflate(error_state::VELOCITY + 1, 0.25);
        let cause = |core: &CoreState, covariance: &Covariance| exceeded_limit(core, covariance, &settings);
        assert_eq!(cause(&at_all_limits, &covariance), None);
        let more = 1.0 + f64::EPSILON;
        let beyond = |change: &dyn Fn(&mut CoreState)| {
            let mut core = at_all_limits;
            change(&mut core);
            cause(&core, &covariance)
        };
        assert_eq!(beyond(&|core| core.velocity *= more), Some(DivergenceCause::Speed));
        assert_eq!(beyond(&|core| core.gyro_bias *= more), Some(DivergenceCause::Bias));
        assert_eq!(beyond(&|core| core.accel_bias *= more), Some(DivergenceCause::Bias));
        assert_eq!(beyond(&|core| core.position.x = f64::INFINITY), Some(DivergenceCause::Speed));
        assert_eq!(beyond(&|core| core.gyro_bias.x = f64::NAN), Some(DivergenceCause::Bias));
        covariance.inflate(error_state::VELOCITY + 2, 0.26);
        assert_eq!(cause(&at_all_limits, &covariance), Some(DivergenceCause::Uncertainty));
    }
}
