//! Whether the camera is what it is said to be, from the images of a run.

use nalgebra::Isometry3;

use crate::images::{DepthView, Intrinsics};
use crate::settings::NoiseModel;
use crate::slam::self_calibration::{Fit, Kept, Pinhole, fit};
use crate::tracking::image_level::ImageLevel;

/// Pixels in a row of what is kept, about.
const COLUMNS: usize = 160;
/// An image is kept when the camera has turned by so much since the last one, radians (ours: 4 degrees).
const TURN: f64 = 0.07;
/// Images that are kept.
const MOST: usize = 16;
/// Pairs are at most so many kept images apart.
const LONGEST: usize = 3;
/// Fewer pairs say nothing.
const LEAST_PAIRS: usize = 4;
/// Smallest changes that are worth a doubt: of the focal length, and of the centre by the focal length (ours).
const LEAST_CHANGE: [f64; 3] = [0.04, 0.04, 0.04];
/// Of its standard deviations (ours).
const SIGNIFICANT: f64 = 4.0;
/// Of the points that do not agree, at most so many are left with the other camera (ours).
const LEFT: f64 = 0.85;

/// The images of a run fit each other clearly better with another camera than with the one that was given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraDoubt {
    /// The camera with which they fit best.
    pub fits_better: Intrinsics,
    /// Standard deviation of its focal length, as a share.
    pub focal_deviation: f64,
    /// Share of the points of an image that agree with those of another one, with the camera that was given and with this one.
    pub agreement: [f64; 2],
}

/// Images from different directions.
#[derive(Debug, Default)]
pub(crate) struct CameraCheck {
    given: Option<Intrinsics>,
    kept: Vec<Kept>,
}

impl CameraCheck {
    /// Takes a frame that has its pose; whether it was the last one that is kept.
    pub(crate) fn add(&mut self, depth: &DepthView, world_from_camera: &Isometry3<f64>) -> bool {
        let full = self.kept.len() >= MOST;
        let turned = |last: &Kept| last.world_from_camera.rotation.angle_to(&world_from_camera.rotation) >= TURN;
        if full || !self.kept.last().is_none_or(turned) {
            return false;
        }
        let mut level = ImageLevel::default();
        level.read(depth, None, (depth.width / COLUMNS).max(1), [1e-3, 1e3]);
        self.given = Some(depth.intrinsics);
        self.kept.push(Kept { level, world_from_camera: *world_from_camera });
        self.kept.len() == MOST
    }

    /// Whether another camera fits clearly better.
    pub(crate) fn doubt(&self, noise: &NoiseModel) -> Option<CameraDoubt> {
        let given = self.given?;
        let pairs: Vec<[usize; 2]> = (0..self.kept.len())
            .flat_map(|to| (to.saturating_sub(LONGEST)..to).flat_map(move |from| [[from, to], [to, from]]))
            .collect();
        if pairs.len() < LEAST_PAIRS {
            return None;
        }
        let [as_given, best] = [false, true].map(|free| fit(&self.kept, &pairs, noise, free));
        let (as_given, best) = (as_given?, best?);
        is_better(&as_given, &best).then(|| {
            let camera = Pinhole { focal: [given.fx, given.fy], centre: [given.cx, given.cy] }.changed(&best.change);
            let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
            CameraDoubt {
                fits_better: Intrinsics { fx, fy, cx, cy },
                focal_deviation: best.deviation[0],
                agreement: [as_given.agreement, best.agreement],
            }
        })
    }
}

fn is_better(as_given: &Fit, best: &Fit) -> bool {
    let clear = |k: usize| {
        let size = best.change[k].abs();
        size > LEAST_CHANGE[k] && size > SIGNIFICANT * best.deviation[k]
    };
    (0..3).any(clear) && 1.0 - best.agreement < LEFT * (1.0 - as_given.agreement)
}
