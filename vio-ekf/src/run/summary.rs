//! What came of a run.

use nalgebra::Matrix3;

use crate::error::Error;
use crate::filter::report::Calibration;
use crate::run::calibration_doubt::CalibrationDoubt;
use crate::run::outcome::{Loss, SkippedImage};
use crate::run::segments::Segment;
use crate::stamp::Stamp;
use crate::trajectory::Trajectory;

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The stretches, in order; at least one, none of them empty. None if [`RunnerSettings::keep_history`](crate::run::RunnerSettings::keep_history) is off.
    pub segments: Vec<Segment>,
    /// First and last stamp of the images, skipped ones included.
    pub images_span: (Stamp, Stamp),
    /// Images that the filter took.
    pub frames: usize,
    /// Those among them that came with one of the second camera.
    pub pairs: usize,
    /// Images that it could not take.
    pub skipped: Vec<SkippedImage>,
    /// Inertial samples that it took.
    pub imu_samples: usize,
    /// Seconds from the first image to the first estimate.
    pub initialization_time_s: f64,
    /// Why and when it gave up, each time.
    pub lost: Vec<Loss>,
    /// Poses that were taken back, and are in no segment: of starts that turned out to be wrong, and those before a divergence with
    /// which the measurements disagreed already.
    pub withdrawn: usize,
    /// Whether it runs at the end.
    pub tracking_at_end: bool,
    /// What of the given calibration the images contradict.
    pub doubt: Option<CalibrationDoubt>,
    /// The camera's calibration at the end.
    pub calibration: Calibration,
}

impl Run {
    /// Poses of all segments.
    pub fn poses(&self) -> usize {
        self.segments.iter().map(|segment| segment.estimates.len()).sum()
    }

    /// Poses that come from inertial samples alone.
    pub fn dead_reckoned(&self) -> usize {
        self.segments.iter().flat_map(|segment| &segment.estimates).filter(|estimate| estimate.dead_reckoned).count()
    }

    /// The matrix of the accelerometer at the end, if it was estimated: the sensor is not calibrated, or has not shown yet that it is.
    pub fn accel_matrix(&self) -> Option<Matrix3<f64>> {
        let is_estimated = self.calibration.accel_matrix_sigma.amax() > 0.0;
        is_estimated.then_some(self.calibration.accel_matrix)
    }

    /// The trajectories of the segments, each in its own world.
    ///
    /// # Errors
    /// As [`Segment::trajectory`].
    pub fn trajectories(&self) -> Result<Vec<Trajectory>, Error> {
        self.segments.iter().map(Segment::trajectory).collect()
    }
}
