//! Whether the images of two cameras are exchanged.

use std::sync::Arc;

use nalgebra::Vector2;

use crate::camera::model::CameraModel;
use crate::filter::frontend::corner_detector::DetectionCriteria;
use crate::filter::frontend::image_frontend::ImageFrontend;
use crate::filter::settings::Settings;
use crate::filter::state::landmark::unproject;
use crate::filter::stereo::stereo_camera::StereoCamera;
use crate::samples::ImageView;

/// Pairs that are looked at, and how many others lie between two of them.
const PAIRS: usize = 5;
const EVERY: usize = 20;
/// Corners of the first image that are looked for in the second.
const CORNERS: usize = 60;
/// Exchanged are images in which so many times as many corners are found the other way round, and so many more.
const CLEARLY_MORE: (usize, usize) = (2, 15);

/// Counts the corners that are found in the other image on their epipolar line and in front of the cameras: as the images are given,
/// and the other way round.
#[derive(Debug, Clone)]
pub(super) struct PairOrder {
    cameras: [Arc<dyn CameraModel>; 2],
    settings: Settings,
    seen: usize,
    found: [usize; 2],
}

impl PairOrder {
    pub(super) fn new(cameras: [Arc<dyn CameraModel>; 2], settings: &Settings) -> Self {
        Self { cameras, settings: *settings, seen: 0, found: [0; 2] }
    }

    /// Takes a pair; once enough were seen, whether they are exchanged: corners found as given, and the other way round.
    pub(super) fn pair(&mut self, first: &ImageView, second: &ImageView) -> Option<[usize; 2]> {
        let looked_at = self.seen.is_multiple_of(EVERY) && self.seen / EVERY < PAIRS;
        self.seen += 1;
        if !looked_at {
            return None;
        }
        let [left, right] = &self.cameras;
        self.found[0] += self.count([left, right], first, second);
        self.found[1] += self.count([right, left], first, second);
        let [given, exchanged] = self.found;
        let clearly = exchanged >= CLEARLY_MORE.0 * given && exchanged >= given + CLEARLY_MORE.1;
        (clearly && self.seen > EVERY).then_some(self.found)
    }

    fn count(&self, [one, other]: [&Arc<dyn CameraModel>; 2], image: &ImageView, beside: &ImageView) -> usize {
        if image.checked(one.image_size()).is_err() || beside.checked(other.image_size()).is_err() {
            return 0;
        }
        let mut frontend = ImageFrontend::new(one.as_ref(), &self.settings.patches);
        let Ok(mut pair) = StereoCamera::new(one.as_ref(), Arc::clone(other), &self.settings.patches) else { return 0 };
        frontend.set_image(image);
        pair.set_image(Some(beside));
        let criteria = DetectionCriteria::from(&self.settings.patches);
        let ImageFrontend { pyramid, detector, .. } = &mut frontend;
        detector.detect(pyramid, &std::iter::empty::<Vector2<f64>>(), &criteria);
        let corners = std::iter::from_fn(|| detector.take_best(pyramid, &criteria)).take(CORNERS);
        let is_found = |(pixel, patch): (Vector2<f64>, _)| {
            let (bearing, warp) = unproject(one.as_ref(), &pixel)?;
            pair.initial_distance(&patch, (&bearing, &warp), &self.settings)
        };
        corners.filter_map(is_found).count()
    }
}
