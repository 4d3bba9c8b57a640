//! Inverse distance of a patch by search along the epipolar line and photometric refinement.

use super::rig::{StereoProjection, StereoRig};
use crate::filter::frontend::patch::{Comparison, Patch};
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::settings::Settings;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::Landmark;

/// Spacing of the candidates along the epipolar line, pixels.
const SPACING: f64 = 1.0;
/// From this distance on, in pixels, another minimum counts against the uniqueness of the best one.
const MIN_SEPARATION: f64 = 3.0;
/// Largest correction of a candidate by the refinement, pixels.
const MAX_CORRECTION: f64 = 2.0;
/// Length of a last step, pixels.
const TOLERANCE: f64 = 0.01;

/// Inverse distance measured by a pair of images, whatever was assumed of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StereoDepth {
    /// 1/m; by noise it may be negative for what is very far.
    pub(crate) inverse_distance: f64,
    /// Its variance.
    pub(crate) variance: f64,
}

/// The second image, and how to search it.
#[derive(Clone, Copy)]
pub(crate) struct EpipolarSearch<'a> {
    pub(crate) rig: &'a StereoRig,
    pub(crate) pyramid: &'a Pyramid,
    pub(crate) settings: &'a Settings,
}

impl EpipolarSearch<'_> {
    /// Measures the inverse distance of a patch, within a range. The patch is extracted from the first camera's image of the same
    /// moment around the bearing of `there`, which knows how its surface is turned.
    ///
    /// Because the patch is of this moment and from exactly that bearing, neither the error of the bearing nor that of the
    /// time offset matters: what is measured is the distance alone.
    pub(crate) fn measure(&self, patch: &Patch, there: &Landmark, range: (f64, f64)) -> Option<StereoDepth> {
        let project = |inverse_distance| {
            let inverse_distance = InverseDistance::new(inverse_distance);
            self.rig.project(&Landmark { inverse_distance, ..*there })
        };
        let first = self.search(patch, &project, range)?;
        let mut inverse_distance = first;
        for _ in 0..self.settings.update.max_iterations {
            let projection = project(inverse_distance)?;
            let comparison = patch.compare(self.pyramid, &projection.pixel, &projection.warp)?;
            let step = EpipolarStep::new(&comparison, &projection, self.settings)?;
            inverse_distance += step.step;
            let pixels = projection.by_inverse_distance.norm();
            if pixels * step.step.abs() < TOLERANCE {
                let near = pixels * (inverse_distance - first).abs() <= MAX_CORRECTION;
                let similar = comparison.residual <= self.settings.patches.max_residual_ratio * comparison.energy;
                let on_the_line = step.across <= self.settings.update.max_mahalanobis;
                let variance = step.variance;
                return (near && similar && on_the_line).then_some(StereoDepth { inverse_distance, variance });
            }
        }
        None
    }

    /// The best of the candidates along the epipolar line, if it is unique.
    fn search(
        &self,
        patch: &Patch,
        project: &impl Fn(f64) -> Option<StereoProjection>,
        (low, high): (f64, f64),
    ) -> Option<f64> {
        let middle = 0.5 * (low + high);
        let length = project(middle)?.by_inverse_distance.norm() * (high - low);
        let count = (length / SPACING).ceil().clamp(1.0, self.rig.camera.image_size().0 as f64) as u32;
        if count == 1 {
            return Some(middle);
        }
        let candidate = |k: u32| {
            let inverse_distance = low + (high - low) * (f64::from(k) + 0.5) / f64::from(count);
            let projection = project(inverse_distance)?;
            Some((k, inverse_distance, patch.compare_coarse(self.pyramid, &projection.pixel, &projection.warp)?))
        };
        let (best, inverse_distance, comparison) = (0..count)
            .filter_map(candidate)
            .reduce(|best, other| if other.2.ssd < best.2.ssd { other } else { best })?;
        // Residuals after a small shift, because the candidates are a pixel apart, and at least that of the noise.
        let noise = self.settings.patches.intensity_sigma.powi(2) * comparison.freedom;
        let separation = (MIN_SEPARATION * f64::from(count) / length).ceil() as u32;
        let second_best = (0..count)
            .filter(|k| k.abs_diff(best) >= separation)
            .filter_map(candidate)
            .fold(f64::INFINITY, |least, (_, _, comparison)| least.min(comparison.residual));
        let unique = second_best > self.settings.stereo.uniqueness_ratio * comparison.residual.max(noise);
        unique.then_some(inverse_distance)
    }
}

/// A weighted least-squares step along the epipolar line.
struct EpipolarStep {
    /// Of the inverse distance.
    step: f64,
    /// Variance of the inverse distance at the end.
    variance: f64,
    /// Squared Mahalanobis length of what the step leaves, which is across the line.
    across: f64,
}

impl EpipolarStep {
    fn new(comparison: &Comparison, projection: &StereoProjection, settings: &Settings) -> Option<Self> {
        let patch_from_image = projection.warp.try_inverse()?;
        let covariance = comparison.information.try_inverse()?;
        let slope = patch_from_image * projection.by_inverse_distance;
        let shift = covariance * comparison.gradient;
        // Both images are noisy.
        let intensity = (2.0 * settings.patches.intensity_sigma.powi(2)).max(comparison.residual / comparison.freedom);
        let floor = patch_from_image * settings.stereo.pixel_sigma;
        let weight = (covariance * intensity + floor * floor.transpose()).try_inverse()?;
        let information = slope.dot(&(weight * slope));
        let variance = 1.0 / information;
        let step = slope.dot(&(weight * shift)) * variance;
        let left = shift - slope * step;
        let across = left.dot(&(weight * left));
        (step.is_finite() && variance.is_finite() && variance > 0.0).then_some(Self { step, variance, across })
    }
}
