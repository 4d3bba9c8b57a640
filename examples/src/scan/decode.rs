//! The pixels of a frame.

use image::{DynamicImage, ImageReader};
use nalgebra::Point3;
use tsdf_hash::slam::{ColourImage, ColourPixels, DepthPixels, FrameImages};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};

use super::error::SequenceError;
use super::image_source::ImageSource;
use super::sequence::{ColourCamera, FrameFiles, Sequence};
use crate::mcap_messages::images::{ImageData, RawPixels};
use crate::pictures::Rgb;

/// The images of a frame in memory.
pub struct Images {
    width: usize,
    height: usize,
    depth: Depths,
    /// The colour image, if there is one.
    pub colour: Option<Colour>,
    /// Why a colour image that is listed could not be read; the depth is as good without it.
    pub colour_fault: Option<SequenceError>,
}

/// Measured depths.
enum Depths {
    Units(Vec<u16>),
    Metres(Vec<f32>),
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
        let unreadable = |why: String| SequenceError::unreadable_image(&frame.depth, &why);
        let (width, height, depth) = read_depth(&frame.depth).map_err(unreadable)?;
        let (colour, colour_fault) = match frame.colour.as_ref().map(|source| (source, read_colour(source))) {
            Some((_, Ok(colour))) => (Some(colour), None),
            Some((source, Err(why))) => (None, Some(SequenceError::unreadable_image(source, &why))),
            None => (None, None),
        };
        Ok(Self { width, height, depth, colour, colour_fault })
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
        (0..self.width * self.height).map(move |at| match &self.depth {
            Depths::Units(units) if units[at] == u16::MAX => 0.0,
            Depths::Units(units) => f64::from(units[at]) / scale,
            Depths::Metres(metres) => Some(f64::from(metres[at])).filter(|z| z.is_finite()).unwrap_or(0.0),
        })
    }

    /// The colour image at the size of the depth image; where there is none, the depth in grey, near bright.
    pub fn picture(&self) -> Rgb {
        let pixels = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let depths: Vec<f64> = self.metres(1.0).collect();
        let nearest = depths.iter().filter(|z| **z > 0.0).fold(f64::INFINITY, |a, b| a.min(*b));
        Rgb::from_pixels(
            self.width,
            self.height,
            pixels.map(|(x, y)| match &self.colour {
                Some(c) => {
                    let at = 3 * ((y * c.height / self.height) * c.width + x * c.width / self.width);
                    [c.rgb8[at], c.rgb8[at + 1], c.rgb8[at + 2]]
                }
                None => match depths[y * self.width + x] {
                    0.0 => [0; 3],
                    z => [(255.0 * nearest / z) as u8; 3],
                },
            }),
        )
    }

    /// The depth image with its camera.
    pub fn depth(&self, intrinsics: Intrinsics, scale: f64) -> DepthView<'_> {
        let data = match &self.depth {
            Depths::Units(data) => DepthData::U16 { data, scale },
            Depths::Metres(data) => DepthData::F32 { data },
        };
        DepthView { width: self.width, height: self.height, data, intrinsics }
    }

    /// Both, owned.
    pub fn into_frame(self, intrinsics: Intrinsics, scale: f64) -> FrameImages {
        let Self { width, height, depth, colour, .. } = self;
        let colour = colour.map(|colour| ColourImage {
            intrinsics: scaled(intrinsics, width, height, &colour),
            width: colour.width,
            height: colour.height,
            pixels: ColourPixels::Rgb8(colour.rgb8),
        });
        let depth = match depth {
            Depths::Units(data) => DepthPixels::U16 { data, scale },
            Depths::Metres(data) => DepthPixels::F32(data),
        };
        FrameImages { width, height, depth, intrinsics, colour }
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

impl Sequence {
    /// Reads a frame, with its colours where the depth camera sees them.
    ///
    /// # Errors
    /// As [`Images::read`].
    pub fn images(&self, index: usize) -> Result<Images, SequenceError> {
        let mut images = Images::read(&self.frames[index])?;
        if let Some(camera) = &self.colour_camera {
            images.register_colour(camera, self.intrinsics, self.depth_scale);
        }
        Ok(images)
    }
}

/// The depth camera with the resolution of a colour image.
fn scaled(k: Intrinsics, width: usize, height: usize, colour: &Colour) -> Intrinsics {
    let [x, y] = [colour.width as f64 / width as f64, colour.height as f64 / height as f64];
    // Pixel centres are at integers, so the image begins half a pixel before 0.
    Intrinsics { fx: k.fx * x, fy: k.fy * y, cx: (k.cx + 0.5) * x - 0.5, cy: (k.cy + 0.5) * y - 0.5 }
}

fn read_depth(source: &ImageSource) -> Result<(usize, usize, Depths), String> {
    match source {
        ImageSource::File(path) => depth_of(ImageReader::open(path).map_err(|e| e.to_string())?.decode()),
        ImageSource::Message { topic, index } => match topic.read(*index)? {
            ImageData::Raw(pixels) => raw_depth(&pixels),
            ImageData::Compressed { format, bytes } => match compressed_depth(&format, &bytes)? {
                (png, None) => depth_of(image::load_from_memory(png)),
                (png, Some([a, b])) => {
                    // Inverse depths in steps (`image_transport`'s compressed depth): 0 stays "none".
                    let (width, height, depth) = depth_of(image::load_from_memory(png))?;
                    let Depths::Units(units) = depth else { return Err("its PNG has not 16 bits".into()) };
                    let metres = |d: u16| if d == 0 { 0.0 } else { a / (f32::from(d) - b) };
                    Ok((width, height, Depths::Metres(units.into_iter().map(metres).collect())))
                }
            },
        },
    }
}

fn depth_of(decoded: image::ImageResult<DynamicImage>) -> Result<(usize, usize, Depths), String> {
    let DynamicImage::ImageLuma16(depth) = decoded.map_err(|e| e.to_string())? else {
        return Err("depth must be a 16-bit grey PNG".into());
    };
    Ok((depth.width() as usize, depth.height() as usize, Depths::Units(depth.into_raw())))
}

fn raw_depth(pixels: &RawPixels) -> Result<(usize, usize, Depths), String> {
    let depth = match pixels.encoding.as_str() {
        "16UC1" | "mono16" => {
            let unit = |b: &[u8]| if pixels.big_endian { [b[1], b[0]] } else { [b[0], b[1]] };
            Depths::Units(
                pixels.rows(2)?.flat_map(|row| row.chunks_exact(2)).map(|b| u16::from_le_bytes(unit(b))).collect(),
            )
        }
        "32FC1" => {
            let number = |b: &[u8]| {
                let [a, b, c, d] = [b[0], b[1], b[2], b[3]];
                if pixels.big_endian { [d, c, b, a] } else { [a, b, c, d] }
            };
            Depths::Metres(
                pixels.rows(4)?.flat_map(|row| row.chunks_exact(4)).map(|b| f32::from_le_bytes(number(b))).collect(),
            )
        }
        other => return Err(format!("depth encoded as `{other}` is not read: record 16UC1, mono16 or 32FC1")),
    };
    Ok((pixels.width, pixels.height, depth))
}

/// Bytes before the PNG of `image_transport`'s compressed depth: a format and two numbers.
const COMPRESSED_DEPTH_HEADER: usize = 12;

/// The PNG, and the numbers of the quantisation where the depth was floating point.
fn compressed_depth<'a>(format: &str, bytes: &'a [u8]) -> Result<(&'a [u8], Option<[f32; 2]>), String> {
    if !format.contains("compressedDepth") {
        return Ok((bytes, None));
    }
    let (head, png) = bytes.split_at_checked(COMPRESSED_DEPTH_HEADER).ok_or("too short for compressed depth")?;
    let number = |at: usize| f32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    Ok((png, format.trim_start().starts_with("32FC1").then(|| [number(4), number(8)])))
}

