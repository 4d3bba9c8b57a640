//! The second camera: its current image, and what it measures of landmarks.

use std::sync::Arc;

use nalgebra::Matrix2;

use super::calibrating::update_with_pairs;
use super::epipolar_search::{EpipolarSearch, StereoDepth};
use super::rig::StereoRig;
use crate::camera::model::CameraModel;
use crate::camera::model::check_model;
use crate::error::Error;
use crate::error::invalid;
use crate::filter::estimator::Estimator;
use crate::filter::frontend::patch::{LEVELS, Patch};
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::measurements::inverse_distance::InverseDistanceMeasurement;
use crate::filter::measurements::update::gated_update;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::{PatchSettings, Settings};
use crate::filter::state::bearing::Bearing;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::{Landmark, project};
use crate::samples::ImageView;

/// Two cameras that are nearer to each other, m, are one.
const MIN_BASELINE: f64 = 1e-3;
/// Standard deviations to either side over which a landmark's distance is searched.
const SEARCH_DEVIATIONS: f64 = 3.0;

/// The second camera.
#[derive(Debug, Clone)]
pub(crate) struct StereoCamera {
    pub(crate) rig: StereoRig,
    pyramid: Pyramid,
    /// Whether the pyramid holds the image that belongs to the one of the first camera.
    has_image: bool,
    /// Memory of the points of the first camera.
    pub(crate) points: Vec<PointObservation>,
}

impl StereoCamera {
    /// Refuses a camera that cannot be, or is where the first one is.
    pub(crate) fn new(
        first: &dyn CameraModel,
        camera: Arc<dyn CameraModel>,
        patches: &PatchSettings,
    ) -> Result<Self, Error> {
        check_model(camera.as_ref())?;
        let baseline =
            (camera.body_from_camera().translation.vector - first.body_from_camera().translation.vector).norm();
        if baseline < MIN_BASELINE {
            return Err(invalid("baseline", baseline, "the cameras of a pair must be at least a millimetre apart"));
        }
        let (width, height) = camera.image_size();
        let pyramid = Pyramid::new(width, height, patches.first_level, LEVELS);
        Ok(Self { rig: StereoRig::new(first, camera), pyramid, has_image: false, points: Vec::new() })
    }

    /// Takes the image that belongs to the next one of the first camera, or the message that there is none.
    pub(crate) fn set_image(&mut self, image: Option<&ImageView>) {
        if let Some(image) = image {
            self.pyramid.fill(image);
        }
        self.has_image = image.is_some();
    }

    /// Inverse distance of a new landmark, and its variance, if both cameras see it.
    pub(crate) fn initial_distance(
        &self,
        patch: &Patch,
        bearing: (&Bearing, &Matrix2<f64>),
        settings: &Settings,
    ) -> Option<(f64, f64)> {
        let there = Landmark::new(*bearing.0, InverseDistance::new(1.0), *bearing.1);
        let depth = self.measure(patch, &there, (0.0, 1.0 / settings.stereo.min_distance_m), settings)?;
        // Negative by noise alone: half a deviation, which cannot be told from infinity.
        Some((depth.inverse_distance.max(0.5 * depth.variance.sqrt()), depth.variance))
    }

    /// Updates with the distances of all landmarks, as they are seen now.
    pub(crate) fn update_distances(
        &self,
        estimator: &mut Estimator,
        first: &Pyramid,
        camera: &dyn CameraModel,
        settings: &Settings,
    ) {
        if !self.has_image {
            return;
        }
        if estimator.state.second.is_some() {
            return update_with_pairs(estimator, (first, &self.pyramid), settings);
        }
        for slot in 0..estimator.state.landmarks.len() {
            let landmark = estimator.state.landmarks[slot];
            let row = estimator.state.landmark_row(slot) + 2;
            let deviation = estimator.covariance.variance(row).sqrt();
            let Some((pixel, by_bearing)) = project(camera, &landmark.bearing) else { continue };
            let (Some(patch), Some(warp)) = (Patch::extract(first, &pixel), by_bearing.try_inverse()) else { continue };
            let middle = landmark.inverse_distance.value;
            let range = (middle - SEARCH_DEVIATIONS * deviation, middle + SEARCH_DEVIATIONS * deviation);
            let Some(there) = landmark.extracted_again(warp) else { continue };
            let Some(depth) = self.measure(&patch, &there, range, settings) else { continue };
            let measurement = InverseDistanceMeasurement {
                row,
                predicted: middle,
                measured: depth.inverse_distance,
                variance: depth.variance,
                gate: settings.update.max_mahalanobis,
            };
            gated_update(estimator, &measurement);
        }
    }

    /// Measures the inverse distance of a patch of the first image; `None` without a second image too.
    pub(crate) fn measure(
        &self,
        patch: &Patch,
        there: &Landmark,
        range: (f64, f64),
        settings: &Settings,
    ) -> Option<StereoDepth> {
        let search = EpipolarSearch { rig: &self.rig, pyramid: &self.pyramid, settings };
        self.has_image.then(|| search.measure(patch, there, range))?
    }

    #[cfg(test)]
    pub(crate) fn set_pyramid(&mut self, pyramid: Pyramid) {
        (self.pyramid, self.has_image) = (pyramid, true);
    }
}
