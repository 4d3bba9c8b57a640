//! Images as messages: Foxglove's and those of ROS 2, packed or compressed.

use foxglove::Decode;
use foxglove::messages::{CompressedImage, RawImage};
use mcap::Message;
use vio_ekf::Stamp;

use super::cdr;
use super::fields::stamp;
use super::schema_of;

/// Schemas of images.
pub(crate) const SCHEMAS: [&str; 4] =
    ["foxglove.RawImage", "foxglove.CompressedImage", "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"];

/// Time and frame of an image; `None` if the message is none.
pub(crate) fn image_header(schema: &str, data: &[u8]) -> Option<(Stamp, String)> {
    match schema {
        "foxglove.RawImage" => RawImage::decode(data).ok().and_then(|m| Some((stamp(m.timestamp?), m.frame_id))),
        "foxglove.CompressedImage" => {
            CompressedImage::decode(data).ok().and_then(|m| Some((stamp(m.timestamp?), m.frame_id)))
        }
        _ => cdr::decode::<cdr::Header>(data).map(|header| (header.stamp(), header.frame_id)),
    }
}

/// The pixels of an image message.
pub(crate) enum ImageData {
    /// As they are in memory.
    Raw(RawPixels),
    /// A file in a message.
    Compressed {
        /// What ROS says about it, for instance `jpeg` or `16UC1; compressedDepth png`.
        format: String,
        /// The file.
        bytes: Vec<u8>,
    },
}

/// Pixels row by row, with padding.
pub(crate) struct RawPixels {
    /// As ROS names it: `mono8`, `16UC1`, `rgb8` and so on.
    pub(crate) encoding: String,
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Bytes from row to row.
    pub(crate) step: usize,
    pub(crate) big_endian: bool,
    pub(crate) data: Vec<u8>,
}

impl RawPixels {
    /// The rows without their padding.
    pub(crate) fn rows(&self, bytes_per_pixel: usize) -> Result<impl Iterator<Item = &[u8]>, String> {
        let row = self.width.saturating_mul(bytes_per_pixel);
        if row == 0 || self.height == 0 || self.step < row || self.data.len() < self.step.saturating_mul(self.height) {
            let (bytes, width, height, step) = (self.data.len(), self.width, self.height, self.step);
            return Err(format!("{bytes} bytes are too few for {width}x{height} pixels in rows of {step}"));
        }
        Ok(self.data.chunks_exact(self.step).take(self.height).map(move |r| &r[..row]))
    }
}

/// Time and pixels of an image; `None` if the message is none.
pub(crate) fn image(message: &Message) -> Option<(Stamp, ImageData)> {
    let data = message.data.as_ref();
    match schema_of(message) {
        "foxglove.RawImage" => {
            let raw = RawImage::decode(data).ok()?;
            let pixels = RawPixels {
                encoding: raw.encoding,
                width: raw.width as usize,
                height: raw.height as usize,
                step: raw.step as usize,
                big_endian: false,
                data: raw.data.to_vec(),
            };
            Some((stamp(raw.timestamp?), ImageData::Raw(pixels)))
        }
        "foxglove.CompressedImage" => {
            let image = CompressedImage::decode(data).ok()?;
            Some((stamp(image.timestamp?), ImageData::Compressed { format: image.format, bytes: image.data.to_vec() }))
        }
        "sensor_msgs/msg/Image" => {
            let raw: cdr::Image = cdr::decode(data)?;
            let pixels = RawPixels {
                encoding: raw.encoding,
                width: raw.width as usize,
                height: raw.height as usize,
                step: raw.step as usize,
                big_endian: raw.is_bigendian != 0,
                data: raw.data.to_vec(),
            };
            Some((raw.header.stamp(), ImageData::Raw(pixels)))
        }
        "sensor_msgs/msg/CompressedImage" => {
            let image: cdr::CompressedImage = cdr::decode(data)?;
            Some((image.header.stamp(), ImageData::Compressed { format: image.format, bytes: image.data.to_vec() }))
        }
        _ => None,
    }
}