/// Whether an image of a recording holds depth.
pub(super) fn is_depth(data: &ImageData) -> bool {
    match data {
        ImageData::Raw(pixels) => matches!(pixels.encoding.as_str(), "16UC1" | "mono16" | "32FC1"),
        ImageData::Compressed { format, bytes } => {
            // Bit depth and colour type of a PNG.
            format.contains("compressedDepth") || (bytes.starts_with(b"\x89PNG") && bytes.get(24..26) == Some(&[16, 0]))
        }
    }
}

fn read_colour(source: &ImageSource) -> Result<Colour, String> {
    let decoded = match source {
        ImageSource::File(path) => ImageReader::open(path).map_err(|e| e.to_string())?.decode(),
        ImageSource::Message { topic, index } => match topic.read(*index)? {
            ImageData::Raw(pixels) => return raw_colour(&pixels),
            ImageData::Compressed { bytes, .. } => image::load_from_memory(&bytes),
        },
    };
    let rgb = decoded.map_err(|e| e.to_string())?.into_rgb8();
    Ok(Colour { width: rgb.width() as usize, height: rgb.height() as usize, rgb8: rgb.into_raw() })
}

fn raw_colour(pixels: &RawPixels) -> Result<Colour, String> {
    // Channels, and which of them are red, green and blue.
    let (channels, order) = match pixels.encoding.as_str() {
        "mono8" | "8UC1" => (1, [0; 3]),
        "rgb8" => (3, [0, 1, 2]),
        "bgr8" | "8UC3" => (3, [2, 1, 0]),
        "rgba8" => (4, [0, 1, 2]),
        "bgra8" => (4, [2, 1, 0]),
        bayer if bayer.starts_with("bayer_") && bayer.ends_with('8') => return bayer_colour(pixels),
        other => {
            return Err(format!(
                "colours encoded as `{other}` are not read: record rgb8, bgr8, rgba8, bgra8, mono8, bayer (8 bits), PNG or JPEG"
            ));
        }
    };
    let rgb8 = pixels.rows(channels)?.flat_map(|row| row.chunks_exact(channels)).flat_map(|p| order.map(|k| p[k]));
    Ok(Colour { rgb8: rgb8.collect(), width: pixels.width, height: pixels.height })
}

