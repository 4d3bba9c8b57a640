//! What the points of a caller's tracker do to the filter.

use super::landmarks;
use super::measurements::patch::WITHOUT_LENS;
use super::measurements::pixel::PixelMeasurement;
use super::measurements::update::gated_update;
use super::point_observation::PointObservation;
use super::report::FrameReport;
use super::settings::Settings;
use super::state::landmark::unproject;
use super::state::rolling_shutter::RollingShutter;
use super::tracking_state::{LandmarkTrack, TrackingState};
use crate::camera::model::CameraModel;

/// Updates with all landmarks that are among the points, unless the body is stationary.
pub(crate) fn update_with_points(
    tracking: &mut TrackingState,
    points: &[PointObservation],
    camera: &dyn CameraModel,
    settings: &Settings,
    report: &mut FrameReport,
) {
    let offset = tracking.estimator.state.time_offset;
    for track in &mut tracking.tracks {
        track.in_view = false;
    }
    for point in points {
        let Some(slot) = tracking.slot_of(point.id) else { continue };
        let TrackingState { estimator, tracks, .. } = tracking;
        let track = &mut tracks[slot];
        track.in_view = true;
        if report.stationary {
            continue;
        }
        let landmark = estimator.state.landmarks[slot];
        let lens = estimator.state.lens;
        let measurement = PixelMeasurement::<WITHOUT_LENS> {
            row: estimator.state.landmark_row(slot),
            pixel: point.pixel,
            landmark,
            rate: estimator.bearing_rate(&landmark),
            time_offset_error: estimator.state.time_offset - offset,
            shutter: RollingShutter::new(camera, estimator.state.row_time),
            camera,
            lens,
            landmarks: &settings.landmarks,
            update: &settings.update,
        };
        let used = match lens {
            None => gated_update(estimator, &measurement),
            Some(_) => gated_update(estimator, &measurement.with_lens()),
        };
        if used {
            report.used += 1;
            track.failures = 0;
        } else {
            report.rejected += 1;
            track.failures += 1;
        }
    }
}

/// Drops landmarks that are not among the points, or failed too often.
pub(crate) fn drop_points(tracking: &mut TrackingState, settings: &Settings, report: &mut FrameReport) {
    for slot in (0..tracking.tracks.len()).rev() {
        let track = &tracking.tracks[slot];
        if !track.in_view || track.failures >= settings.update.max_consecutive_failures {
            tracking.remove(slot);
            report.removed += 1;
        }
    }
}

/// Adds points that are new as landmarks, while there is room; returns how many.
pub(crate) fn add_points(
    tracking: &mut TrackingState,
    points: &[PointObservation],
    camera: &dyn CameraModel,
    settings: &Settings,
) -> usize {
    let before = tracking.tracks.len();
    let shutter = RollingShutter::new(camera, tracking.estimator.state.row_time);
    for point in points {
        if tracking.tracks.len() == settings.landmarks.max_count {
            break;
        }
        if tracking.slot_of(point.id).is_some() {
            continue;
        }
        let Some((bearing, warp)) = unproject(camera, &point.pixel) else { continue };
        let covariance = warp * warp.transpose() * settings.landmarks.pixel_sigma.powi(2);
        let (bearing, delayed) =
            landmarks::at_stamp(&tracking.estimator, bearing, warp, shutter.delay(&point.pixel), None);
        landmarks::add(&mut tracking.estimator, bearing, warp, &(covariance + delayed));
        tracking.tracks.push(LandmarkTrack::new(point.id, None));
    }
    tracking.tracks.len() - before
}
