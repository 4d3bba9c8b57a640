//! The second camera of a pair tells how far away what the first one sees is.

use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};

use super::bearing::Bearing;
use super::covariance::Measurement;
use super::distance::InverseDistance;
use super::estimator::Estimator;
use super::patch::{Comparison, LEVELS, Patch};
use super::points::{PointObservation, project};
use super::pyramid::Pyramid;
use super::relative::CameraMotion;
use super::settings::{PatchSettings, Settings};
use super::state::{Landmark, at};
use super::update::mahalanobis;
use super::{FrameReport, Vio};
use crate::error::invalid;
use crate::{Camera, Error, ImageView, ImuNoise, Stamp};

/// Spacing of the places that are tried along the epipolar line, pixels.
const SPACING: f64 = 1.0;
/// As far from the best place, in pixels, another one is a rival.
const APART: f64 = 3.0;
/// What is found lies no farther, in pixels, from the place where it was begun.
const REACH: f64 = 2.0;
/// Length of a last step, pixels.
const TOLERANCE: f64 = 0.01;
/// Standard deviations to either side over which a landmark's distance is searched.
const DEVIATIONS: f64 = 3.0;

/// Two cameras that are nearer to each other, m, are one.
const MIN_BASELINE: f64 = 1e-3;

/// How the images of a pair are compared. All ours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct PairSettings {
    /// Standard deviation of a patch's position in the second image that no pixel noise explains, pixels: interpolation,
    /// slanted surfaces, and what is wrong with the calibration of one camera against the other.
    pub pixel_sigma: f64,
    /// Least distance at which a new landmark is looked for, m.
    pub nearest_m: f64,
    /// A landmark is taken to be found if everywhere else along the line as many times as much of it remains unexplained.
    pub distinct: f64,
}

impl Default for PairSettings {
    fn default() -> Self {
        Self { pixel_sigma: 0.3, nearest_m: 0.5, distinct: 2.0 }
    }
}

impl PairSettings {
    /// Refuses values that nothing can be found with.
    pub(super) fn check(&self) -> Result<(), Error> {
        if !(self.pixel_sigma > 0.0 && self.pixel_sigma.is_finite()) {
            return Err(invalid("pair.pixel_sigma", self.pixel_sigma, "must be positive and finite, in pixels"));
        }
        if !(self.nearest_m > 0.0 && self.nearest_m.is_finite()) {
            return Err(invalid("nearest_m", self.nearest_m, "must be positive and finite, in metres"));
        }
        if !(self.distinct >= 1.0 && self.distinct.is_finite()) {
            return Err(invalid("distinct", self.distinct, "must be at least 1"));
        }
        Ok(())
    }
}

impl Vio {
    /// With a second camera fixed beside the first, whose images tell how far away landmarks are: [`image_pair`](Self::image_pair).
    ///
    /// The pose of one camera against the other is taken as known; [`PairSettings::pixel_sigma`] covers what is wrong with it.
    /// The pose that [`CalibrationSettings`](super::CalibrationSettings) lets the filter estimate is that of the first camera on the body.
    pub fn stereo(first: Camera, second: Camera, noise: ImuNoise, settings: Settings) -> Result<Self, Error> {
        second.check()?;
        let baseline = (second.body_from_camera.translation.vector - first.body_from_camera.translation.vector).norm();
        if baseline < MIN_BASELINE {
            return Err(invalid("baseline", baseline, "the cameras of a pair must be at least a millimetre apart"));
        }
        let alone = Self::new(first, noise, settings)?;
        Ok(Self { second: Some(Second::new(&first, second, &settings.patches)), ..alone })
    }

    /// Takes the images that both cameras took at the same moment. Where one of a pair is lost, that of the first camera may be
    /// given to [`image`](Self::image) alone.
    ///
    /// `stamp` is the middle of the exposure by the cameras' clock. Both images must be of their camera's size; a filter that was not
    /// made by [`stereo`](Self::stereo) refuses them.
    pub fn image_pair(&mut self, stamp: Stamp, first: &ImageView, second: &ImageView) -> Result<FrameReport, Error> {
        let first = first.checked(&self.camera)?;
        let Some(other) = &mut self.second else {
            return Err(Error::NoSuch { what: "camera", index: 1, count: 1 });
        };
        let image = second.checked(&other.camera)?;
        other.show(Some(&image));
        self.shown(stamp, &first)
    }
}

