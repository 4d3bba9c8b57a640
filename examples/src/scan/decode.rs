//! The pixels of a frame.

use std::path::Path;

use image::{DynamicImage, ImageReader};
use tsdf_hash::{ColourView, DepthData, DepthView, Intrinsics};

use super::{FrameFiles, SequenceError};

/// The images of a frame in memory.
pub struct Images {
    width: usize,
    height: usize,
    depth: Vec<u16>,
    /// The colour image, if there is one.
    pub colour: Option<Colour>,
}

/// A colour image.
pub struct Colour {
    width: usize,
    height: usize,
    /// R, G, B, row by row.
    pub rgb8: Vec<u8>,
}

impl Images {
    /// Reads and decodes a frame.
    ///
    /// # Errors
    /// [`SequenceError::Unreadable`] for a file that is missing, damaged, or no 16-bit grey image where depth is expected.
    pub fn read(frame: &FrameFiles) -> Result<Self, SequenceError> {
        let DynamicImage::ImageLuma16(depth) = decode(&frame.depth)? else {
            return Err(SequenceError::unreadable(&frame.depth, &"depth must be a 16-bit grey PNG"));
        };
        let colour = match &frame.colour {
            Some(path) => {
                let rgb = decode(path)?.into_rgb8();
                let (width, height) = (rgb.width() as usize, rgb.height() as usize);
                Some(Colour { width, height, rgb8: rgb.into_raw() })
            }
            None => None,
        };
        Ok(Self { width: depth.width() as usize, height: depth.height() as usize, depth: depth.into_raw(), colour })
    }

    /// The depth image with its camera.
    pub fn depth(&self, intrinsics: Intrinsics, scale: f64) -> DepthView<'_> {
        let data = DepthData::U16 { data: &self.depth, scale };
        DepthView { width: self.width, height: self.height, data, intrinsics }
    }

    /// The colour image, seen through the depth camera: scaled to its own size where that differs.
    pub fn colour(&self, depth_intrinsics: Intrinsics) -> Option<ColourView<'_>> {
        let colour = self.colour.as_ref()?;
        let [x, y] = [colour.width as f64 / self.width as f64, colour.height as f64 / self.height as f64];
        let k = depth_intrinsics;
        // Pixel centres are at integers, so the image begins half a pixel before 0.
        let intrinsics =
            Intrinsics { fx: k.fx * x, fy: k.fy * y, cx: (k.cx + 0.5) * x - 0.5, cy: (k.cy + 0.5) * y - 0.5 };
        Some(ColourView { width: colour.width, height: colour.height, rgb8: &colour.rgb8, intrinsics })
    }
}

fn decode(path: &Path) -> Result<DynamicImage, SequenceError> {
    let reader = ImageReader::open(path).map_err(|e| SequenceError::unreadable(path, &e))?;
    reader.decode().map_err(|e| SequenceError::unreadable(path, &e))
}
