//! A filter that has been initialised: the estimator, and what is remembered of each landmark besides its state.

use nalgebra::Vector3;

use super::accel_matrix_selection::AccelMatrixSelection;
use super::calibration_prior::prior_sigma;
use super::estimator::Estimator;
use super::frontend::patch::Patch;
use super::frontend::patch_slant::PatchSlant;
use super::innovation_adaptation::{BeforeImage, InnovationAdaptation};
use super::landmarks;
use super::settings::PatchSettings;
use crate::camera::model::CameraModel;
use crate::inertial::imu_noise_estimator::{AccelMatrixEstimation, ImuSettings};
use crate::samples::Imu;
use crate::stamp::Stamp;

/// What is remembered of a landmark besides its state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LandmarkTrack {
    pub(crate) id: u64,
    /// Failures in a row.
    pub(crate) failures: u32,
    /// Whether the current image is to measure it.
    pub(crate) chosen: bool,
    /// Whether the current image, or set of points, sees it.
    pub(crate) in_view: bool,
    /// Its template; none for a point of the caller's own.
    pub(crate) patch: Option<Patch>,
    /// What is known of its surface.
    pub(crate) slant: PatchSlant,
}

impl LandmarkTrack {
    #[allow(clippy::large_types_passed_by_value, reason = "the track keeps the patch: a reference would be copied")]
    pub(crate) fn new(id: u64, patch: Option<Patch>) -> Self {
        Self { id, failures: 0, chosen: true, in_view: true, patch, slant: PatchSlant::default() }
    }
}

/// Estimator and tracks; a track has the index of its landmark's slot.
#[derive(Debug, Clone)]
pub(crate) struct TrackingState {
    pub(crate) estimator: Estimator,
    pub(crate) tracks: Vec<LandmarkTrack>,
    pub(crate) innovations: InnovationAdaptation,
    accel_matrix_selection: AccelMatrixSelection,
    /// Whether the body has been at rest since the initialization.
    pub(crate) rested: bool,
    /// Memory for ordering landmarks.
    pub(crate) ranking: Vec<f64>,
}

impl TrackingState {
    pub(crate) fn new(mut estimator: Estimator, max_count: usize, imu: &ImuSettings) -> Self {
        if imu.accel_matrix == AccelMatrixEstimation::Always {
            estimator.estimate_accel_matrix(&prior_sigma(imu), &Vector3::zeros());
        }
        Self {
            estimator,
            tracks: Vec::with_capacity(max_count),
            innovations: InnovationAdaptation::default(),
            accel_matrix_selection: AccelMatrixSelection::Waiting,
            rested: false,
            ranking: Vec::with_capacity(max_count),
        }
    }

    /// Takes an inertial sample.
    pub(crate) fn imu(&mut self, sample: &Imu) {
        let Self { estimator, tracks, .. } = self;
        if estimator.buffer.is_full() {
            estimator.free_buffer(|slot| {
                tracks.swap_remove(slot);
            });
        }
        estimator.imu(*sample);
    }

    /// Propagates to a later time; returns how many landmarks were lost on the way.
    pub(crate) fn propagate_to(&mut self, until: Stamp) -> usize {
        let Self { estimator, tracks, .. } = self;
        let before = tracks.len();
        estimator.propagate_to(until, |slot| {
            tracks.swap_remove(slot);
        });
        before - tracks.len()
    }

    /// Lets noise and matrix of the inertial sensor follow what an image has corrected.
    pub(crate) fn adapt_imu(&mut self, before: &BeforeImage, settings: &ImuSettings) {
        let Self { estimator, innovations, .. } = self;
        let correction = before.correction(estimator);
        innovations.update(&correction, settings.max_innovation_inflation);
        estimator.buffer.set_noise_factors(innovations.factors());
        self.select_accel_matrix(before, settings);
    }

    /// The matrix alone.
    pub(crate) fn select_accel_matrix(&mut self, before: &BeforeImage, settings: &ImuSettings) {
        let Self { estimator, innovations, accel_matrix_selection, rested, .. } = self;
        let correction = before.correction(estimator);
        if settings.accel_matrix == AccelMatrixEstimation::WhenNeeded {
            let evidence = (innovations.factors()[1], *rested);
            accel_matrix_selection.update(&correction, evidence, estimator, settings);
        }
    }

    /// Process noise of the templates over some seconds: with time, and with the angle by which the point is seen from elsewhere.
    pub(crate) fn drift_templates(&mut self, camera: &dyn CameraModel, settings: &PatchSettings, elapsed: f64) {
        let square = |pixels: f64| (pixels / camera.focal_length()).powi(2);
        let (by_time, by_angle) = (square(settings.template_drift) * elapsed, square(settings.template_parallax));
        self.estimator.inflate_bearings(|parallax| by_time + by_angle * parallax * elapsed);
    }

    /// Drops a landmark; the last one takes its slot.
    pub(crate) fn remove(&mut self, slot: usize) {
        self.tracks.swap_remove(slot);
        landmarks::remove(&mut self.estimator, slot);
    }

    /// Slot of a landmark.
    pub(crate) fn slot_of(&self, id: u64) -> Option<usize> {
        self.tracks.iter().position(|track| track.id == id)
    }
}
