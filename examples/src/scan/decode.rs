//! The pixels of a frame.

use std::path::Path;

use image::{DynamicImage, ImageReader};
use nalgebra::Point3;
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};

use super::error::SequenceError;
use super::sequence::{ColourCamera, FrameFiles};
use crate::pictures::Rgb;

/// The images of a frame in memory.
pub struct Images {
    width: usize,
    height: usize,
    depth: Vec<u16>,
    /// The colour image, if there is one.
    pub colour: Option<Colour>,
    /// Why a colour image that is listed could not be read; the depth is as good without it.
    pub colour_fault: Option<SequenceError>,
}

/// A colour image.
pub struct Colour {
    width: usize,
    height: usize,
    /// R, G, B, row by row.
    pub rgb8: Vec<u8>,
}

impl Images {
    /// Reads and decodes a frame. A colour image that cannot be read costs the colour only.
    ///
    /// # Errors
    /// [`SequenceError::Unreadable`] for a depth image that is missing, damaged, or no 16-bit grey image.
    pub fn read(frame: &FrameFiles) -> Result<Self, SequenceError> {
        let DynamicImage::ImageLuma16(depth) = decode(&frame.depth)? else {
            return Err(SequenceError::unreadable(&frame.depth, &"depth must be a 16-bit grey PNG"));
        };
        let (colour, colour_fault) = match frame.colour.as_deref().map(decode) {
            Some(Ok(image)) => {
                let rgb = image.into_rgb8();
                let (width, height) = (rgb.width() as usize, rgb.height() as usize);
                (Some(Colour { width, height, rgb8: rgb.into_raw() }), None)
            }
            Some(Err(why)) => (None, Some(why)),
            None => (None, None),
        };
        let (width, height) = (depth.width() as usize, depth.height() as usize);
        Ok(Self { width, height, depth: depth.into_raw(), colour, colour_fault })
    }

    /// Moves the colours of a camera beside the depth camera to the pixels of the depth image; black where the depth is unknown.
    pub fn register_colour(&mut self, camera: &ColourCamera, depth: Intrinsics, scale: f64) {
        let Some(colour) = self.colour.take() else { return };
        let own = camera.intrinsics.unwrap_or_else(|| scaled(depth, self.width, self.height, &colour));
        let colour_from_depth = camera.depth_from_colour.inverse();
        let mut rgb8 = vec![0; 3 * self.width * self.height];
        for (at, z) in self.metres(scale).enumerate().filter(|(_, z)| *z > 0.0).collect::<Vec<_>>() {
            let (u, v) = ((at % self.width) as f64, (at / self.width) as f64);
            let p = colour_from_depth * Point3::new((u - depth.cx) / depth.fx * z, (v - depth.cy) / depth.fy * z, z);
            let (x, y) = ((own.fx * p.x / p.z + own.cx).round(), (own.fy * p.y / p.z + own.cy).round());
            if p.z > 0.0 && x >= 0.0 && y >= 0.0 && x < colour.width as f64 && y < colour.height as f64 {
                let from = 3 * (y as usize * colour.width + x as usize);
                rgb8[3 * at..3 * at + 3].copy_from_slice(&colour.rgb8[from..from + 3]);
            }
        }
        self.colour = Some(Colour { width: self.width, height: self.height, rgb8 });
    }

    /// Pixels per row of the depth image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of the depth image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The measured depths, metres; 0 where there is none.
    pub fn metres(&self, scale: f64) -> impl Iterator<Item = f64> {
        self.depth.iter().map(move |&d| if d == u16::MAX { 0.0 } else { f64::from(d) / scale })
    }

    /// The colour image at the size of the depth image; where there is none, the depth in grey, near bright.
    pub fn picture(&self) -> Rgb {
        let pixels = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let nearest = self.depth.iter().filter(|d| **d > 0).min().map_or(1.0, |d| f64::from(*d));
        Rgb::from_pixels(
            self.width,
            self.height,
            pixels.map(|(x, y)| match &self.colour {
                Some(c) => {
                    let at = 3 * ((y * c.height / self.height) * c.width + x * c.width / self.width);
                    [c.rgb8[at], c.rgb8[at + 1], c.rgb8[at + 2]]
                }
                None => match self.depth[y * self.width + x] {
                    0 | u16::MAX => [0; 3],
                    d => [(255.0 * nearest / f64::from(d)) as u8; 3],
                },
            }),
        )
    }

    /// The depth image with its camera.
    pub fn depth(&self, intrinsics: Intrinsics, scale: f64) -> DepthView<'_> {
        let data = DepthData::U16 { data: &self.depth, scale };
        DepthView { width: self.width, height: self.height, data, intrinsics }
    }

    /// The colour image, seen through the depth camera: scaled to its own size where that differs.
    pub fn colour(&self, depth_intrinsics: Intrinsics) -> Option<ColourView<'_>> {
        let colour = self.colour.as_ref()?;
        let intrinsics = scaled(depth_intrinsics, self.width, self.height, colour);
        Some(ColourView {
            width: colour.width,
            height: colour.height,
            data: ColourData::Rgb8(&colour.rgb8),
            intrinsics,
        })
    }
}

/// The depth camera with the resolution of a colour image.
fn scaled(k: Intrinsics, width: usize, height: usize, colour: &Colour) -> Intrinsics {
    let [x, y] = [colour.width as f64 / width as f64, colour.height as f64 / height as f64];
    // Pixel centres are at integers, so the image begins half a pixel before 0.
    Intrinsics { fx: k.fx * x, fy: k.fy * y, cx: (k.cx + 0.5) * x - 0.5, cy: (k.cy + 0.5) * y - 0.5 }
}

fn decode(path: &Path) -> Result<DynamicImage, SequenceError> {
    let reader = ImageReader::open(path).map_err(|e| SequenceError::unreadable(path, &e))?;
    reader.decode().map_err(|e| SequenceError::unreadable(path, &e))
}
