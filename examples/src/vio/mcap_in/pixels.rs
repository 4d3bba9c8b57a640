//! Images in messages, to grey.

use mcap::Message;
use vio_ekf::Stamp;

use crate::mcap_messages::images::{self, ImageData, RawPixels};
use crate::vio::grey_image::GreyImage;

/// Time and pixels of an image; `None` if the message is none.
pub(super) fn image(message: &Message) -> Option<(Stamp, Result<GreyImage, String>)> {
    let (stamp, data) = images::image(message)?;
    let grey = match data {
        ImageData::Raw(pixels) => unpack(&pixels),
        ImageData::Compressed { bytes, .. } => GreyImage::decode(&bytes),
    };
    Some((stamp, grey))
}

/// How a pixel lies in memory.
enum Layout {
    Grey8,
    /// Two bytes; the lower one is dropped, as of 16-bit files.
    Grey16,
    /// Channels, and which of them is red; blue is the other of the first and third.
    Colour(usize, usize),
    /// One colour per pixel, green twice in each square of four.
    Bayer8,
}

/// Pixels as they are in memory, row by row with padding, to grey.
fn unpack(pixels: &RawPixels) -> Result<GreyImage, String> {
    let &RawPixels { width, height, big_endian, .. } = pixels;
    let layout = match pixels.encoding.as_str() {
        "mono8" | "8UC1" => Layout::Grey8,
        "mono16" | "16UC1" => Layout::Grey16,
        "rgb8" => Layout::Colour(3, 0),
        "bgr8" | "8UC3" => Layout::Colour(3, 2),
        "rgba8" => Layout::Colour(4, 0),
        "bgra8" => Layout::Colour(4, 2),
        "bayer_rggb8" | "bayer_bggr8" | "bayer_gbrg8" | "bayer_grbg8" => Layout::Bayer8,
        other => {
            return Err(format!(
                "pixels encoded as `{other}` are not read: record mono8, mono16, rgb8, bgr8, bayer (8 bits), PNG or JPEG"
            ));
        }
    };
    let bytes = match layout {
        Layout::Grey8 | Layout::Bayer8 => 1,
        Layout::Grey16 => 2,
        Layout::Colour(channels, _) => channels,
    };
    let rows = pixels.rows(bytes)?;
    let data = match layout {
        Layout::Grey8 => rows.flatten().copied().collect(),
        Layout::Grey16 => {
            let upper = usize::from(!big_endian);
            rows.flat_map(|r| r.chunks_exact(2).map(move |pixel| pixel[upper])).collect()
        }
        Layout::Colour(channels, red) => {
            // ITU-R BT.601, as the colour cameras' own conversion.
            let luma = move |pixel: &[u8]| {
                let (r, g, b) = (u32::from(pixel[red]), u32::from(pixel[1]), u32::from(pixel[2 - red]));
                ((299 * r + 587 * g + 114 * b + 500) / 1000) as u8
            };
            rows.flat_map(|r| r.chunks_exact(channels).map(luma)).collect()
        }
        Layout::Bayer8 => bayer_to_grey(&rows.collect::<Vec<_>>(), width),
    };
    Ok(GreyImage { width, height, data })
}

/// A binomial window of 3x3 pixels: wherever it lies on the mosaic it holds red and blue by a quarter each and green by a half, so
/// that the order of the colours does not matter and nothing is shifted.
fn bayer_to_grey(rows: &[&[u8]], width: usize) -> Vec<u8> {
    // Mirrored at the edge, which keeps the colours of the mosaic in their places.
    let mirrored = |k: usize, offset: usize, count: usize| match (k + offset).checked_sub(1) {
        None => 1.min(count - 1),
        Some(k) if k >= count => count.saturating_sub(2),
        Some(k) => k,
    };
    let weights = [1, 2, 1];
    let pixel = |y: usize, x: usize| {
        let mut sum = 8;
        for (dy, wy) in weights.iter().enumerate() {
            let row = rows[mirrored(y, dy, rows.len())];
            for (dx, wx) in weights.iter().enumerate() {
                sum += wy * wx * u32::from(row[mirrored(x, dx, width)]);
            }
        }
        (sum / 16) as u8
    };
    (0..rows.len()).flat_map(|y| (0..width).map(move |x| (y, x))).map(|(y, x)| pixel(y, x)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpacked(
        encoding: &str,
        (width, height, step): (usize, usize, usize),
        big_endian: bool,
        data: &[u8],
    ) -> Result<GreyImage, String> {
        unpack(&RawPixels { encoding: encoding.into(), width, height, step, big_endian, data: data.to_vec() })
    }

    #[test]
    fn pixels_are_unpacked_with_padding_and_colours_by_their_weight() {
        let grey = |encoding: &str, size, data: &[u8]| unpacked(encoding, size, false, data).map(|grey| grey.data);
        assert_eq!(grey("mono8", (2, 2, 3), &[1, 2, 99, 3, 4, 99]), Ok(vec![1, 2, 3, 4]));
        // Red, green and blue alone: 29.9, 58.7 and 11.4 per cent.
        let colours = [255, 0, 0, 0, 255, 0, 0, 0, 255];
        assert_eq!(grey("rgb8", (3, 1, 9), &colours), Ok(vec![76, 150, 29]));
        assert_eq!(grey("bgr8", (3, 1, 9), &colours), Ok(vec![29, 150, 76]));
        assert_eq!(grey("bgra8", (1, 1, 4), &[0, 0, 255, 7]), Ok(vec![76]));
        for (encoding, size, data) in [
            ("mono8", (2, 2, 1), &[0; 9][..]),
            ("mono8", (2, 2, 2), &[0; 3]),
            ("mono16", (1, 1, 2), &[0; 1]),
            ("mono32", (1, 1, 4), &[0; 4]),
        ] {
            assert!(grey(encoding, size, data).is_err(), "{encoding} {size:?}");
        }
        assert!(unpacked("rgb8", (usize::MAX, 1, usize::MAX), false, &[0; 4]).is_err());
        // Two bytes in either order: the upper one counts.
        assert_eq!(grey("mono16", (2, 1, 4), &[0xff, 7, 0, 9]), Ok(vec![7, 9]));
        assert_eq!(unpacked("mono16", (2, 1, 4), true, &[7, 0xff, 9, 0]).map(|grey| grey.data), Ok(vec![7, 9]));
    }

    /// Red 40, green 100, blue 200 everywhere: (40 + 2 100 + 200) / 4, at the edges too, whatever the order of the mosaic.
    #[test]
    fn a_mosaic_of_one_colour_is_one_grey() {
        let [r, g, b] = [40, 100, 200];
        let orders = [("rggb", [r, g, g, b]), ("bggr", [b, g, g, r]), ("gbrg", [g, b, r, g]), ("grbg", [g, r, b, g])];
        for (name, square) in orders {
            // Rows of seven with one byte of padding.
            let data: Vec<u8> =
                (0..5 * 8).map(|k| if k % 8 == 7 { 255 } else { square[k / 8 % 2 * 2 + k % 8 % 2] }).collect();
            let grey = unpacked(&format!("bayer_{name}8"), (7, 5, 8), false, &data).unwrap();
            assert_eq!(grey.data, [110; 35], "{name}");
        }
    }
}
