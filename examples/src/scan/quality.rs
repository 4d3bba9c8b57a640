//! What a run must notice by itself: pixels that are not fused, and depth that contradicts the map.

use nalgebra::Isometry3;
use tsdf_hash::{DepthView, FrameReport, PosePrior, Tracker, TrackingSettings};

use super::error::ScanError;
use super::map_store::MapStore;

/// Shares below this are warned about at once.
const LOW: f64 = 0.5;
/// Agreement below this is warned about: with the right camera and poses a centimetre off it is 0.86 (ours).
const LOW_AGREEMENT: f64 = 0.65;
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
    /// Frames whose colour image could not be read.
    pub without_colour: usize,
    warned: [bool; 2],
}

impl Quality {
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

    pub(super) fn count(&mut self, name: &str, pixels: usize, report: &FrameReport) {
        self.pixels += pixels;
        self.valid += report.valid_pixels;
        self.fused += report.fused_pixels;
        self.filled += report.filled_pixels;
        let share = report.fused_pixels as f64 / report.valid_pixels.max(1) as f64;
        if share < LOW && !std::mem::replace(&mut self.warned[0], true) {
            eprintln!(
                "warning: {name}: only {:.0} % of the valid pixels were fused: neighbouring depths differ by more than the \
                 noise of the camera. Check --depth-scale, or tell the noise by --noise",
                100.0 * share
            );
        }
    }

    /// The agreement of a frame with the map at a pose.
    pub(super) fn check(
        &mut self,
        name: &str,
        store: &mut MapStore,
        depth: &DepthView,
        pose: &Isometry3<f64>,
    ) -> Result<(), ScanError> {
        let &tsdf_hash::Settings { noise, threads, .. } = store.settings();
        let settings =
            TrackingSettings { iterations: [0; 3], photometric: false, noise, threads, ..TrackingSettings::default() };
        let prior = PosePrior { world_from_camera: *pose, covariance: None };
        let outcome = Tracker::new(settings)?.track(store.dense(), depth, None, &prior)?;
        if outcome.overlap >= OVERLAP {
            self.agreement.push(outcome.agreement);
        }
        if self.agreement.len() >= 2
            && self.median_agreement() < LOW_AGREEMENT
            && !std::mem::replace(&mut self.warned[1], true)
        {
            eprintln!(
                "warning: {name}: only {:.0} % of the depth agrees with the map at the given poses: check camera \
                 (--intrinsics), --depth-scale and poses",
                100.0 * self.median_agreement()
            );
        }
        Ok(())
    }

    /// An error if less than half of the work was done.
    pub(super) fn verdict(&self, taken: usize, frames: usize) -> Result<(), ScanError> {
        let percent = |share: f64| 100.0 * share;
        let unusable = |why: String| Err(ScanError::Unusable(format!("the result is written, but not usable: {why}")));
        if 2 * taken < frames {
            // A map that only locates the camera takes nothing in.
            let done = if self.valid == 0 { "found in the map" } else { "fused" };
            return unusable(format!("only {taken} of {frames} frames were {done}"));
        }
        if self.fused_share() < LOW {
            let share = percent(self.fused_share());
            return unusable(format!(
                "only {share:.0} % of the valid pixels were fused: check --depth-scale and --noise"
            ));
        }
        if self.median_agreement() < LOW_AGREEMENT {
            let share = percent(self.median_agreement());
            return unusable(format!(
                "only {share:.0} % of the depth agrees with the map: check camera (--intrinsics), --depth-scale and poses"
            ));
        }
        Ok(())
    }
}
