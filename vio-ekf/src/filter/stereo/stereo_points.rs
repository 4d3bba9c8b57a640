//! Points of a caller's tracker in the image of the second camera.

use nalgebra::Vector2;

use super::rig::StereoRig;
use crate::error::Error;
use crate::filter::estimator::Estimator;
use crate::filter::measurements::stereo_pixel::StereoPixelMeasurement;
use crate::filter::measurements::update::gated_update;
use crate::filter::point_observation::PointPair;
use crate::filter::report::FrameReport;
use crate::filter::settings::Settings;
use crate::filter::state::inverse_distance::InverseDistance;
use crate::filter::state::landmark::Landmark;
use crate::filter::tracking_state::TrackingState;
use crate::stamp::Stamp;

/// Length of a last step of the triangulation, pixels.
const TOLERANCE: f64 = 0.01;

/// Refuses pixels that are not finite.
pub(crate) fn check_pairs(pairs: &[PointPair]) -> Result<(), Error> {
    let wrong = |pair: &PointPair| pair.second.is_some_and(|pixel| pixel.iter().any(|v| !v.is_finite()));
    match pairs.iter().position(wrong) {
        Some(index) => Err(Error::NonFinite { what: "point in the second image", index }),
        None => Ok(()),
    }
}

/// Updates with the pixels of the second image, after those of the first; new landmarks are triangulated before.
pub(crate) fn update_with_second_points(
    tracking: &mut TrackingState,
    (stamp, pairs): (Stamp, &[PointPair]),
    rig: &StereoRig,
    settings: &Settings,
    report: &FrameReport,
) {
    // The offset by which the image was placed in time, before this image's landmarks had changed it.
    let offset = tracking.estimator.buffer.state_stamp().secs_since(stamp);
    let known = tracking.tracks.len() - report.added.min(tracking.tracks.len());
    for pair in pairs {
        let (Some(slot), Some(pixel)) = (tracking.slot_of(pair.first.id), pair.second) else { continue };
        let is_new = slot >= known;
        if is_new {
            triangulate(rig, &mut tracking.estimator, slot, &pixel, settings);
        } else if report.stationary {
            continue;
        }
        let landmark = tracking.estimator.state.landmarks[slot];
        let measurement = StereoPixelMeasurement {
            row: tracking.estimator.state.landmark_row(slot),
            pixel,
            landmark,
            rate: tracking.estimator.bearing_rate(&landmark),
            time_offset_error: tracking.estimator.state.time_offset - offset,
            rig,
            landmarks: &settings.landmarks,
            update: &settings.update,
        };
        gated_update(&mut tracking.estimator, &measurement);
    }
    tracking.estimator.update_prediction();
}

/// Moves a new landmark to where both cameras see it, as uncertain as any other: the update that follows weighs the pixels.
fn triangulate(rig: &StereoRig, estimator: &mut Estimator, slot: usize, pixel: &Vector2<f64>, settings: &Settings) {
    let landmark = estimator.state.landmarks[slot];
    let mut value = landmark.inverse_distance.value;
    for _ in 0..settings.update.max_iterations {
        let Some(projection) = rig.project(&Landmark { inverse_distance: InverseDistance::new(value), ..landmark })
        else {
            return;
        };
        let slope = projection.by_inverse_distance;
        let step = slope.dot(&(pixel - projection.pixel)) / slope.norm_squared();
        value += step;
        if step.abs() * slope.norm() < TOLERANCE {
            break;
        }
    }
    // What is too far to be told from infinity stays at the shared depth prior.
    if !(f64::MIN_POSITIVE..1.0 / settings.stereo.min_distance_m).contains(&value) {
        return;
    }
    let deviation = settings.landmarks.inverse_distance_sigma * landmark.inverse_distance.value.max(value);
    estimator.state.landmarks[slot].inverse_distance = InverseDistance::new(value);
    estimator.covariance.reset_row(estimator.state.landmark_row(slot) + 2, deviation * deviation);
}
