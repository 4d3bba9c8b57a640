//! Images as messages: Foxglove's and those of ROS 2, packed or compressed.

use foxglove::Decode;
use foxglove::messages::{CompressedImage, RawImage};
use mcap::Message;
use vio_ekf::Stamp;

use super::fields::stamp;
use crate::vio::cdr;
use crate::vio::grey_image::GreyImage;

/// Time of an image; `None` if the message is none.
pub(super) fn image_stamp(schema: &str, data: &[u8]) -> Option<Stamp> {
    match schema {
        "foxglove.RawImage" => RawImage::decode(data).ok()?.timestamp.map(stamp),
        "foxglove.CompressedImage" => CompressedImage::decode(data).ok()?.timestamp.map(stamp),
        _ => cdr::decode::<cdr::Header>(data).map(|header| header.stamp()),
    }
}

/// Time and pixels of an image; `None` if the message is none.
pub(super) fn image(message: &Message) -> Option<(Stamp, Result<GreyImage, String>)> {
    let data = message.data.as_ref();
    match message.channel.schema.as_ref()?.name.as_str() {
        "foxglove.RawImage" => {
            let raw = RawImage::decode(data).ok()?;
            let size = (raw.width as usize, raw.height as usize, raw.step as usize);
            Some((stamp(raw.timestamp?), unpack(&raw.encoding, size, &raw.data)))
        }
        "foxglove.CompressedImage" => {
            let image = CompressedImage::decode(data).ok()?;
            Some((stamp(image.timestamp?), GreyImage::decode(&image.data)))
        }
        "sensor_msgs/msg/Image" => {
            let raw: cdr::Image = cdr::decode(data)?;
            let size = (raw.width as usize, raw.height as usize, raw.step as usize);
            Some((raw.header.stamp(), unpack(&raw.encoding, size, raw.data)))
        }
        "sensor_msgs/msg/CompressedImage" => {
            let image: cdr::CompressedImage = cdr::decode(data)?;
            Some((image.header.stamp(), GreyImage::decode(image.data)))
        }
        _ => None,
    }
}

/// Pixels as they are in memory, row by row with padding, to grey.
fn unpack(encoding: &str, (width, height, step): (usize, usize, usize), data: &[u8]) -> Result<GreyImage, String> {
    let (channels, red) = match encoding {
        "mono8" | "8UC1" => (1, 0),
        "rgb8" => (3, 0),
        "bgr8" | "8UC3" => (3, 2),
        "rgba8" => (4, 0),
        "bgra8" => (4, 2),
        other => {
            return Err(format!("pixels encoded as `{other}` are not read: record mono8, rgb8, bgr8, PNG or JPEG"));
        }
    };
    let row = width.saturating_mul(channels);
    if step < row || data.len() < step.saturating_mul(height) {
        return Err(format!("{} bytes are too few for {width}x{height} pixels in rows of {step}", data.len()));
    }
    let luma = |pixel: &[u8]| {
        if channels == 1 {
            return pixel[0];
        }
        // ITU-R BT.601, as the colour cameras' own conversion.
        let (r, g, b) = (u32::from(pixel[red]), u32::from(pixel[1]), u32::from(pixel[2 - red]));
        ((299 * r + 587 * g + 114 * b + 500) / 1000) as u8
    };
    let rows = data.chunks_exact(step.max(1)).take(height);
    Ok(GreyImage { width, height, data: rows.flat_map(|r| r[..row].chunks_exact(channels).map(luma)).collect() })
}

#[cfg(test)]
mod tests {
    use super::unpack;

    #[test]
    fn pixels_are_unpacked_with_padding_and_colours_by_their_weight() {
        let grey = |encoding: &str, size, data: &[u8]| unpack(encoding, size, data).map(|grey| grey.data);
        assert_eq!(grey("mono8", (2, 2, 3), &[1, 2, 99, 3, 4, 99]), Ok(vec![1, 2, 3, 4]));
        // Red, green and blue alone: 29.9, 58.7 and 11.4 per cent.
        let colours = [255, 0, 0, 0, 255, 0, 0, 0, 255];
        assert_eq!(grey("rgb8", (3, 1, 9), &colours), Ok(vec![76, 150, 29]));
        assert_eq!(grey("bgr8", (3, 1, 9), &colours), Ok(vec![29, 150, 76]));
        assert_eq!(grey("bgra8", (1, 1, 4), &[0, 0, 255, 7]), Ok(vec![76]));
        for (encoding, size, data) in
            [("mono8", (2, 2, 1), &[0; 9][..]), ("mono8", (2, 2, 2), &[0; 3]), ("mono16", (1, 1, 2), &[0; 2])]
        {
            assert!(grey(encoding, size, data).is_err(), "{encoding} {size:?}");
        }
        assert!(unpack("rgb8", (usize::MAX, 1, usize::MAX), &[0; 4]).is_err());
    }
}
