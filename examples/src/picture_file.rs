//! Pictures as a viewer shows them.

use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

use image::{DynamicImage, ImageDecoder as _, ImageError, ImageReader, Rgba32FImage};
use moxcms::{CmsError, ColorProfile, DataColorSpace, Layout, TransformOptions};

#[cfg(feature = "svg")]
use crate::vector_drawing::{DrawingError, draw_svg};

/// Why a picture cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PictureFileError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] std::io::Error),
    /// It is no PNG or JPEG.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Its colours are those of another device.
    #[error("its colour profile cannot be converted ({0}): save it as sRGB")]
    Profile(CmsError),
    /// It is made for a printer, or its profile is not for red, green and blue.
    #[error("it is not in red, green and blue: save it as sRGB")]
    NotRgb,
    /// It is called `.svg` and cannot be drawn.
    #[cfg(feature = "svg")]
    #[error(transparent)]
    Drawing(#[from] DrawingError),
    /// It is called `.svg`, and this program cannot draw.
    #[cfg(not(feature = "svg"))]
    #[error("built without the feature `svg`: build with `--features svg`, or turn the drawing into a PNG")]
    WithoutDrawings,
}

/// Reads a PNG or JPEG, whatever its file is called, and turns it as its EXIF orientation says: cameras and telephones store what
/// their sensor saw and only note how they were held. An SVG, told by its name, is drawn.
pub fn open_upright(path: &Path) -> Result<DynamicImage, PictureFileError> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg")) {
        #[cfg(feature = "svg")]
        return Ok(draw_svg(&std::fs::read_to_string(path)?)?);
        #[cfg(not(feature = "svg"))]
        return Err(PictureFileError::WithoutDrawings);
    }
    upright(ImageReader::open(path)?)
}

/// The same from the bytes of a PNG or JPEG.
pub fn read_upright(bytes: &[u8]) -> Result<DynamicImage, PictureFileError> {
    upright(ImageReader::new(Cursor::new(bytes)))
}

/// As [`open_upright`], with colours in sRGB: those of a picture with a colour profile (ICC) are converted. Whether they were.
///
/// # Errors
/// Besides, profiles and pictures of other than red, green and blue.
pub fn open_in_srgb(path: &Path) -> Result<(DynamicImage, bool), PictureFileError> {
    if is_for_print(&std::fs::read(path)?) {
        return Err(PictureFileError::NotRgb);
    }
    let picture = open_upright(path)?;
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg")) {
        return Ok((picture, false));
    }
    let mut decoder = ImageReader::open(path)?.with_guessed_format()?.into_decoder()?;
    let Some(icc) = decoder.icc_profile()? else { return Ok((picture, false)) };
    let profile = ColorProfile::new_from_slice(&icc).map_err(PictureFileError::Profile)?;
    let layout = Layout::Rgba;
    match profile.color_space {
        DataColorSpace::Rgb => {}
        // A grey picture is grey with any curve that a viewer would notice.
        DataColorSpace::Gray => return Ok((picture, false)),
        _ => return Err(PictureFileError::NotRgb),
    }
    let transform = profile
        .create_transform_f32(layout, &ColorProfile::new_srgb(), layout, TransformOptions::default())
        .map_err(PictureFileError::Profile)?;
    let from = picture.to_rgba32f();
    let mut into = vec![0.0_f32; from.as_raw().len()];
    transform.transform(from.as_raw(), &mut into).map_err(PictureFileError::Profile)?;
    let size = (from.width(), from.height());
    let converted = into.into_iter().map(|v| v.clamp(0.0, 1.0)).collect();
    let converted = Rgba32FImage::from_raw(size.0, size.1, converted);
    Ok(converted.map_or((picture, false), |converted| (converted.into(), true)))
}

/// Whether these are the bytes of a JPEG of four components: cyan, magenta, yellow and black, which mean nothing without the printer.
fn is_for_print(bytes: &[u8]) -> bool {
    let mut rest = bytes.strip_prefix(&[0xff, 0xd8]).unwrap_or_default();
    // Segments: a marker, then a length that counts itself. A frame header has precision, height, width, and the number of components.
    while let [0xff, marker, high, low, body @ ..] = rest {
        let length = usize::from(u16::from_be_bytes([*high, *low])).max(2) - 2;
        if (0xc0..=0xcf).contains(marker) && ![0xc4, 0xc8, 0xcc].contains(marker) {
            return body.get(5) == Some(&4);
        }
        rest = body.get(length..).unwrap_or_default();
    }
    false
}

