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
/// Fewer images say nothing.
const LEAST_IMAGES: usize = 3;
/// Smallest changes that are worth a doubt: of the focal length, and of the centre by the focal length (ours).
const LEAST_CHANGE: [f64; 3] = [0.04, 0.04, 0.04];
/// Of its standard deviations (ours).
const SIGNIFICANT: f64 = 4.0;
/// Of the points that do not agree, at most so many are left with the other camera (ours).
const LEFT: f64 = 0.8;
/// What a sensor's own distortion feigns of a change, by the share of the points that do not agree with the best camera either, from three
/// images: it differs from place to place (ours; pieces of a structured-light recording feign up to a fifth).
const FEIGNED: f64 = 0.65;

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
        if self.kept.len() < LEAST_IMAGES {
            return None;
        }
        let [as_given, best] = [false, true].map(|free| fit(&self.kept, &pairs, noise, free));
        let (as_given, best) = (as_given?, best?);
        is_better(&as_given, &best, self.kept.len()).then(|| {
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

/// Whether a camera that was fitted to so many images, three at least, is clearly another one.
fn is_better(as_given: &Fit, best: &Fit, images: usize) -> bool {
    let feigned = FEIGNED * (1.0 - best.agreement) / ((images - 2) as f64).sqrt();
    let clear = |k: usize| {
        let size = best.change[k].abs();
        size > LEAST_CHANGE[k] && size > SIGNIFICANT * best.deviation[k].hypot(feigned)
    };
    (0..3).any(clear) && 1.0 - best.agreement < LEFT * (1.0 - as_given.agreement)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Images, agreement as given and at best, change and its deviation, of pieces of a structured-light recording (7-Scenes, kitchen):
    /// with its own camera, which fits them to some hundredths, and with focal lengths or sides of another one.
    #[test]
    fn the_sensors_own_distortion_is_no_other_camera() {
        let fits = |images: usize, [given, best]: [f64; 2], change: [f64; 3], deviation: [f64; 3]| {
            let [change, deviation] = [change, deviation].map(Vector3::from);
            let as_given = Fit { change: Vector3::zeros(), deviation, agreement: given };
            is_better(&as_given, &Fit { change, deviation, agreement: best }, images)
        };
        assert!(!fits(3, [0.846, 0.886], [0.084, -0.210, 0.007], [0.017, 0.017, 0.025]));
        assert!(!fits(4, [0.914, 0.932], [-0.109, -0.120, -0.049], [0.004, 0.007, 0.010]));
        assert!(!fits(7, [0.907, 0.923], [-0.075, -0.090, -0.070], [0.005, 0.006, 0.005]));
        assert!(!fits(15, [0.897, 0.905], [-0.032, -0.061, -0.033], [0.004, 0.004, 0.005]));
        // 525 and 400 for 585 pixels, and the centre's coordinates swapped.
        assert!(fits(16, [0.883, 0.909], [0.067, -0.073, -0.040], [0.004, 0.004, 0.004]));
        assert!(fits(6, [0.642, 0.874], [0.363, -0.075, -0.048], [0.006, 0.008, 0.010]));
        assert!(fits(15, [0.851, 0.903], [-0.036, 0.075, -0.173], [0.004, 0.003, 0.005]));
        // Nothing feigns where all agrees.
        assert!(fits(16, [0.989, 0.998], [-0.048, 0.0, 0.0], [1e-4; 3]));
    }
}
