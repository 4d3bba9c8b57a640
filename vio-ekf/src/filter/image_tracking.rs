//! What an image does to the filter: alignment and update landmark by landmark, then landmark management.

use super::estimator::Estimator;
use super::frontend::corner_detector::{CornerDetector, DetectionCriteria};
use super::frontend::image_frontend::ImageFrontend;
use super::frontend::patch::Patch;
use super::frontend::patch_alignment::{PatchAlignment, align_patch};
use super::frontend::patch_slant::PatchSlant;
use super::frontend::pyramid::Pyramid;
use super::landmarks;
use super::measurements::patch::{WITH_LENS, WITHOUT_LENS};
use super::report::FrameReport;
use super::settings::Settings;
use super::state::landmark::unproject;
use super::state::rolling_shutter::RollingShutter;
use super::stereo::stereo_camera::StereoCamera;
use super::tracking_state::{LandmarkTrack, TrackingState};
use crate::camera::model::CameraModel;
use crate::trace::span;

/// Inverse distance beyond which a landmark is too near to be tracked, 1/m.
const MAX_INVERSE_DISTANCE: f64 = 20.0;

/// Aligns the patches of landmarks and updates with those that pass the gates. One after the other, not all at once: each
/// alignment begins from what the landmarks before it have corrected.
pub(crate) fn align_and_update(
    tracking: &mut TrackingState,
    pyramid: &Pyramid,
    camera: &dyn CameraModel,
    settings: &Settings,
    report: &mut FrameReport,
) {
    span!("align_and_update");
    choose(tracking, settings.landmarks.max_measured);
    let TrackingState { estimator, tracks, .. } = tracking;
    let offset = estimator.state.time_offset;
    let shutter = RollingShutter::new(camera, estimator.state.row_time);
    for (slot, track) in tracks.iter_mut().enumerate() {
        let time_offset_error = estimator.state.time_offset - offset;
        estimator.settle(slot);
        if !track.chosen {
            let lens = estimator.state.lens;
            let camera = lens.as_ref().map_or(camera, |lens| lens);
            track.in_view = is_in_view(estimator, slot, track, (pyramid, camera, &shutter));
            continue;
        }
        track.in_view = true;
        // What the landmarks before have told of the lens counts.
        let (input, lens) = ((time_offset_error, pyramid), estimator.state.lens);
        let outcome = match &lens {
            None => update_with_patch::<WITHOUT_LENS>(estimator, slot, track, input, camera, settings),
            Some(lens) => update_with_patch::<WITH_LENS>(estimator, slot, track, input, lens, settings),
        };
        match outcome {
            PatchUpdate::Used => {
                report.used += 1;
                track.failures = 0;
            }
            PatchUpdate::OutOfView => track.in_view = false,
            PatchUpdate::Changed => track.failures += 1,
            PatchUpdate::Failed => {
                report.rejected += 1;
                track.failures += 1;
            }
        }
    }
    estimator.end_updates();
}

/// What a patch did.
enum PatchUpdate {
    OutOfView,
    Failed,
    /// Nothing, and contradicts nothing.
    Changed,
    Used,
}

fn update_with_patch<const C: usize>(
    estimator: &mut Estimator,
    slot: usize,
    track: &mut LandmarkTrack,
    (time_offset_error, pyramid): (f64, &Pyramid),
    camera: &dyn CameraModel,
    settings: &Settings,
) -> PatchUpdate {
    let Some(patch) = &track.patch else { return PatchUpdate::OutOfView };
    match align_patch::<C>(estimator, slot, time_offset_error, (patch, pyramid), camera, settings) {
        PatchAlignment::Converged(measurement, slant) if estimator.update_in_series(&measurement) => {
            if let Some(evidence) = slant {
                track.slant.update(&evidence, &mut estimator.state.landmarks[slot]);
            }
            PatchUpdate::Used
        }
        PatchAlignment::OutOfView => PatchUpdate::OutOfView,
        PatchAlignment::Changed => PatchUpdate::Changed,
        _ => PatchUpdate::Failed,
    }
}

/// Chooses the landmarks that the image measures: those whose bearings are known least, which are the new ones and those that have
/// waited.
fn choose(tracking: &mut TrackingState, most: usize) {
    let TrackingState { estimator, tracks, ranking, .. } = tracking;
    let variance = |slot: usize| {
        let row = estimator.state.landmark_row(slot);
        estimator.covariance.variance(row) + estimator.covariance.variance(row + 1)
    };
    ranking.clear();
    ranking.extend((0..tracks.len()).map(variance));
    let least = match tracks.len().checked_sub(most) {
        Some(others) if others > 0 => *ranking.select_nth_unstable_by(others, f64::total_cmp).1,
        _ => f64::NEG_INFINITY,
    };
    for (slot, track) in tracks.iter_mut().enumerate() {
        track.chosen = variance(slot) >= least;
    }
}

