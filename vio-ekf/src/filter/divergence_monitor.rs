//! Divergence over successive images.

use super::report::FrameReport;
use crate::filter::estimator::Estimator;
use crate::inertial::divergence::{DivergenceCause, DivergenceSettings, exceeded_limit};
use crate::stamp::Stamp;

/// Outliers in a row that show an initialization in motion to have been wrong.
const MAX_PROBATION_OUTLIERS: u32 = 3;
/// Landmarks that must contradict the prediction for an image to be an outlier.
const MIN_REJECTED: usize = 5;

/// Counts outliers in a row, and remembers the first limit that was exceeded.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DivergenceMonitor {
    consecutive_outliers: u32,
    cause: Option<DivergenceCause>,
    /// Until then an initialization in motion may turn out to have been wrong.
    probation_until: Option<Stamp>,
}

impl DivergenceMonitor {
    /// For an initialization that may turn out to have been wrong until a time.
    pub(crate) fn on_probation(until: Stamp) -> Self {
        Self { probation_until: Some(until), ..Self::default() }
    }

    /// The limit that has been exceeded.
    pub(crate) fn cause(&self) -> Option<DivergenceCause> {
        self.cause
    }

    /// Images in a row that contradict the prediction.
    pub(crate) fn consecutive_outliers(&self) -> u32 {
        self.consecutive_outliers
    }

    /// Checks the state after an image. True if the initialization was wrong: then no estimate is better than this one.
    #[must_use]
    pub(crate) fn check_image(
        &mut self,
        estimator: &Estimator,
        settings: &DivergenceSettings,
        report: &FrameReport,
    ) -> bool {
        let outlier = report.rejected >= MIN_REJECTED && report.rejected > report.used;
        self.consecutive_outliers = if outlier { self.consecutive_outliers + 1 } else { 0 };
        let now = estimator.buffer.state_stamp();
        let on_probation = self.probation_until.is_some_and(|until| now < until);
        let most = if on_probation { MAX_PROBATION_OUTLIERS } else { settings.max_consecutive_outliers };
        let too_many = self.consecutive_outliers >= most;
        self.check_state(estimator, settings);
        self.cause = self.cause.or(too_many.then_some(DivergenceCause::ConsecutiveOutliers));
        on_probation && self.cause.is_some()
    }

    /// Checks the state after any other measurement.
    pub(crate) fn check_state(&mut self, estimator: &Estimator, settings: &DivergenceSettings) {
        let exceeded = exceeded_limit(&estimator.state.core, &estimator.covariance, settings);
        self.cause = self.cause.or(exceeded);
    }
}
