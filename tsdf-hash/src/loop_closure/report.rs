//! What is found and corrected.

use nalgebra::Isometry3;

use crate::bundle_adjustment::adjust::BundleAdjustmentReport;
use crate::tracking::drift::Drift;

/// A loop that was found.
#[derive(Clone, Debug)]
pub struct LoopClosure {
    /// The keyframe of the old visit.
    pub old: usize,
    /// The present keyframe.
    pub present: usize,
    /// What was measured between them, before anything was corrected.
    pub drift: Drift,
}

/// What became of a frame.
#[derive(Clone, Debug, Default)]
pub struct LoopReport {
    /// Its number, if it became a keyframe.
    pub keyframe: Option<usize>,
    /// Old keyframes that the present one was compared with.
    pub compared: usize,
    /// Loops that were found.
    pub loops: Vec<LoopClosure>,
    /// Where the keyframes were before the correction, if there was one; where they are now says [`LoopCloser::poses`](crate::loop_closure::LoopCloser::poses).
    pub corrected_from: Option<Vec<Isometry3<f64>>>,
    /// The dense bundle adjustment after it.
    pub adjustment: Option<BundleAdjustmentReport>,
}
