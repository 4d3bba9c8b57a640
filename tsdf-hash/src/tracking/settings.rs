//! Settings of the tracker.

use crate::error::Error;
use crate::settings::NoiseModel;

/// How a frame is tracked.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct TrackingSettings {
    /// Pixels in a row of the finest level, about (ours: 160): squares of whole pixels of the depth image are averaged to reach it.
    pub columns: usize,
    /// Most iterations per level, coarse to fine; each level halves the pixels along each side (as in Newcombe et al. 2011: 10, 5, 4).
    pub iterations: [usize; 3],
    /// Points of the model farther than this from the measured point are not its partners, metres (as there: 0.1).
    pub max_distance: f64,
    /// Whether intensities take part, where there is colour (Eq. (5.3)).
    pub photometric: bool,
    /// Least [overlap](crate::tracking::TrackingOutcome::overlap) (ours: 0.3); below it the camera is lost.
    pub min_overlap: f64,
    /// Least share of those that must agree with the model, within three standard deviations and half a voxel (ours: 0.5);
    /// below it the camera is lost.
    pub min_agreement: f64,
    /// Least agreement at which a lost camera is believed to be found (ours: 0.85): a wrong place that looks alike must not pass.
    pub relocalise_agreement: f64,
    /// Noise of the depth camera: the relative weight of near and far points. Its scale is estimated.
    pub noise: NoiseModel,
    /// Threads used inside one call; 1 spawns none. Results do not depend on it.
    pub threads: usize,
}

impl Default for TrackingSettings {
    fn default() -> Self {
        Self {
            columns: 160,
            iterations: [10, 5, 4],
            max_distance: 0.1,
            photometric: true,
            min_overlap: 0.3,
            min_agreement: 0.5,
            relocalise_agreement: 0.85,
            noise: NoiseModel::default(),
            threads: 1,
        }
    }
}

impl TrackingSettings {
    /// Pixels of a depth image along each side that become one.
    pub(crate) fn reduction(&self, width: usize) -> usize {
        (width / self.columns).max(1)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let within = |name, value: f64, lo: f64, hi: f64, requirement| {
            // A comparison that a NaN fails.
            if value >= lo && value <= hi { Ok(()) } else { Err(Error::InvalidSetting { name, value, requirement }) }
        };
        within("tracking.columns", self.columns as f64, 16.0, 16384.0, "16..=16384 pixels")?;
        for iterations in self.iterations {
            within("tracking.iterations", iterations as f64, 0.0, 1000.0, "0..=1000")?;
        }
        within("tracking.max_distance", self.max_distance, 1e-4, 1e3, "0.0001..=1000 metres")?;
        within("tracking.min_overlap", self.min_overlap, 0.0, 1.0, "0..=1")?;
        within("tracking.min_agreement", self.min_agreement, 0.0, 1.0, "0..=1")?;
        within("tracking.relocalise_agreement", self.relocalise_agreement, 0.0, 1.0, "0..=1")?;
        within("tracking.noise.base", self.noise.base, 1e-9, 10.0, "1e-9..=10 metres")?;
        within("tracking.noise.quadratic", self.noise.quadratic, 0.0, 10.0, "0..=10 per metre")?;
        within("tracking.noise.nearest", self.noise.nearest, 0.0, 1e3, "0..=1000 metres")?;
        within("tracking.threads", self.threads as f64, 1.0, 1024.0, "1..=1024")
    }
}
