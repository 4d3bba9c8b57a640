//! What can go wrong.

/// What can go wrong; every variant names the input and the way out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A picture has no pixels, or its data do not fill it.
    #[error("{what} has {width} x {height} pixels and {values} values: give width x height values, none of them zero")]
    ImageSize {
        /// Which picture.
        what: &'static str,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Values given.
        values: usize,
    },
    /// Two pictures that belong together differ in size.
    #[error("{what} has {found:?} pixels but the reference has {expected:?}: bring them to one size")]
    Mismatch {
        /// Which picture.
        what: &'static str,
        /// Its columns and rows (or its length and 1).
        found: (usize, usize),
        /// The reference's columns and rows.
        expected: (usize, usize),
    },
    /// A pixel is out of range.
    #[error("{what}, pixel ({x}, {y}) is {value}, expected {range}")]
    Pixel {
        /// Which picture.
        what: &'static str,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The value found.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// A setting is out of range.
    #[error("setting `{name}` is {value}, but {rule}")]
    InvalidSetting {
        /// Field.
        name: &'static str,
        /// Value given.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// The knots of a saturation curve do not rise from (0, 0).
    #[error("saturation curve, knot {index}: depth and ink must both rise strictly from (0, 0)")]
    Curve {
        /// First offending knot.
        index: usize,
    },
    /// A file of weights is not one, or not of this network.
    #[error("weights: {0}; give a safetensors file written by this crate")]
    Weights(String),
    /// A ghost pixel shows what it cannot.
    #[error("ghost pixel {pixel} {why}")]
    Ghost {
        /// Its index.
        pixel: usize,
        /// What is wrong.
        why: &'static str,
    },
    /// There is no place to spray, or nothing to look at.
    #[error("{0}: the problem leaves nothing to do; check the masks")]
    EmptyProblem(&'static str),
}

/// Refuses a setting outside its range.
pub(crate) fn require(name: &'static str, value: f64, holds: bool, rule: &'static str) -> Result<(), Error> {
    if holds && !value.is_nan() { Ok(()) } else { Err(Error::InvalidSetting { name, value, rule }) }
}
