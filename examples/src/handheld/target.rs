//! The target: a picture on the atlas of the mesh.

use std::path::Path;

use super::error::HandheldError;
use super::object::SurfaceSample;
use crate::picture_file::open_upright;

/// Wanted thickness of each texel from a picture of the atlas's size: black is a full `coat` (m), white or transparent is bare.
///
/// # Errors
/// A picture that cannot be read, or of another size.
pub(super) fn read_target(
    path: &Path,
    [width, height]: [usize; 2],
    samples: &[Option<SurfaceSample>],
    coat: f64,
) -> Result<Vec<f64>, HandheldError> {
    let picture = open_upright(path).map_err(|e| HandheldError::unreadable(path, &e))?.to_luma_alpha8();
    let (found_w, found_h) = (picture.width() as usize, picture.height() as usize);
    if (found_w, found_h) != (width, height) {
        return Err(HandheldError::TargetSize {
            path: path.into(),
            found_w,
            found_h,
            wanted_w: width,
            wanted_h: height,
        });
    }
    let thickness = |pixel: &image::LumaA<u8>, sample: &Option<SurfaceSample>| {
        let [grey, alpha] = pixel.0.map(f64::from);
        if sample.is_some() { coat * (1.0 - grey / 255.0) * alpha / 255.0 } else { 0.0 }
    };
    Ok(picture.pixels().zip(samples).map(|(pixel, sample)| thickness(pixel, sample)).collect())
}
