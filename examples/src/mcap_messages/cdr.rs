//! ROS 2 messages in CDR: images, cameras, transforms and inertial samples, read in either byte order, written in little endian.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::{from_bytes, to_writer};
use serde::{Deserialize, Serialize};
use vio_ekf::Stamp;

/// `std_msgs/Header`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Header {
    seconds: i32,
    nanos: u32,
    pub(crate) frame_id: String,
}

impl Header {
    pub(crate) fn new(stamp: Stamp, frame_id: &str) -> Self {
        let nanos = stamp.nanos();
        let (seconds, nanos) = (nanos.div_euclid(1_000_000_000) as i32, nanos.rem_euclid(1_000_000_000) as u32);
        Self { seconds, nanos, frame_id: frame_id.into() }
    }

    /// Seconds and nanoseconds.
    pub(crate) fn time(&self) -> (i32, u32) {
        (self.seconds, self.nanos)
    }

    pub(crate) fn stamp(&self) -> Stamp {
        Stamp::from_nanos(i64::from(self.seconds) * 1_000_000_000 + i64::from(self.nanos))
    }
}

/// `sensor_msgs/Image`.
#[derive(Serialize, Deserialize)]
pub(crate) struct Image<'a> {
    pub(crate) header: Header,
    pub(crate) height: u32,
    pub(crate) width: u32,
    pub(crate) encoding: String,
    pub(crate) is_bigendian: u8,
    pub(crate) step: u32,
    #[serde(borrow)]
    pub(crate) data: &'a [u8],
}

/// `sensor_msgs/CompressedImage`.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct CompressedImage<'a> {
    pub(crate) header: Header,
    pub(crate) format: String,
    #[serde(borrow)]
    pub(crate) data: &'a [u8],
}

/// The first fields of `sensor_msgs/CameraInfo`.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct CameraInfo {
    pub(crate) header: Header,
    pub(crate) height: u32,
    pub(crate) width: u32,
    pub(crate) distortion_model: String,
    pub(crate) d: Vec<f64>,
    /// Row by row.
    pub(crate) k: [f64; 9],
}

/// `geometry_msgs/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pose {
    pub(crate) position: [f64; 3],
    /// x, y, z, w.
    pub(crate) orientation: [f64; 4],
}

impl Default for Pose {
    fn default() -> Self {
        Self { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] }
    }
}

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Serialize, Deserialize)]
pub(crate) struct PoseStamped {
    pub(crate) header: Header,
    pub(crate) pose: Pose,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Serialize, Deserialize)]
pub(crate) struct TransformStamped {
    pub(crate) header: Header,
    pub(crate) child_frame_id: String,
    pub(crate) translation: [f64; 3],
    /// x, y, z, w.
    pub(crate) rotation: [f64; 4],
}

/// `sensor_msgs/Imu`; covariances row by row.
#[derive(Serialize, Deserialize)]
pub(crate) struct Imu {
    pub(crate) header: Header,
    /// x, y, z, w.
    pub(crate) orientation: [f64; 4],
    pub(crate) orientation_covariance: [f64; 9],
    pub(crate) angular_velocity: [f64; 3],
    pub(crate) angular_velocity_covariance: [f64; 9],
    pub(crate) linear_acceleration: [f64; 3],
    pub(crate) linear_acceleration_covariance: [f64; 9],
}

/// A message of these bytes; `None` if they end too early, or are encoded otherwise than in plain CDR.
pub(crate) fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<T> {
    // The encapsulation header: plain CDR in big (0) or little endian (1), two bytes of options. Alignment counts after it.
    let (head, body) = bytes.split_first_chunk::<4>()?;
    let message = match head[..2] {
        [0, 0] => from_bytes::<T, BigEndian>(body),
        [0, 1] => from_bytes::<T, LittleEndian>(body),
        _ => return None,
    };
    message.ok().map(|(message, _)| message)
}

/// The bytes of a message.
pub(crate) fn encode(message: &impl Serialize) -> cdr_encoding::Result<Vec<u8>> {
    let mut bytes = vec![0, 1, 0, 0];
    to_writer::<_, LittleEndian, _>(&mut bytes, message)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

    use super::*;

    type Message = (Header, u8, f64);

    /// A header, a byte and a number, in both orders of bytes: from the rules of the encoding, not from a writer.
    #[test]
    fn both_byte_orders_are_read_and_alignment_counts_from_the_fifth_byte() {
        // The number lies at the sixteenth byte of the body, the twentieth of all: no padding, if counted rightly.
        let text = [b'a', b'b', 0, 5];
        let little = [&[0, 1, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0], &text[..], &1.5_f64.to_le_bytes()].concat();
        let big = [&[0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 3], &text[..], &1.5_f64.to_be_bytes()].concat();
        let header = Header::new(Stamp::from_nanos(7_000_000_009), "ab");
        assert_eq!(header.stamp(), Stamp::from_nanos(7_000_000_009));
        let expected = (header, 5, 1.5);
        for bytes in [&little, &big] {
            assert_eq!(decode::<Message>(bytes).as_ref(), Some(&expected));
            for cut in 0..bytes.len() {
                assert_eq!(decode::<Message>(&bytes[..cut]), None, "cut at {cut}");
            }
        }
        assert_eq!(encode(&expected).unwrap(), little);
        // Before 1970 the seconds are rounded down.
        let early = Stamp::from_nanos(-1);
        assert_eq!((Header::new(early, "").seconds, Header::new(early, "").stamp()), (-1, early));
    }

    /// Changed at random, a message is read or refused.
    #[test]
    fn damaged_messages_do_no_harm() {
        let header = Header::new(Stamp::from_nanos(3_000_000_007), "camera");
        let image = encode(&(header, 2_u32, 3_u32, "mono8", 0_u8, 3_u32, vec![9_u8; 6])).unwrap();
        let read: Image = decode(&image).unwrap();
        assert_eq!(
            (read.height, read.width, read.step, read.encoding.as_str(), read.data),
            (2, 3, 3, "mono8", &[9; 6][..])
        );
        let mut random = SplitMix64::seed_from_u64(7);
        let mut refused = 0;
        for _ in 0..3000 {
            let mut bytes = image.clone();
            for _ in 0..=random.next_u64() % 3 {
                let at = (random.next_u64() % bytes.len() as u64) as usize;
                bytes[at] = random.next_u64() as u8;
            }
            refused += usize::from(decode::<Image>(&bytes).is_none());
            let _ = decode::<CompressedImage>(&bytes);
            let _ = decode::<Imu>(&bytes);
        }
        assert!(refused > 300, "only {refused} refused");
    }

    #[test]
    fn other_encodings_and_absurd_lengths_are_refused() {
        // Parameter lists, XCDR2, nothing.
        for head in [&[0, 3, 0, 0][..], &[0, 7, 0, 0], &[1, 0, 0, 0], &[0]] {
            assert_eq!(decode::<u8>(&[head, &[5]].concat()), None, "{head:?}");
        }
        assert_eq!(decode::<u8>(&[0, 1, 0, 0, 5]), Some(5));
        // Four gigabytes of text, of pixels.
        let length = [0, 1, 0, 0, 255, 255, 255, 255, 1];
        assert_eq!(decode::<String>(&length), None);
        assert_eq!(decode::<&[u8]>(&length), None);
        // Text that is no UTF-8.
        assert_eq!(decode::<String>(&[0, 1, 0, 0, 2, 0, 0, 0, 0xff, 0]), None);
    }
}
