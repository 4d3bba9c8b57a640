//! Grey images from files and messages.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageError, ImageReader, Limits};
use vio_ekf::ImageView;
use vio_ekf::run::Picture;

/// Deflate makes no more than so many bytes of one; pictures of one colour come near it.
const MOST_BYTES_OF_A_BYTE: u64 = 1032;
/// What a decoder may claim besides.
const DECODER_BYTES: u64 = 1 << 20;

/// A grey image with 8 bits per pixel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Grey values, row by row from the top.
    pub data: Vec<u8>,
}

impl GreyImage {
    /// Reads a PNG or JPEG file; colours become grey, 16 bits become 8.
    ///
    /// # Errors
    /// The file and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self, String> {
        let in_file = |why: &dyn std::fmt::Display| format!("{}: cannot be read ({why})", path.display());
        let bytes = std::fs::read(path).map_err(|error| in_file(&error))?;
        Self::decoded(&bytes).map_err(|error| in_file(&error))
    }

    /// Decodes PNG or JPEG bytes.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, String> {
        Self::decoded(bytes).map_err(|error| format!("no PNG or JPEG image ({error})"))
    }

    fn decoded(bytes: &[u8]) -> Result<Self, String> {
        if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
            return Err("WebP is not read: convert the images to PNG or JPEG, `mogrify -format png *.webp`".into());
        }
        Self::decoded_by_format(bytes).map_err(|error| error.to_string())
    }

    fn decoded_by_format(bytes: &[u8]) -> Result<Self, ImageError> {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        // A file that claims more pixels than its bytes can hold asks for no memory.
        let mut limits = Limits::default();
        limits.max_alloc = Some(MOST_BYTES_OF_A_BYTE * bytes.len() as u64 + DECODER_BYTES);
        reader.limits(limits);
        reader.decode().map(Self::from_image)
    }

    fn from_image(image: DynamicImage) -> Self {
        let grey = image.into_luma8();
        Self { width: grey.width() as usize, height: grey.height() as usize, data: grey.into_raw() }
    }
}

impl Picture for GreyImage {
    fn view(&self) -> ImageView<'_> {
        ImageView { width: self.width, height: self.height, data: &self.data }
    }
}
