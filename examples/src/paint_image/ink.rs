//! Pictures as ink: reading, comparing and showing them.

use std::path::Path;

use paint_net::{Error, Image, metrics};

use super::error::PaintImageError;
use crate::picture_file::open_upright;
use crate::pictures::Rgb;

/// Reads a picture of any size and depth as ink: dark is paint, transparency shows the white wall.
pub fn read_ink(path: &Path) -> Result<Image, PaintImageError> {
    read_small_ink(path, u32::MAX)
}

/// The same of a picture whose shorter side is shrunk to `shortest` pixels if it has more.
pub(super) fn read_small_ink(path: &Path, shortest: u32) -> Result<Image, PaintImageError> {
    let unreadable = |why: String| PaintImageError::Unreadable { path: path.display().to_string(), why };
    let picture = open_upright(path).map_err(|e| unreadable(format!("cannot be read as a picture ({e})")))?;
    let [width, height] = [picture.width(), picture.height()];
    let picture = if width.min(height) > shortest {
        let share = f64::from(shortest) / f64::from(width.min(height));
        let [width, height] = [width, height].map(|side| (f64::from(side) * share).round() as u32);
        picture.thumbnail_exact(width, height)
    } else {
        picture
    };
    let rgba = picture.to_rgba32f();
    let ink = rgba.pixels().map(|p| {
        let [r, g, b, a] = p.0.map(f64::from);
        a.clamp(0.0, 1.0) * ink_of([r, g, b])
    });
    Image::new(rgba.width() as usize, rgba.height() as usize, ink.collect()).map_err(|e| unreadable(e.to_string()))
}

/// The ink that looks as dark as a colour: 1 less its luma, the weights of BT.709 on values as stored.
pub(super) fn ink_of([r, g, b]: [f64; 3]) -> f64 {
    // 0.2126 + 0.7152 + 0.0722 is 1 only up to rounding.
    (1.0 - (0.2126 * r + 0.7152 * g + 0.0722 * b)).clamp(0.0, 1.0)
}

/// Structural similarity; 0 for pictures smaller than its window, which have none.
pub(super) fn ssim(ink: &Image, wanted: &Image) -> Result<f64, Error> {
    if wanted.width().min(wanted.height()) < 7 { Ok(0.0) } else { metrics::ssim(ink, wanted, None) }
}

/// Mean CIEDE2000 between two pictures of ink, shown as the greys of sRGB.
pub(super) fn colour_difference(ink: &Image, wanted: &Image) -> f64 {
    // The lightness of every grey level once; differences below a level do not show.
    let lightness: Vec<f64> = (0..=u8::MAX)
        .map(|level| {
            let y = paint_sim::colour::decode_srgb8(level);
            if y > 216.0 / 24389.0 { 116.0 * y.cbrt() - 16.0 } else { y * 24389.0 / 27.0 }
        })
        .collect();
    let lab = |ink: f64| [lightness[usize::from(level(ink))], 0.0, 0.0];
    let pairs = ink.data().iter().zip(wanted.data());
    pairs.map(|(&a, &b)| paint_sim::colour::ciede2000(lab(a), lab(b))).sum::<f64>() / ink.data().len() as f64
}

pub(super) fn level(ink: f64) -> u8 {
    (255.0 * (1.0 - ink.clamp(0.0, 1.0))).round() as u8
}

pub(super) fn grey(ink: &Image) -> Rgb {
    Rgb::from_pixels(ink.width(), ink.height(), ink.data().iter().map(|&a| [level(a); 3]))
}

/// White where right, red where too light, blue where too dark; full colour at an error of a quarter.
pub(super) fn error_map(ink: &Image, wanted: &Image) -> Rgb {
    let colour = |(a, y): (&f64, &f64)| {
        let error = ((a - y) / 0.25).clamp(-1.0, 1.0);
        let fade = (255.0 * (1.0 - error.abs())).round() as u8;
        if error < 0.0 { [255, fade, fade] } else { [fade, fade, 255] }
    };
    Rgb::from_pixels(ink.width(), ink.height(), ink.data().iter().zip(wanted.data()).map(colour))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A portrait of 40 x 80 pixels, its upper half black: smaller in proportion, as it is where it is small enough.
    #[test]
    fn large_pictures_are_shrunk_to_their_shorter_side() {
        let path = std::env::temp_dir().join(format!("paintcopter-small-ink-{}.png", std::process::id()));
        let half = |_, y: u32| image::Luma([if y < 40 { 0 } else { 255 }]);
        image::GrayImage::from_fn(40, 80, half).save(&path).unwrap();
        let [whole, small] = [40, 10].map(|shortest| read_small_ink(&path, shortest).unwrap());
        std::fs::remove_file(&path).unwrap();
        let size = |image: &Image| (image.width(), image.height());
        assert_eq!((size(&whole), size(&small)), ((40, 80), (10, 20)));
        assert_eq!((small.at(9, 9), small.at(0, 10)), (1.0, 0.0));
    }
}