/// Whether the image holds all of a landmark's patch.
fn is_in_view(
    estimator: &Estimator,
    slot: usize,
    track: &LandmarkTrack,
    (pyramid, camera, shutter): (&Pyramid, &dyn CameraModel, &RollingShutter),
) -> bool {
    let landmark = &estimator.state.landmarks[slot];
    let seen = shutter.project(camera, &landmark.bearing, &estimator.bearing_rate(landmark));
    track.patch.is_some()
        && seen.is_some_and(|(pixel, by_bearing)| Patch::is_inside(pyramid, &pixel, &(by_bearing * landmark.warp)))
}

/// Drops landmarks that are seen where the image is masked.
pub(crate) fn drop_masked(
    tracking: &mut TrackingState,
    detector: &CornerDetector,
    camera: &dyn CameraModel,
    report: &mut FrameReport,
) {
    for slot in (0..tracking.tracks.len()).rev() {
        let direction = tracking.estimator.state.landmarks[slot].bearing.direction();
        if camera.project(&direction).is_some_and(|pixel| detector.is_masked(&pixel)) {
            tracking.remove(slot);
            report.removed += 1;
        }
    }
}

/// Drops landmarks that left the view, failed too often or came too near.
pub(crate) fn drop_landmarks(tracking: &mut TrackingState, settings: &Settings, report: &mut FrameReport) {
    for slot in (0..tracking.tracks.len()).rev() {
        let track = &tracking.tracks[slot];
        let inverse_distance = tracking.estimator.state.landmarks[slot].inverse_distance.value;
        let failed = track.failures >= settings.update.max_consecutive_failures;
        if !track.in_view || failed || inverse_distance > MAX_INVERSE_DISTANCE {
            tracking.remove(slot);
            report.removed += 1;
        }
    }
}

/// Extracts templates anew where they are seen at another scale. What is tracked from then on is another point: the one that is
/// seen exactly where the filter estimates the old one.
pub(crate) fn update_templates(
    tracking: &mut TrackingState,
    pyramid: &Pyramid,
    camera: &dyn CameraModel,
    settings: &Settings,
) {
    let TrackingState { estimator, tracks, .. } = tracking;
    let shutter = RollingShutter::new(camera, estimator.state.row_time);
    let settings = &settings.patches;
    for (slot, track) in tracks.iter_mut().enumerate() {
        if track.failures > 0 {
            continue;
        }
        let landmark = estimator.state.landmarks[slot];
        let rate = estimator.bearing_rate(&landmark);
        let Some((pixel, by_bearing)) = shutter.project(camera, &landmark.bearing, &rate) else { continue };
        let area = (by_bearing * landmark.warp).determinant();
        if (1.0 / settings.max_area_change..=settings.max_area_change).contains(&area) {
            continue;
        }
        let (Some(patch), Some(warp)) = (Patch::extract(pyramid, &pixel), by_bearing.try_inverse()) else { continue };
        if patch.shi_tomasi_score() < settings.min_score {
            continue;
        }
        (track.patch, track.slant) = (Some(patch), PatchSlant::default());
        let covariance = warp * warp.transpose() * settings.pixel_sigma.powi(2);
        landmarks::reset_bearing(estimator, slot, warp, &covariance);
    }
}

/// Detects landmarks for the free slots; returns how many.
pub(crate) fn detect_landmarks(
    tracking: &mut TrackingState,
    frontend: &mut ImageFrontend,
    stereo: Option<&StereoCamera>,
    camera: &dyn CameraModel,
    settings: &Settings,
) -> usize {
    span!("detect_landmarks");
    let ImageFrontend { pyramid, detector, next_id } = frontend;
    let TrackingState { estimator, tracks, .. } = tracking;
    let criteria = DetectionCriteria::from(&settings.patches);
    let shutter = RollingShutter::new(camera, estimator.state.row_time);
    let present = estimator.state.landmarks.iter().filter_map(|l| camera.project(&l.bearing.direction()));
    detector.detect(pyramid, &present, &criteria);
    let before = tracks.len();
    while tracks.len() < settings.landmarks.max_count {
        let Some((pixel, patch)) = detector.take_best(pyramid, &criteria) else { break };
        let Some((bearing, warp)) = unproject(camera, &pixel) else { continue };
        let covariance = warp * warp.transpose() * settings.patches.pixel_sigma.powi(2);
        let (bearing, delayed) = landmarks::at_stamp(estimator, bearing, warp, shutter.delay(&pixel), None);
        let covariance = covariance + delayed;
        // While the cameras' calibration is estimated the pair is measured with all that it depends on.
        let known = stereo.filter(|_| estimator.state.second.is_none());
        match known.and_then(|stereo| stereo.initial_distance(&patch, (&bearing, &warp), settings)) {
            Some(measured) => landmarks::add_with_distance(estimator, bearing, warp, &covariance, measured),
            None => landmarks::add(estimator, bearing, warp, &covariance),
        }
        tracks.push(LandmarkTrack::new(*next_id, Some(patch)));
        *next_id += 1;
    }
    tracks.len() - before
}
