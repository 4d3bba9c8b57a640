//! What became of a sample or an image, as values.

use std::fmt;

use crate::error::Error;
use crate::filter::report::FrameReport;
use crate::inertial::divergence::DivergenceCause;
use crate::inertial::odometry::Odometry;
use crate::run::calibration_doubt::CalibrationDoubt;
use crate::stamp::Stamp;

/// What became of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageOutcome {
    /// What the filter says of it; `None` if it was skipped.
    pub report: Option<FrameReport>,
    /// The estimate at the time of the latest sample; `None` before the start, after a loss, and for a skipped image.
    pub odometry: Option<Odometry>,
    /// What happened, in this order.
    pub events: Vec<Event>,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A segment begins, in a world of its own: place and heading say nothing about those of other segments.
    Started,
    /// So many of the segment's last poses were wrong and are taken back.
    Withdrawn {
        /// How many.
        poses: usize,
    },
    /// The filter gave up. The segment ends, and the filter tries to start anew.
    Lost(Loss),
    /// The images contradict the calibration that was given: it should be estimated
    /// ([`CalibrationSettings`](crate::filter::CalibrationSettings)), or done anew.
    Doubted(Box<CalibrationDoubt>),
    /// An image was not used.
    Skipped(SkippedImage),
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Started => f.write_str("a segment begins"),
            Self::Withdrawn { poses } => write!(f, "{poses} poses are taken back"),
            Self::Lost(loss) => write!(f, "lost: {}", loss.reason),
            Self::Doubted(doubt) => write!(f, "the images contradict the calibration: {doubt}"),
            Self::Skipped(image) => image.fmt(f),
        }
    }
}

/// When and why the filter gave up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loss {
    /// The image's stamp, or that of the sample after a gap.
    pub stamp: Stamp,
    /// Why.
    pub reason: LossReason,
}

/// Why the filter gave up.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LossReason {
    /// The divergence test.
    Diverged(DivergenceCause),
    /// The motion cannot be carried on over a gap in the inertial samples.
    ImuGap {
        /// Its length, s.
        gap_s: f64,
    },
}

impl fmt::Display for LossReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Diverged(cause) => cause.fmt(f),
            Self::ImuGap { gap_s } => write!(f, "{gap_s:.2} s without inertial samples"),
        }
    }
}

/// An image that was not used.
#[derive(Debug, Clone, PartialEq)]
pub struct SkippedImage {
    /// Its stamp.
    pub stamp: Stamp,
    /// Why.
    pub reason: SkipReason,
}

/// Why an image was not used.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SkipReason {
    /// Whoever reads the images could not; his words.
    Unreadable(String),
    /// An image of that time or later came before it.
    NotIncreasing,
    /// The filter refused it: [`Error::ImageSize`], [`Error::Late`] or [`Error::OutOfRange`].
    Refused(Error),
}

impl fmt::Display for SkippedImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stamp = self.stamp;
        match &self.reason {
            SkipReason::Unreadable(why) => f.write_str(why),
            SkipReason::NotIncreasing => {
                write!(f, "image of {stamp} s: another one of that time or later came before it")
            }
            SkipReason::Refused(error) => write!(f, "image of {stamp} s: {error}"),
        }
    }
}