/// The second camera, fixed beside the first.
#[derive(Debug, Clone)]
pub(crate) struct Second {
    camera: Camera,
    /// From the first camera's pose to this one's, as if the one had moved there.
    rig: CameraMotion,
    pyramid: Pyramid,
    /// Whether the pyramid holds the image that belongs to the one of the first camera.
    shown: bool,
    /// Memory of [`Vio::point_pairs`].
    pub(super) points: Vec<PointObservation>,
}

/// Where a landmark is in the second image if its inverse distance is a given one.
pub(super) struct Place {
    pub(super) pixel: Vector2<f64>,
    /// Pixels of the image per pixel of the patch.
    pub(super) warp: Matrix2<f64>,
    /// Pixels per inverse distance.
    pub(super) slope: Vector2<f64>,
}

/// What a pair of images says about a landmark, whatever was assumed of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Depth {
    /// 1/m; by noise it may be negative for what is very far.
    pub(crate) inverse_distance: f64,
    /// Its variance.
    pub(crate) variance: f64,
}

impl Second {
    pub(crate) fn new(first: &Camera, camera: Camera, patches: &PatchSettings) -> Self {
        let pyramid = Pyramid::new(camera.width, camera.height, patches.first_level, LEVELS);
        let rig = CameraMotion::between(first, &camera);
        Self { camera, rig, pyramid, shown: false, points: Vec::new() }
    }

    pub(crate) fn show(&mut self, image: Option<&ImageView>) {
        if let Some(image) = image {
            self.pyramid.fill(image);
        }
        self.shown = image.is_some();
    }

    #[cfg(test)]
    pub(super) fn take(&mut self, pyramid: Pyramid) {
        (self.pyramid, self.shown) = (pyramid, true);
    }

    /// Inverse distance of a new landmark, and its variance, if both cameras see it.
    pub(crate) fn first_sight(
        &self,
        patch: &Patch,
        look: (&Bearing, &Matrix2<f64>),
        settings: &Settings,
    ) -> Option<(f64, f64)> {
        let depth = self.measure(patch, look, (0.0, 1.0 / settings.pair.nearest_m), settings)?;
        // Farther than infinity by noise alone: as far as cannot be told from it.
        Some((depth.inverse_distance.max(0.5 * depth.variance.sqrt()), depth.variance))
    }

    /// Measures the distances of all landmarks, as they are seen now.
    pub(crate) fn correct(&self, estimator: &mut Estimator, first: &Pyramid, camera: &Camera, settings: &Settings) {
        if !self.shown {
            return;
        }
        for slot in 0..estimator.state.landmarks.len() {
            let landmark = estimator.state.landmarks[slot];
            let row = at::landmark(slot) + 2;
            let deviation = estimator.covariance.variance(row).sqrt();
            let Some((pixel, by_bearing)) = project(camera, &landmark.bearing) else { continue };
            let (Some(patch), Some(warp)) = (Patch::take(first, &pixel), by_bearing.try_inverse()) else { continue };
            let middle = landmark.inverse_distance.value;
            let range = (middle - DEVIATIONS * deviation, middle + DEVIATIONS * deviation);
            let Some(depth) = self.measure(&patch, (&landmark.bearing, &warp), range, settings) else { continue };
            let measurement = Measurement {
                rows: [row],
                residual: Vector1::new(depth.inverse_distance - middle),
                jacobian: Matrix1::new(1.0),
                noise: Matrix1::new(depth.variance),
            };
            if mahalanobis(&estimator.covariance, &measurement).is_some_and(|d| d <= settings.gates.mahalanobis) {
                estimator.update(&measurement);
            }
        }
    }

