//! The pictures of a run: textures, the error map with its colour bar, curves over time, the scene with the flown path, sheets
//! of pictures side by side.

mod chart;
mod contact_sheet;
mod curves;
mod density;
mod error_map;
mod paths;
mod scene;

use std::path::Path;
use std::sync::Once;

use plotters::style::{FontStyle, register_font};

use crate::whole_file::WholeFile;

pub use contact_sheet::{TILE_SIDE, Tile, save_contact_sheet};
pub use curves::{Panel, save_curves};
pub use density::{DensityPicture, save_density};
pub use error_map::{COLOUR_DIFFERENCE, ErrorScale, save_error_map};
pub use paths::{PathPanel, save_paths};
pub use scene::{Polyline, Projection, Scene, save_scene};

/// What is wrong with drawing or saving a picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file could not be written.
    #[error("{path}: cannot be written ({why}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        why: String,
    },
    /// The drawing backend refused.
    #[error("a chart could not be drawn: {0}")]
    Drawing(String),
}

/// An sRGB picture, row 0 at the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Rgb {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Three bytes per pixel.
    pub data: Vec<u8>,
}

impl Rgb {
    /// From one colour per pixel, row by row.
    pub fn from_pixels(width: usize, height: usize, pixels: impl IntoIterator<Item = [u8; 3]>) -> Self {
        Self { width: width as u32, height: height as u32, data: pixels.into_iter().flatten().collect() }
    }

    /// A page of a surface's texels as it is looked at: white where there is no surface, enlarged where it is small.
    pub fn of_page(width: usize, height: usize, texels: impl IntoIterator<Item = Option<[u8; 3]>>) -> Self {
        let pixels = texels.into_iter().map(|texel| texel.unwrap_or([255; 3]));
        Self::from_pixels(width, height, pixels).enlarged((1400 / width as u32).clamp(1, 8))
    }

    /// The same picture with every pixel as a block of `factor` by `factor`.
    #[must_use]
    pub fn enlarged(&self, factor: u32) -> Self {
        let (width, height) = (self.width * factor, self.height * factor);
        let mut data = Vec::with_capacity((width * height * 3) as usize);
        for y in 0..height {
            for x in 0..width {
                let at = 3 * ((y / factor) * self.width + x / factor) as usize;
                data.extend_from_slice(&self.data[at..at + 3]);
            }
        }
        Self { width, height, data }
    }

    /// Writes a PNG.
    pub fn save(&self, path: &Path) -> Result<(), PictureError> {
        write_png(path, &self.data, [self.width, self.height])
            .map_err(|e| PictureError::Unwritable { path: path.display().to_string(), why: e.to_string() })
    }
}

/// Writes three bytes per pixel as a PNG.
pub(crate) fn write_png(path: &Path, data: &[u8], [width, height]: [u32; 2]) -> image::ImageResult<()> {
    let mut file = WholeFile::create(path)?;
    image::write_buffer_with_format(
        &mut file,
        data,
        width,
        height,
        image::ExtendedColorType::Rgb8,
        image::ImageFormat::Png,
    )?;
    Ok(file.commit()?)
}

/// The charts' font comes with the program, so that no system font is needed.
fn with_font() {
    static REGISTER: Once = Once::new();
    REGISTER.call_once(|| {
        // Only a malformed font is refused, and this one is a constant.
        let _ = register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
    });
}

/// Runs a drawing on a white canvas and returns it.
fn draw<F>(width: u32, height: u32, drawing: F) -> Result<Rgb, PictureError>
where
    F: FnOnce(&Canvas) -> Result<(), Box<dyn std::error::Error>>,
{
    use plotters::prelude::IntoDrawingArea;
    with_font();
    let mut data = vec![255; (width * height * 3) as usize];
    {
        let area = plotters::prelude::BitMapBackend::with_buffer(&mut data, (width, height)).into_drawing_area();
        drawing(&area).map_err(|e| PictureError::Drawing(e.to_string()))?;
        area.present().map_err(|e| PictureError::Drawing(e.to_string()))?;
    }
    Ok(Rgb { width, height, data })
}

type Canvas<'a> = plotters::drawing::DrawingArea<plotters::prelude::BitMapBackend<'a>, plotters::coord::Shift>;