/// Each pixel takes the mean of every colour over the 3 x 3 pixels around it: bilinear interpolation, and its own colour a little smoothed.
fn bayer_colour(pixels: &RawPixels) -> Result<Colour, String> {
    let square = match pixels.encoding.as_str() {
        "bayer_rggb8" => [0, 1, 1, 2],
        "bayer_bggr8" => [2, 1, 1, 0],
        "bayer_gbrg8" => [1, 2, 0, 1],
        "bayer_grbg8" => [1, 0, 2, 1],
        other => return Err(format!("a mosaic `{other}` is not known")),
    };
    let rows: Vec<&[u8]> = pixels.rows(1)?.collect();
    let (width, height) = (pixels.width, pixels.height);
    let mut rgb8 = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let (mut sums, mut counts) = ([0_u32; 3], [0_u32; 3]);
            for (j, row) in rows.iter().enumerate().take(height.min(y + 2)).skip(y.saturating_sub(1)) {
                for (i, &value) in row.iter().enumerate().take(width.min(x + 2)).skip(x.saturating_sub(1)) {
                    let colour = square[2 * (j % 2) + i % 2];
                    sums[colour] += u32::from(value);
                    counts[colour] += 1;
                }
            }
            rgb8.extend([0, 1, 2].map(|k| (sums[k] / counts[k].max(1)) as u8));
        }
    }
    Ok(Colour { width, height, rgb8 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_shows_colour_at_the_size_of_the_depth_and_depth_where_there_is_none() {
        let depth = Depths::Units(vec![0, 1000, 2000, 4000, 1000, 0, 4000, 2000]);
        let rgb8 = [[10, 11, 12], [20, 21, 22]].concat();
        let colour = Some(Colour { width: 2, height: 1, rgb8 });
        let mut images = Images { width: 4, height: 2, depth, colour, colour_fault: None };
        let [left, right] = [[10, 11, 12], [20, 21, 22]];
        assert_eq!(images.picture().data, [left, left, right, right, left, left, right, right].concat());
        images.colour = None;
        let greys: Vec<u8> = images.picture().data.chunks(3).map(|pixel| pixel[0]).collect();
        assert_eq!(greys, [0, 255, 127, 63, 255, 0, 63, 127]);
    }
}
