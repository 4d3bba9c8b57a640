//! A recorded motion of the robot: poses from an MCAP file.

use std::path::Path;

use foxglove::Decode;
use foxglove::messages::{FrameTransform, PoseInFrame};
use mcap::Message;
use nalgebra::Isometry3;
use serde::Deserialize;
use vio_ekf::{Stamp, Trajectory};

use super::error::HandheldError;
use crate::mcap_messages::fields::{isometry, isometry_of, stamp};
use crate::mcap_messages::{MessagesFault, cdr, messages_of, schema_of};

/// Longest time between two poses over which the motion is interpolated, s.
const LONGEST_GAP: f64 = 0.5;

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Deserialize)]
struct PoseStamped {
    header: cdr::Header,
    position: [f64; 3],
    /// x, y, z, w.
    orientation: [f64; 4],
}

/// A recorded motion.
pub(super) struct RecordedMotion {
    /// Topic that it comes from.
    pub(super) topic: String,
    poses: Trajectory,
    start: Stamp,
    /// Its duration, s.
    pub(super) duration: f64,
}

impl RecordedMotion {
    /// Reads the first topic with poses: `foxglove.PoseInFrame`, `foxglove.FrameTransform` or `geometry_msgs/msg/PoseStamped`.
    pub(super) fn read(path: &Path) -> Result<Self, HandheldError> {
        let fault = |why: MessagesFault| match why {
            MessagesFault::Unreadable(why) => HandheldError::unreadable(path, &why),
            MessagesFault::Malformed(why) => HandheldError::unreadable(path, &why),
        };
        let mut topic: Option<String> = None;
        let mut poses = Trajectory::default();
        for message in messages_of(path).map_err(fault)? {
            let message = message.map_err(fault)?;
            if topic.as_ref().is_some_and(|topic| *topic != message.channel.topic) {
                continue;
            }
            let Some(found) = pose(&message) else { continue };
            let (at, pose) = found.map_err(|why| HandheldError::unreadable(path, &why))?;
            topic.get_or_insert_with(|| message.channel.topic.clone());
            // Poses that repeat a stamp, or go back, say nothing new.
            let _ = poses.push(at, pose);
        }
        let (Some(topic), Some((start, end))) = (topic, poses.span().filter(|_| poses.len() > 1)) else {
            let why =
                "no two poses: expected foxglove.PoseInFrame, foxglove.FrameTransform or geometry_msgs/msg/PoseStamped";
            return Err(HandheldError::unreadable(path, &why));
        };
        let gap = poses.stamps().windows(2).map(|pair| pair[1].as_secs() - pair[0].as_secs()).fold(0.0, f64::max);
        if gap > LONGEST_GAP {
            let why = format!("the poses of {topic} have a gap of {gap:.2} s: record them at 10 Hz or faster");
            return Err(HandheldError::unreadable(path, &why));
        }
        let duration = end.as_secs() - start.as_secs();
        Ok(Self { topic, poses, start, duration })
    }

    /// The robot at a time after the first pose, s.
    pub(super) fn at(&self, time: f64) -> Isometry3<f64> {
        let nanos = (time.clamp(0.0, self.duration) * 1e9) as i64;
        let stamp = Stamp::from_nanos(self.start.nanos() + nanos);
        // Inside the span every stamp has a pose; its very end may be lost to rounding.
        let last = self.poses.poses().last().copied().unwrap_or_else(Isometry3::identity);
        self.poses.pose_at(stamp).unwrap_or(last)
    }
}

/// `None`: no pose.
fn pose(message: &Message) -> Option<Result<(Stamp, Isometry3<f64>), String>> {
    let data = message.data.as_ref();
    let found = match schema_of(message) {
        "foxglove.PoseInFrame" => PoseInFrame::decode(data).ok().and_then(|found| {
            let pose = found.pose?;
            Some((found.timestamp.map(stamp)?, isometry(pose.position, pose.orientation)?))
        }),
        "foxglove.FrameTransform" => FrameTransform::decode(data)
            .ok()
            .and_then(|found| Some((found.timestamp.map(stamp)?, isometry(found.translation, found.rotation)?))),
        "geometry_msgs/msg/PoseStamped" => cdr::decode::<PoseStamped>(data)
            .and_then(|found| Some((found.header.stamp(), isometry_of(found.position, found.orientation)?))),
        _ => return None,
    };
    let bad = || format!("topic {}: a {} that cannot be decoded", message.channel.topic, schema_of(message));
    Some(found.ok_or_else(bad))
}
