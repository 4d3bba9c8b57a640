//! Extraction and photometric alignment of patches.

use crate::error::Error;
use crate::error::{all_not_negative, all_positive, invalid};

/// Extraction and photometric alignment of patches.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct PatchSettings {
    /// The finest of the two pyramid levels that patches are made of. ROVIO uses 1; ours is 0: linear interpolation costs
    /// a fixed part of a level's pixel.
    pub first_level: usize,
    /// Least standard deviation of a pixel's intensity difference, grey levels; the residual of an alignment may raise it.
    pub intensity_sigma: f64,
    /// Standard deviation of a patch's position that no pixel noise explains, pixels: interpolation, rough surfaces; ours.
    pub pixel_sigma: f64,
    /// Random walk of the point that a patch stands for, pixels/√s: seen from elsewhere, a bent or rough surface no longer
    /// agrees with the template, in a way that lasts; ours.
    pub template_drift: f64,
    /// The same by the angle between the directions in which the point is seen, pixels/√rad: what a bent or rough surface no
    /// longer agrees in grows with that; ours.
    pub template_parallax: f64,
    /// Largest share of a patch's energy (squared contrast) that may remain as residual; ours.
    pub max_residual_ratio: f64,
    /// Threshold of the FAST corner test, grey levels; 5 as in ROVIO.
    pub fast_threshold: u8,
    /// Least Shi-Tomasi score of a new patch: smaller eigenvalue of its information, (grey level/pixel)² per pixel; ours.
    pub min_score: f64,
    /// New landmarks are detected when fewer than this share of the slots is in use; 0.8 as in ROVIO.
    pub start_detection_ratio: f64,
    /// Least distance of a new landmark from all others, pixels; ours.
    pub min_distance: f64,
    /// Distance below which other landmarks lower the rank of a candidate, pixels; 100 as in ROVIO.
    pub penalty_distance: f64,
    /// The template is extracted anew when it is seen larger or smaller by this factor in area; ours.
    pub max_area_change: f64,
}

impl Default for PatchSettings {
    fn default() -> Self {
        Self {
            first_level: 0,
            intensity_sigma: 2.0,
            pixel_sigma: 0.1,
            template_drift: 0.15,
            template_parallax: 0.5,
            max_residual_ratio: 0.4,
            fast_threshold: 5,
            min_score: 0.5,
            start_detection_ratio: 0.8,
            min_distance: 20.0,
            penalty_distance: 100.0,
            max_area_change: 2.0,
        }
    }
}

impl PatchSettings {
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.first_level > 4 {
            return Err(invalid("first_level", self.first_level as f64, "must be at most 4"));
        }
        if self.max_area_change.is_nan() || self.max_area_change <= 1.0 {
            return Err(invalid("max_area_change", self.max_area_change, "must be above 1"));
        }
        all_positive(&[
            ("intensity_sigma", self.intensity_sigma),
            ("max_residual_ratio", self.max_residual_ratio),
            ("penalty_distance", self.penalty_distance),
        ])?;
        all_not_negative(&[
            ("patches.pixel_sigma", self.pixel_sigma),
            ("template_drift", self.template_drift),
            ("template_parallax", self.template_parallax),
            ("min_score", self.min_score),
            ("start_detection_ratio", self.start_detection_ratio),
            ("min_distance", self.min_distance),
        ])
    }
}
