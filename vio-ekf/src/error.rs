//! What can go wrong.

use crate::stamp::{InvalidStamp, Stamp};

/// What can go wrong; every variant names the input and the way out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A line of a trajectory file cannot be read.
    #[error("{format}, line {line}: {what}")]
    Line {
        /// `"TUM"`, `"EuRoC"` or `"KITTI"`.
        format: &'static str,
        /// Line of the text, counted from 1.
        line: usize,
        /// What is wrong and what is expected.
        what: String,
    },
    /// A time that does not fit 64-bit nanoseconds, or is none.
    #[error(transparent)]
    InvalidStamp(#[from] InvalidStamp),
    /// Stamps do not strictly increase.
    #[error("stamp {index} ({stamp} s) is not after its predecessor ({previous} s): sort the poses, drop duplicates")]
    NotIncreasing {
        /// Index of the later pose.
        index: usize,
        /// The stamp before it.
        previous: Stamp,
        /// Its stamp.
        stamp: Stamp,
    },
    /// An input holds NaN, infinity, or numbers so large that their squares overflow.
    #[error("{what} {index} is not finite, or too large to be squared: check the source of this number")]
    NonFinite {
        /// Which input.
        what: &'static str,
        /// Index in that input.
        index: usize,
    },
    /// Two inputs that belong together have different lengths.
    #[error("{left} holds {left_len} items, {right} {right_len}: give one for each")]
    LengthMismatch {
        /// Name of the first input.
        left: &'static str,
        /// Its length.
        left_len: usize,
        /// Name of the second input.
        right: &'static str,
        /// Its length.
        right_len: usize,
    },
    /// Fewer items than the operation needs.
    #[error("{what}: {got} given, at least {need} needed")]
    TooFew {
        /// What there is too little of.
        what: &'static str,
        /// How many were given.
        got: usize,
        /// How many are needed.
        need: usize,
    },
    /// A setting is outside its meaningful range.
    #[error("setting `{name}` is {value}, but {rule}")]
    InvalidSetting {
        /// Name of the field or argument.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// No pose of one trajectory is near enough in time to one of the other.
    #[error(
        "no stamps within {max_difference_s} s: reference spans {reference_first}..{reference_last} s, estimate \
         {estimate_first}..{estimate_last} s; check clocks and units, or allow a larger difference"
    )]
    NoMatches {
        /// The largest difference allowed, in seconds.
        max_difference_s: f64,
        /// First stamp of the reference.
        reference_first: Stamp,
        /// Last stamp of the reference.
        reference_last: Stamp,
        /// First stamp of the estimate.
        estimate_first: Stamp,
        /// Last stamp of the estimate.
        estimate_last: Stamp,
    },
    /// The positions do not determine the alignment.
    #[error("{mode} alignment is not determined by these positions ({why}): use a mode with fewer degrees of freedom")]
    Degenerate {
        /// The alignment mode.
        mode: &'static str,
        /// What the positions lack.
        why: &'static str,
    },
    /// No two poses are the requested span apart.
    #[error("no pair of poses is {span} apart: choose a shorter span or a wider tolerance")]
    NoPairs {
        /// The span asked for, with its unit.
        span: String,
    },
    /// A time outside the interval that is defined.
    #[error("{stamp} s is outside {first}..{last} s: ask for a time inside")]
    OutOfRange {
        /// The time asked for.
        stamp: Stamp,
        /// Start of the defined interval.
        first: Stamp,
        /// End of the defined interval, included.
        last: Stamp,
    },
    /// An index beyond the end of a list.
    #[error("there is no {what} {index}: there are {count}, counted from 0")]
    NoSuch {
        /// What was asked for.
        what: &'static str,
        /// Its index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// An image of another size than the camera's calibration.
    #[error(
        "the image has {given:?} pixels, the calibrated camera {expected:?}: use the calibration of this image size"
    )]
    ImageSize {
        /// Width and height given.
        given: (usize, usize),
        /// Width and height of the camera.
        expected: (usize, usize),
    },
    /// A measurement is older than the state of the filter.
    #[error(
        "{what} of {stamp} s arrives after the state has gone on to {now} s: feed in order, or use a longer buffer"
    )]
    Late {
        /// Which measurement.
        what: &'static str,
        /// Its time by the inertial sensor's clock.
        stamp: Stamp,
        /// The time of the state.
        now: Stamp,
    },
    /// Inertial samples come at another rate than their calibration says.
    #[error(
        "the inertial samples come at {measured_hz:.1} Hz, the calibration says {claimed_hz:.1} Hz: check the unit of the \
         stamps, or correct the rate"
    )]
    SampleRate {
        /// One over the median time between samples.
        measured_hz: f64,
        /// What the calibration says.
        claimed_hz: f64,
    },
    /// The accelerometer does not read gravity.
    #[error(
        "the accelerometer reads {force:.3} m/s² on average, gravity is {gravity:.2}: check its unit (m/s², not g) and scale"
    )]
    NoGravity {
        /// Typical length of the specific force, m/s².
        force: f64,
        /// What was expected, m/s².
        gravity: f64,
    },
    /// Accelerometer and gyroscope do not turn together.
    #[error(
        "gravity test: accelerometer and gyroscope have different axes, or units; they would agree if the accelerometer's \
         (x, y, z) were read as {hint}: check axes, signs and units of both sensors"
    )]
    SwappedAxes {
        /// The assignment that fits.
        hint: String,
    },
    /// A run could use no image.
    #[error("none of the {given} images could be used; the first: {first}")]
    NoImage {
        /// Images that were given.
        given: usize,
        /// Why the first was skipped.
        first: String,
    },
    /// A run with two cameras could use no image of the second.
    #[error("no image of the second camera could be used; the first: {first}")]
    NoSecondImage {
        /// Why the first was skipped.
        first: String,
    },
    /// A run has not a single pose.
    #[error("the odometry never started: {why}")]
    NeverStarted {
        /// What it waited for, or why it was lost.
        why: String,
    },
    /// A covariance is not symmetric positive definite.
    #[error("{what} covariance {index} is not symmetric positive definite: check the filter, or its export")]
    NotPositiveDefinite {
        /// `"position"` or `"attitude"`.
        what: &'static str,
        /// Index in the input.
        index: usize,
    },
}

/// A setting outside its range.
pub(crate) fn invalid(name: &'static str, value: f64, rule: &'static str) -> Error {
    Error::InvalidSetting { name, value, rule }
}

/// Refuses the first of the named settings that is not positive and finite.
pub(crate) fn all_positive(fields: &[(&'static str, f64)]) -> Result<(), Error> {
    match fields.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        Some(&(name, value)) => Err(invalid(name, value, "must be positive")),
        None => Ok(()),
    }
}

/// Refuses the first of the named settings that is negative or not finite.
pub(crate) fn all_not_negative(fields: &[(&'static str, f64)]) -> Result<(), Error> {
    match fields.iter().find(|(_, value)| !(*value >= 0.0 && value.is_finite())) {
        Some(&(name, value)) => Err(invalid(name, value, "must be finite and not negative")),
        None => Ok(()),
    }
}
