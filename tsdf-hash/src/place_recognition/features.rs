//! Corners of a frame with their descriptors and their places in space.

use crate::place_recognition::corners::corners;
use crate::place_recognition::descriptor::{Descriptor, RADIUS};
use crate::place_recognition::grey_image::GreyImage;
use crate::tracking::image_level::ImageLevel;

/// Corners of the image and of three smaller ones, each 5/7 of the one before: as many per area.
const COUNTS: [usize; 4] = [480, 240, 120, 60];
/// How much larger a pixel is from image to image.
const RATIO: f32 = 7.0 / 5.0;

/// A corner with depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Feature {
    /// In the camera, metres.
    pub(crate) point: [f32; 3],
    pub(crate) descriptor: Descriptor,
}

/// At most 900 features of a frame, of its intensities. What has no depth is left out.
pub(crate) fn features(level: &ImageLevel) -> Vec<Feature> {
    let mut out = Vec::new();
    let Some(mut image) = GreyImage::of_intensity(level) else { return out };
    let mut scale = 1.0;
    for count in COUNTS {
        let smooth = image.smoothed();
        for corner in corners(&image, count, RADIUS + 1) {
            let [u, v] = [corner.u, corner.v].map(|x| (x as f32 + 0.5) * scale - 0.5);
            let Some(point) = point(level, u, v) else { continue };
            out.push(Feature { point, descriptor: Descriptor::of_patch(&image, &smooth, corner.u, corner.v) });
        }
        image = image.reduced();
        scale *= RATIO;
    }
    out
}

/// The surface at a pixel: at a corner of a thing that of the thing, which is nearer than what is behind it.
fn point(level: &ImageLevel, u: f32, v: f32) -> Option<[f32; 3]> {
    let (x, y) = (u.round() as isize, v.round() as isize);
    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
    let inside =
        around.filter(|(x, y)| (0..level.width as isize).contains(x) && (0..level.height as isize).contains(y));
    let omega = inside.map(|(x, y)| level.omega[y as usize * level.width + x as usize]).fold(0.0_f32, f32::max);
    let ray = [(u - level.centre[0]) / level.focal[0], (v - level.centre[1]) / level.focal[1], 1.0];
    (omega > 0.0).then(|| ray.map(|r| r / omega))
}
