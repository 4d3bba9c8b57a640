//! Number, priors and process noise of landmarks.

use crate::error::Error;
use crate::error::{all_not_negative, all_positive, invalid};

/// Number, priors and process noise of landmarks.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LandmarkSettings {
    /// Landmarks in the state at most, up to 200; 25 as in ROVIO (Bloesch et al. 2017).
    pub max_count: usize,
    /// Landmarks that one image measures at most, those first whose bearings are known least; 30, ours. Successive measurements of one
    /// patch repeat each other's errors, and an update costs time.
    pub max_measured: usize,
    /// So many landmarks have independent distances; ours: 25. What is seen at once lies on the same few surfaces: more landmarks
    /// than this tell no more of how far away they all are.
    pub independent_count: usize,
    /// The shared depth prior: inverse distance expected of landmarks at the start, 1/m; ours, ROVIO has 0.5. From then on it is
    /// estimated.
    pub inverse_distance: f64,
    /// Standard deviation of the shared depth prior: the scene is larger or smaller than expected. Relative to
    /// [`inverse_distance`](Self::inverse_distance); ours. Where the distance is known roughly, say 0.1.
    pub shared_sigma: f64,
    /// Random walk of the shared depth prior, relative to it, 1/√s: the camera comes to see another scene; ours.
    pub shared_walk: f64,
    /// Standard deviation of a landmark's inverse distance from the shared depth prior, relative to that; ours.
    pub inverse_distance_sigma: f64,
    /// Standard deviation of a pixel that is a measurement by itself: of [`Vio::points`](crate::Vio::points); 1 px.
    pub pixel_sigma: f64,
}

impl Default for LandmarkSettings {
    fn default() -> Self {
        Self {
            max_count: 25,
            max_measured: 30,
            independent_count: 25,
            inverse_distance: 0.3,
            shared_sigma: 0.4,
            shared_walk: 0.3,
            inverse_distance_sigma: 0.7,
            pixel_sigma: 1.0,
        }
    }
}

impl LandmarkSettings {
    /// Variance of a new landmark's inverse distance from the shared depth prior: were more of them than are independent taken as
    /// such, their mean would seem to be known.
    pub(crate) fn own_variance(&self, expected: f64) -> f64 {
        let dependent = (self.max_count as f64 / self.independent_count as f64).max(1.0);
        (self.inverse_distance_sigma * expected).powi(2) * dependent
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        if !(1..=200).contains(&self.max_count) {
            return Err(invalid("landmarks.max_count", self.max_count as f64, "must be between 1 and 200"));
        }
        for (name, count) in
            [("landmarks.max_measured", self.max_measured), ("landmarks.independent_count", self.independent_count)]
        {
            if count == 0 {
                return Err(invalid(name, 0.0, "must be at least 1"));
            }
        }
        all_positive(&[
            ("inverse_distance", self.inverse_distance),
            ("inverse_distance_sigma", self.inverse_distance_sigma),
            ("landmarks.pixel_sigma", self.pixel_sigma),
        ])?;
        all_not_negative(&[("shared_sigma", self.shared_sigma), ("shared_walk", self.shared_walk)])
    }
}
