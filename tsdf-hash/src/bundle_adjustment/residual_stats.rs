//! Spread of the residuals of a linearisation, and brightness of each keyframe.

use crate::tracking::residual_scale::ResidualHistogram;

/// Distances are counted up to so many standard deviations of the noise model, intensities up to so many grey levels.
const MOST: [f32; 2] = [16.0, 64.0];
/// Distances are not known better than this share of the noise model (ours).
const LEAST_DEPTH_SCALE: f64 = 0.1;
/// Intensities are not known better than this, grey levels.
const LEAST_INTENSITY_SCALE: f64 = 1.0;

/// Standard deviations of distances, as a multiple of the noise model's, and of intensities, grey levels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scales {
    pub(crate) depth: f64,
    pub(crate) intensity: f64,
}

/// Residuals of one linearisation.
pub(crate) struct ResidualStats {
    /// That the residuals are weighed by.
    pub(crate) scales: Scales,
    pub(crate) terms: usize,
    pub(crate) depth: ResidualHistogram,
    intensity: ResidualHistogram,
    /// For each keyframe the sum of its intensities above those of the points, and their number.
    brightness: Vec<[f64; 2]>,
}

impl ResidualStats {
    pub(crate) fn new(frames: usize, scales: Scales) -> Self {
        let [depth, intensity] = MOST.map(ResidualHistogram::new);
        Self { scales, terms: 0, depth, intensity, brightness: vec![[0.0; 2]; frames] }
    }

    pub(crate) fn add_intensity(&mut self, frame: usize, residual: f64) {
        self.intensity.add(residual as f32);
        let [sum, count] = &mut self.brightness[frame];
        (*sum, *count) = (*sum + residual, *count + 1.0);
    }

    /// The spread that was found.
    pub(crate) fn spread(&self) -> Scales {
        let found = |of: &ResidualHistogram, before: f64, least: f64| {
            if of.total > 0 { of.deviation().max(least) } else { before }
        };
        Scales {
            depth: found(&self.depth, self.scales.depth, LEAST_DEPTH_SCALE),
            intensity: found(&self.intensity, self.scales.intensity, LEAST_INTENSITY_SCALE),
        }
    }

    /// By how much each keyframe is brighter still than it was taken to be.
    pub(crate) fn brighter(&self) -> impl Iterator<Item = f64> {
        self.brightness.iter().map(|[sum, count]| sum / count.max(1.0))
    }
}
