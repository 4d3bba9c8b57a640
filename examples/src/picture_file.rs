//! Pictures as a viewer shows them.

use std::io::{BufRead, Cursor, Seek};
use std::path::Path;

use image::{DynamicImage, ImageDecoder as _, ImageError, ImageReader};

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
