//! Topics of a recording, and which of them are meant.

use mcap::Message;
use vio_ekf::{Imu, Stamp};

use super::fields::imu;
use crate::mcap_messages::images::{ImageData, image, image_header};
use crate::mcap_messages::schema_of;

/// Images of one camera.
pub(super) struct ImageTopic {
    pub(super) topic: String,
    pub(super) frame: String,
    pub(super) stamps: Vec<Stamp>,
    /// Distances, not light.
    is_depth: bool,
    /// Pixels per row, and rows, where the first message says them.
    size: Option<(usize, usize)>,
}

impl ImageTopic {
    /// From its first message; `None` if that is no image.
    pub(super) fn new(message: &Message) -> Option<Self> {
        let (stamp, frame) = image_header(schema_of(message), message.data.as_ref())?;
        let topic = message.channel.topic.clone();
        let called_depth = ["depth", "disparity"].iter().any(|name| topic.to_lowercase().contains(name));
        let (is_depth, size) = match image(message) {
            Some((_, ImageData::Raw(pixels))) => {
                let distances = pixels.encoding == "32FC1" || (pixels.encoding == "16UC1" && called_depth);
                (distances, Some((pixels.width, pixels.height)))
            }
            Some((_, ImageData::Compressed { format, .. })) => {
                (format.contains("compressedDepth") || called_depth, None)
            }
            None => (called_depth, None),
        };
        Some(Self { topic, frame, stamps: vec![stamp], is_depth, size })
    }

    pub(super) fn describe(&self) -> String {
        let size = self.size.map_or(String::new(), |(width, height)| format!(", {width}x{height}"));
        let depth = if self.is_depth { ", depth" } else { "" };
        format!("{} ({} images{size}{depth})", self.topic, self.stamps.len())
    }
}

/// Brings the topics of the cameras to the front: those that are named; otherwise those that are light and have the size of the
/// calibration, in the order of the file.
///
/// # Errors
/// A name that no topic has.
pub(super) fn order_images(
    mut topics: Vec<ImageTopic>,
    named: &[String],
    size: Option<(usize, usize)>,
) -> Result<Vec<ImageTopic>, String> {
    for name in named {
        if !topics.iter().any(|topic| topic.topic == *name) {
            let all: Vec<String> = topics.iter().map(ImageTopic::describe).collect();
            return Err(format!("no images on the topic `{name}` of --camera-topic: there are {}", all.join(", ")));
        }
    }
    let fits = |topic: &ImageTopic| size.is_none() || topic.size.is_none() || topic.size == size;
    topics.sort_by_key(|topic| {
        let place = named.iter().position(|name| *name == topic.topic).unwrap_or(named.len());
        (place, topic.is_depth, !fits(topic))
    });
    Ok(topics)
}

/// Samples of one topic.
pub(super) struct ImuTopic {
    pub(super) topic: String,
    pub(super) frame: String,
    pub(super) samples: Vec<Imu>,
    /// Why it cannot be read.
    pub(super) fault: Option<String>,
}

impl ImuTopic {
    pub(super) fn new(topic: &str) -> Self {
        Self { topic: topic.to_owned(), frame: String::new(), samples: Vec::new(), fault: None }
    }

    pub(super) fn take(&mut self, data: &[u8]) {
        let Some((sample, frame)) = imu(data) else {
            self.fault
                .get_or_insert_with(|| format!("topic {}: a sensor_msgs/msg/Imu that cannot be decoded", self.topic));
            return;
        };
        // Drivers repeat samples; a stamp that goes back is another matter.
        if self.samples.last().is_none_or(|last| last.stamp != sample.stamp) {
            self.samples.push(sample);
        }
        self.frame = frame;
    }

    /// Some drivers have a topic for each half of the sensor.
    fn has_both(&self) -> bool {
        let moves = |half: fn(&Imu) -> f64| self.samples.iter().any(|sample| half(sample) != 0.0);
        moves(|sample| sample.gyro.norm_squared()) && moves(|sample| sample.accel.norm_squared())
    }

    fn describe(&self) -> String {
        let half = if self.has_both() { "" } else { ", one half only" };
        format!("{} ({} samples{half})", self.topic, self.samples.len())
    }
}

/// The topic of the inertial sensor: the one that is named, or the first that has rates and forces. Beside it what the others are.
///
/// # Errors
/// A name that no topic has; no samples; samples that cannot be decoded.
pub(super) fn choose_imu(mut topics: Vec<ImuTopic>, named: Option<&str>) -> Result<(ImuTopic, Vec<String>), String> {
    let all = || topics.iter().map(ImuTopic::describe).collect::<Vec<_>>().join(", ");
    let index = match named {
        Some(name) => topics
            .iter()
            .position(|topic| topic.topic == name)
            .ok_or_else(|| format!("no inertial samples on the topic `{name}` of --imu-topic: there are {}", all()))?,
        None if topics.is_empty() => {
            return Err("no topic with inertial samples: expected sensor_msgs/msg/Imu in CDR".into());
        }
        None => topics.iter().position(ImuTopic::has_both).unwrap_or(0),
    };
    let chosen = topics.swap_remove(index);
    match chosen.fault {
        Some(fault) => Err(fault),
        None => Ok((chosen, topics.iter().map(ImuTopic::describe).collect())),
    }
}

#[cfg(test)]
mod tests {
    use vio_ekf::nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_topic_with_one_half_of_the_sensor_is_told_apart() {
        let topic = |gyro: f64, accel: f64| {
            let stamp = vio_ekf::Stamp::from_nanos(0);
            let sample = Imu { stamp, gyro: Vector3::x() * gyro, accel: Vector3::z() * accel };
            ImuTopic { samples: vec![sample], ..ImuTopic::new("imu") }
        };
        let found = [(0.1, 9.8), (0.1, 0.0), (0.0, 9.8), (0.0, 0.0)].map(|(gyro, accel)| topic(gyro, accel).has_both());
        assert_eq!(found, [true, false, false, false]);
        assert!(topic(0.1, 0.0).describe().ends_with("(1 samples, one half only)"));
    }
}
