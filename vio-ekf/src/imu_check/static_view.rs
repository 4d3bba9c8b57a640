//! What stays in its place in the images while the camera turns: part of the vehicle, dirt on the lens, or images that stand still.

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector2};

use crate::camera::model::CameraModel;
use crate::filter::point_observation::PointObservation;
use crate::imu_check::bias_at_rest::bias_at_rest;
use crate::imu_check::seen_image::between;
use crate::lie::so3;
use crate::samples::Imu;
use crate::stamp::Stamp;

/// A point tells where it should have moved by this, pixels, as the gyroscope turned...
const TURNED_PX: f64 = 20.0;
/// ... and did not where it has moved by less than this: a place that the camera circles about drifts more.
const STILL_PX: f64 = 1.0;
/// Slower turns may be the gyroscope's bias, s.
const WITHIN_S: f64 = 0.5;
/// Turns that a point must have seen, in all of which it stood still.
const TURNS: usize = 2;
/// Fewer points and smaller shares of the turns are chance: a point that is tracked wrongly.
const FEWEST: usize = 5;
const SMALLEST_SHARE: f64 = 0.08;

/// Points that stand still.
pub(super) struct StaticView {
    /// Their ids, rising.
    pub(super) ids: Vec<u64>,
    /// Their share of all turns that points have seen.
    pub(super) share: f64,
    /// The box around them, pixels.
    pub(super) low: [f64; 2],
    /// As above.
    pub(super) high: [f64; 2],
}

/// What one point has seen.
#[derive(Default)]
struct Track {
    /// The image, counted from 0, from which it is compared, and where it was there.
    anchor: Option<(usize, Vector2<f64>)>,
    turns: usize,
    still: usize,
}

/// Follows points by their ids through images that lie within the samples when `time_offset_s` is added to their stamps.
pub(super) fn static_view(
    samples: &[Imu],
    images: &[(Stamp, Vec<PointObservation>)],
    camera: &dyn CameraModel,
    time_offset_s: f64,
) -> Option<StaticView> {
    let stamps = images.iter().map(|(stamp, _)| stamp.plus_secs(time_offset_s));
    let attitudes = attitudes(samples, stamps, &camera.body_from_camera().rotation);
    let mut tracks: BTreeMap<u64, Track> = BTreeMap::new();
    for (index, (stamp, points)) in images.iter().enumerate() {
        for PointObservation { id, pixel } in points {
            let track = tracks.entry(*id).or_default();
            let (from, was) = *track.anchor.get_or_insert((index, *pixel));
            if stamp.secs_since(images[from].0) > WITHIN_S {
                track.anchor = Some((index, *pixel));
                continue;
            }
            let turned = attitudes[index].inverse() * attitudes[from];
            let Some(bearing) = camera.bearing(&was) else { continue };
            let expected = camera.project(&(turned * bearing.into_inner()));
            if expected.is_some_and(|expected| (expected - was).norm() < TURNED_PX) {
                continue;
            }
            track.turns += 1;
            track.still += usize::from((pixel - was).norm() < STILL_PX);
            track.anchor = Some((index, *pixel));
        }
    }
    let all: usize = tracks.values().map(|track| track.turns).sum();
    let is_static = |track: &Track| track.turns >= TURNS && track.still == track.turns;
    let ids: Vec<u64> = tracks.iter().filter(|(_, track)| is_static(track)).map(|(id, _)| *id).collect();
    let turns: usize = ids.iter().map(|id| tracks[id].turns).sum();
    let share = turns as f64 / all.max(1) as f64;
    if ids.len() < FEWEST || share < SMALLEST_SHARE {
        return None;
    }
    let places = || ids.iter().filter_map(|id| Some(tracks[id].anchor?.1));
    let low = places().fold(Vector2::repeat(f64::INFINITY), |low, at| low.inf(&at));
    let high = places().fold(Vector2::repeat(f64::NEG_INFINITY), |high, at| high.sup(&at));
    Some(StaticView { ids, share, low: low.into(), high: high.into() })
}

/// Attitude of the camera at each image, by the gyroscope alone, in the body's axes at the first.
fn attitudes(
    samples: &[Imu],
    stamps: impl Iterator<Item = Stamp>,
    body_from_camera: &UnitQuaternion<f64>,
) -> Vec<UnitQuaternion<f64>> {
    let bias = bias_at_rest(samples);
    let mut attitude = UnitQuaternion::identity();
    let mut before: Option<Stamp> = None;
    let turned = |stamp: Stamp| {
        let readings = before.map_or_else(Vec::new, |before| between(samples, before, stamp));
        for pair in readings.windows(2) {
            let rate = 0.5 * (pair[0].gyro + pair[1].gyro) - bias;
            attitude *= so3::exp(&(rate * pair[1].stamp.secs_since(pair[0].stamp)));
        }
        before = Some(stamp);
        attitude * body_from_camera
    };
    stamps.map(turned).collect()
}