    /// Looks for a patch, taken from the first camera's image of the same moment around a bearing, where landmarks with
    /// inverse distances of a range are seen. `warp` is tangent coordinates by pixels of the patch.
    ///
    /// Because the patch is of this moment and from exactly that bearing, neither the error of the bearing nor that of the
    /// clock matters: what is measured is the distance alone.
    pub(crate) fn measure(
        &self,
        patch: &Patch,
        (bearing, warp): (&Bearing, &Matrix2<f64>),
        (low, high): (f64, f64),
        settings: &Settings,
    ) -> Option<Depth> {
        if !self.shown {
            return None;
        }
        let place = |inverse_distance| {
            let inverse_distance = InverseDistance::new(inverse_distance);
            self.place(&Landmark { bearing: *bearing, inverse_distance, warp: *warp })
        };
        let first = self.seek(patch, &place, (low, high), settings)?;
        let mut inverse_distance = first;
        for _ in 0..settings.gates.iterations {
            let place = place(inverse_distance)?;
            let comparison = patch.compare(&self.pyramid, &place.pixel, &place.warp)?;
            let shift = Shift::new(&comparison, &place, settings)?;
            inverse_distance += shift.step;
            let pixels = place.slope.norm();
            if pixels * shift.step.abs() < TOLERANCE {
                let near = pixels * (inverse_distance - first).abs() <= REACH;
                let clear = comparison.unexplained <= settings.patches.unexplained * comparison.energy;
                let on_the_line = shift.across <= settings.gates.mahalanobis;
                let variance = shift.variance;
                return (near && clear && on_the_line).then_some(Depth { inverse_distance, variance });
            }
        }
        None
    }

    pub(super) fn place(&self, landmark: &Landmark) -> Option<Place> {
        let (seen, transition) = self.rig.carry(landmark)?;
        let (pixel, by_bearing) = project(&self.camera, &seen.bearing)?;
        let slope = by_bearing * transition.by_itself.fixed_view::<2, 1>(0, 2);
        Some(Place { pixel, warp: by_bearing * seen.warp, slope })
    }

    /// The best of some places along the epipolar line, if there is no other as good.
    fn seek(
        &self,
        patch: &Patch,
        place: &impl Fn(f64) -> Option<Place>,
        (low, high): (f64, f64),
        settings: &Settings,
    ) -> Option<f64> {
        let middle = 0.5 * (low + high);
        let length = place(middle)?.slope.norm() * (high - low);
        let count = (length / SPACING).ceil().clamp(1.0, self.camera.width as f64) as u32;
        if count == 1 {
            return Some(middle);
        }
        let tried = |k: u32| {
            let inverse_distance = low + (high - low) * (f64::from(k) + 0.5) / f64::from(count);
            let place = place(inverse_distance)?;
            Some((k, inverse_distance, patch.compare_coarse(&self.pyramid, &place.pixel, &place.warp)?))
        };
        let (best, inverse_distance, comparison) = (0..count)
            .filter_map(tried)
            .reduce(|best, other| if other.2.mismatch < best.2.mismatch { other } else { best })?;
        // After a small shift, because the places are a pixel apart, and at least what noise leaves.
        let noise = settings.patches.grey_sigma.powi(2) * comparison.freedom;
        let apart = (APART * f64::from(count) / length).ceil() as u32;
        let rival = (0..count)
            .filter(|k| k.abs_diff(best) >= apart)
            .filter_map(tried)
            .fold(f64::INFINITY, |least, (_, _, comparison)| least.min(comparison.unexplained));
        (rival > settings.pair.distinct * comparison.unexplained.max(noise)).then_some(inverse_distance)
    }
}

/// A step along the epipolar line.
struct Shift {
    /// Of the inverse distance.
    step: f64,
    /// Variance of the inverse distance at the end.
    variance: f64,
    /// Squared Mahalanobis length of what the step leaves, which is across the line.
    across: f64,
}

impl Shift {
    fn new(comparison: &Comparison, place: &Place, settings: &Settings) -> Option<Self> {
        let patch_from_image = place.warp.try_inverse()?;
        let by_moment = comparison.information.try_inverse()?;
        let slope = patch_from_image * place.slope;
        let shift = by_moment * comparison.moment;
        // Both images are noisy.
        let grey = (2.0 * settings.patches.grey_sigma.powi(2)).max(comparison.unexplained / comparison.freedom);
        let floor = patch_from_image * settings.pair.pixel_sigma;
        let weight = (by_moment * grey + floor * floor.transpose()).try_inverse()?;
        let information = slope.dot(&(weight * slope));
        let variance = 1.0 / information;
        let step = slope.dot(&(weight * shift)) * variance;
        let left = shift - slope * step;
        let across = left.dot(&(weight * left));
        (step.is_finite() && variance.is_finite() && variance > 0.0).then_some(Self { step, variance, across })
    }
}
