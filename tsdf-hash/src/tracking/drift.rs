//! How far the present is from where the map has it (thesis Paper I, section 4.5).

use nalgebra::{Isometry3, Matrix6};

use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::images::{ColourView, DepthView};
use crate::tracking::outcome::TrackingOutcome;
use crate::tracking::pose::step;
use crate::tracking::tracker::{FROM_AFAR, Tracker};

/// Chi-squared of six degrees of freedom, 99 %.
const CHI_SQUARED: f64 = 16.81;

/// The present against an old visit: a registration, and the test whether it is off.
#[derive(Clone, Debug)]
pub struct Drift {
    /// The present frame against the old map.
    pub outcome: TrackingOutcome,
    /// Takes what drifted to where the old map has it: `outcome.world_from_camera = corrected_from_drifted · present`.
    pub corrected_from_drifted: Isometry3<f64>,
    /// Squared Mahalanobis distance of the present pose from the registered one, by the covariances of both.
    pub chi_squared: f64,
}

impl Drift {
    /// Whether the poses differ by more than their covariances explain (chi-squared of six degrees of freedom, 99 %).
    pub fn is_significant(&self) -> bool {
        self.chi_squared > CHI_SQUARED
    }

    /// The same in a world that `there` leads to.
    #[cfg(feature = "pose-graph")]
    pub(crate) fn seen_from(mut self, there: &Isometry3<f64>) -> Self {
        self.outcome = self.outcome.seen_from(there);
        self.corrected_from_drifted = there * self.corrected_from_drifted * there.inverse();
        self
    }

    /// Metres between the present camera and the corrected one.
    pub fn distance(&self, present: &Isometry3<f64>) -> f64 {
        (self.outcome.world_from_camera.translation.vector - present.translation.vector).norm()
    }

    /// Radians between them.
    pub fn angle(&self) -> f64 {
        self.corrected_from_drifted.rotation.angle()
    }
}

impl Tracker {
    /// Measures the drift between the map of an old visit and a present frame that is believed to be taken from `present`: point-to-plane
    /// ICP between the ray cast of the old map and the frame, from each of some starts. The best registration is taken, if one is sure:
    /// agreeing by [`TrackingSettings::relocalise_agreement`](crate::tracking::TrackingSettings::relocalise_agreement) and fixed in all directions.
    /// `covariance` is that of `present`, in the order and frame of [`TrackingOutcome::covariance`]; `None` if it is exact.
    ///
    /// # Errors
    /// As [`track`](Self::track).
    pub fn drift(
        &mut self,
        old: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        present: &Isometry3<f64>,
        covariance: Option<&Matrix6<f64>>,
        starts: &[Isometry3<f64>],
    ) -> Result<Option<Drift>, Error> {
        let mut best: Option<TrackingOutcome> = None;
        for start in starts {
            if let Some(found) = self.settle(old, depth, colour, start, &FROM_AFAR)?
                && best.as_ref().is_none_or(|best| found.agreement > best.agreement)
            {
                best = Some(found);
            }
        }
        Ok(best.map(|outcome| {
            let off = step(present, &outcome.world_from_camera);
            let both = covariance.map_or(outcome.covariance, |present| outcome.covariance + present);
            let chi_squared = both.cholesky().map_or(f64::INFINITY, |c| off.dot(&c.solve(&off)));
            let corrected_from_drifted = outcome.world_from_camera * present.inverse();
            Drift { outcome, corrected_from_drifted, chi_squared }
        }))
    }
}