fn upright(reader: ImageReader<impl BufRead + Seek>) -> Result<DynamicImage, PictureFileError> {
    let mut decoder = reader.with_guessed_format()?.into_decoder()?;
    // A picture whose EXIF block is broken is a picture still.
    let orientation = decoder.orientation().ok();
    let mut picture = DynamicImage::from_decoder(decoder)?;
    if let Some(orientation) = orientation {
        picture.apply_orientation(orientation);
    }
    Ok(picture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ImageEncoder as _;
    use image::codecs::png::PngEncoder;

    /// Display P3 against the matrix that Apple and the W3C print: rows for linear red, green and blue.
    #[test]
    fn a_wide_gamut_becomes_srgb() {
        use paint_sim::colour::{decode_srgb8, encode_srgb};
        let stored = [180_u8, 110, 90];
        let mut bytes = Vec::new();
        let mut encoder = PngEncoder::new(&mut bytes);
        encoder.set_icc_profile(ColorProfile::new_display_p3().encode().unwrap()).unwrap();
        encoder.write_image(&stored.repeat(4), 2, 2, image::ExtendedColorType::Rgb8).unwrap();
        let path = std::env::temp_dir().join(format!("paintcopter-p3-{}.png", std::process::id()));
        std::fs::write(&path, &bytes).unwrap();
        let opened = open_in_srgb(&path);
        std::fs::remove_file(&path).unwrap();
        let (picture, converted) = opened.unwrap();
        assert!(converted);
        let found = picture.to_rgb32f().get_pixel(0, 0).0;
        let linear = stored.map(decode_srgb8);
        let rows = [[1.224_94, -0.224_94, 0.0], [-0.042_06, 1.042_06, 0.0], [-0.019_64, -0.078_64, 1.098_27]];
        for (row, found) in rows.iter().zip(found) {
            let expected = encode_srgb(row.iter().zip(linear).map(|(r, l)| r * l).sum());
            assert!((f64::from(found) - expected).abs() < 3e-3, "{found} {expected}");
        }
    }

    /// The first segments of a JPEG as ITU T.81 has them: a comment, then the header of a frame.
    #[test]
    fn a_jpeg_for_a_printer_is_told_by_its_frame() {
        let of = |components: u8| {
            let frame = [0xff, 0xc2, 0, 20, 8, 0, 2, 0, 3, components];
            [b"\xff\xd8\xff\xfe\0\x04hi".as_slice(), &frame, &[0; 12]].concat()
        };
        assert_eq!([1, 3, 4].map(|components| is_for_print(&of(components))), [false, false, true]);
        assert!(!is_for_print(&of(4)[..9]) && !is_for_print(b"") && !is_for_print(b"\x89PNG\r\n"));
    }

    #[test]
    fn a_picture_taken_on_its_side_stands() {
        // As stored: 3 x 2, the top row dark. Held so that the sensor's left was up (EXIF 6), the dark row is the right column.
        let stored = [0, 0, 0, 255, 255, 255_u8];
        let exif = [b"II*\0\x08\0\0\0\x01\0".as_slice(), b"\x12\x01\x03\0\x01\0\0\0\x06\0\0\0", &[0; 4]].concat();
        let mut bytes = Vec::new();
        let mut encoder = PngEncoder::new(&mut bytes);
        encoder.set_exif_metadata(exif).unwrap();
        encoder.write_image(&stored, 3, 2, image::ExtendedColorType::L8).unwrap();
        let path = std::env::temp_dir().join(format!("paintcopter-upright-{}.jpg", std::process::id()));
        std::fs::write(&path, &bytes).unwrap();
        let upright = open_upright(&path);
        std::fs::remove_file(&path).unwrap();
        let upright = upright.unwrap().to_luma8();
        assert_eq!(upright.dimensions(), (2, 3));
        assert_eq!(upright.into_raw(), [255, 0, 255, 0, 255, 0]);
    }
}
