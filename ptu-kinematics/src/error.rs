//! What can go wrong, and what to do about it.

/// What can go wrong; every variant names the input and the way out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An input holds NaN or infinity.
    #[error("{what} is not finite ({value}): check the source of this number")]
    NonFinite {
        /// Which input.
        what: &'static str,
        /// Its value, printed.
        value: String,
    },
    /// A setting is outside its meaningful range.
    #[error("setting `{name}` is {value}, but {rule}")]
    InvalidSetting {
        /// Field of the settings struct.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// The pose asks for a joint angle the servos cannot reach.
    #[error("{joint} would be {value:.4} rad, outside [{min:.4}, {max:.4}]: choose another heading or direction")]
    OutOfLimits {
        /// `"pan"` or `"tilt"`.
        joint: &'static str,
        /// The angle needed, in radians.
        value: f64,
        /// Lower limit, in radians.
        min: f64,
        /// Upper limit, in radians.
        max: f64,
    },
    /// No joint angles within the limits of a serial arm turn the spray axis along the wanted direction.
    #[error(
        "no joint angles within the limits spray along this direction ({left:.4} rad remain): choose another heading"
    )]
    Unreachable {
        /// Angle that remains, in radians.
        left: f64,
    },
    /// The target lies inside the gun's own reach: no pair of angles points the spray axis at it from in front.
    #[error("target is {distance:.4} m from the {axis} axis, but the spray axis passes it at {offset:.4} m: move back")]
    TooClose {
        /// `"pan"`, `"tilt"` or `"nozzle"`: which part of the chain is too near.
        axis: &'static str,
        /// Distance of the target in metres.
        distance: f64,
        /// Smallest distance that can be hit, in metres.
        offset: f64,
    },
    /// The observations do not determine the offsets.
    #[error("calibration needs {need}, got {got}: record more, and move both joints")]
    Calibration {
        /// What is needed.
        need: &'static str,
        /// What was given.
        got: String,
    },
    /// The URDF file cannot be read as an airframe with a pan and a tilt joint.
    #[error("URDF, {place}: {what}")]
    Urdf {
        /// Element or name at fault.
        place: String,
        /// What is wrong and what is expected.
        what: String,
    },
}

/// Refuses NaN and infinity, naming the input.
pub(crate) fn finite<const N: usize>(what: &'static str, values: [f64; N]) -> Result<(), Error> {
    if values.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(Error::NonFinite { what, value: format!("{values:?}") })
    }
}
