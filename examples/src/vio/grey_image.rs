//! Grey images from files and messages.

use std::path::Path;

use image::{DynamicImage, ImageReader};
use vio_ekf::ImageView;

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
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let in_file = |why: &dyn std::fmt::Display| format!("{}: cannot be read ({why})", path.display());
        let reader = ImageReader::open(path).map_err(|error| in_file(&error))?;
        reader.decode().map(Self::from_image).map_err(|error| in_file(&error))
    }

    /// Decodes PNG or JPEG bytes.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, String> {
        image::load_from_memory(bytes).map(Self::from_image).map_err(|error| format!("no PNG or JPEG image ({error})"))
    }

    fn from_image(image: DynamicImage) -> Self {
        let grey = image.into_luma8();
        Self { width: grey.width() as usize, height: grey.height() as usize, data: grey.into_raw() }
    }

    /// The image, borrowed.
    pub fn view(&self) -> ImageView<'_> {
        ImageView { width: self.width, height: self.height, data: &self.data }
    }
}
