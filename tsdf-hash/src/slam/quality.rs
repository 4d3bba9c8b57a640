//! What a run must notice by itself: pixels that are not fused, and depth that contradicts the map.

use nalgebra::Isometry3;

use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::images::DepthView;
use crate::report::FrameReport;
use crate::settings::Settings;
use crate::slam::outcome::Event;
use crate::tracking::outcome::PosePrior;
use crate::tracking::settings::TrackingSettings;
use crate::tracking::tracker::Tracker;

/// Less overlap with the map says nothing about the poses.
const OVERLAP: f64 = 0.3;

/// What was measured and what became of it.
#[derive(Debug, Clone, Default)]
pub struct Quality {
    /// Pixels of the depth images.
    pub pixels: usize,
    /// Those with a depth in the range.
    pub valid: usize,
    /// Those of them that were fused.
    pub fused: usize,
    /// Gaps of one pixel that were filled and fused.
    pub filled: usize,
    /// Of frames that see what frames before have seen: share of the pixels that agree with the map at the frame's pose, before it
    /// is fused.
    pub agreement: Vec<f64>,
    warned: [bool; 2],
}

impl Quality {
    /// Shares of fused pixels below this are told at once (ours).
    pub const LEAST_FUSED_SHARE: f64 = 0.5;
    /// Agreement below this is told: with the right camera and poses a centimetre off it is 0.86 (ours).
    pub const LEAST_AGREEMENT: f64 = 0.65;

    /// Share of the valid pixels that were fused; 1 of none.
    pub fn fused_share(&self) -> f64 {
        if self.valid == 0 { 1.0 } else { self.fused as f64 / self.valid as f64 }
    }

    /// The middle agreement; 1 of none.
    pub fn median_agreement(&self) -> f64 {
        let mut sorted = self.agreement.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
    }

    /// A frame of so many pixels was fused.
    pub(crate) fn count(&mut self, frame: usize, pixels: usize, report: &FrameReport) -> Option<Event> {
        self.pixels += pixels;
        self.valid += report.valid_pixels;
        self.fused += report.fused_pixels;
        self.filled += report.filled_pixels;
        let share = report.fused_pixels as f64 / report.valid_pixels.max(1) as f64;
        let low = share < Self::LEAST_FUSED_SHARE && !std::mem::replace(&mut self.warned[0], true);
        low.then_some(Event::LowFusedShare { frame, share })
    }

    /// The agreement of a frame with the map at a pose.
    pub(crate) fn check(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        pose: &Isometry3<f64>,
    ) -> Result<Option<Event>, Error> {
        let &Settings { noise, threads, .. } = map.settings();
        let settings =
            TrackingSettings { iterations: [0; 3], photometric: false, noise, threads, ..TrackingSettings::default() };
        let prior = PosePrior { world_from_camera: *pose, covariance: None };
        let outcome = Tracker::new(settings)?.track(map, depth, None, &prior)?;
        if outcome.overlap >= OVERLAP {
            self.agreement.push(outcome.agreement);
        }
        let agreement = self.median_agreement();
        let low = self.agreement.len() >= 2
            && agreement < Self::LEAST_AGREEMENT
            && !std::mem::replace(&mut self.warned[1], true);
        Ok(low.then_some(Event::LowAgreement { agreement }))
    }
}
