//! Poses of a recorded motion from a file: MCAP, or text as TUM and EuRoC write it.

use std::path::Path;

use foxglove::Decode;
use foxglove::messages::{FrameTransform, PoseInFrame};
use mcap::Message;
use nalgebra::Isometry3;
use vio_ekf::format::{euroc, tum};
use vio_ekf::{Stamp, Trajectory};

use super::error::HandheldError;
use crate::mcap_messages::fields::{isometry, isometry_of, stamp};
use crate::mcap_messages::{FIRST_BYTES, MessagesFault, cdr, messages_of, schema_of};

/// First bytes of a file that gzip has packed.
const GZIP: &[u8] = &[0x1f, 0x8b];

/// Poses as they are in the file.
pub(super) struct RecordedPoses {
    /// Topic or format.
    pub(super) source: String,
    /// World from whatever moved.
    pub(super) poses: Trajectory,
    /// Poses that were left out: their stamps repeat others or go back.
    pub(super) left_out: usize,
}

/// Reads the poses of a file.
///
/// # Errors
/// [`HandheldError::Unreadable`] with what is wrong, and where.
pub(super) fn read_poses(path: &Path) -> Result<RecordedPoses, HandheldError> {
    let unreadable = |why: &dyn std::fmt::Display| HandheldError::unreadable(path, why);
    let bytes = std::fs::read(path).map_err(|e| unreadable(&e))?;
    if bytes.starts_with(GZIP) {
        return Err(unreadable(&"packed by gzip: unpack it with gunzip"));
    }
    if bytes.starts_with(FIRST_BYTES)
        || path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"))
    {
        return from_mcap(path);
    }
    let text = String::from_utf8(bytes)
        .map_err(|_| unreadable(&"neither MCAP nor text: expected poses as MCAP, TUM or EuRoC text"))?;
    let is_data = |line: &&str| !line.trim().is_empty() && !line.starts_with(['#', '\u{feff}']);
    let commas = text.lines().find(is_data).is_some_and(|line| line.contains(','));
    let (source, poses) = if commas {
        ("EuRoC text", euroc::read(&text).map(|states| states.trajectory))
    } else {
        ("TUM text", tum::read(&text))
    };
    let poses = poses.map_err(|e| unreadable(&e))?;
    let lines = text.lines().filter(is_data).count();
    Ok(RecordedPoses { source: source.into(), left_out: lines.saturating_sub(poses.len()), poses })
}

/// The first topic with poses: `foxglove.PoseInFrame`, `foxglove.FrameTransform` or `geometry_msgs/msg/PoseStamped`.
fn from_mcap(path: &Path) -> Result<RecordedPoses, HandheldError> {
    let fault = |why: MessagesFault| match why {
        MessagesFault::Unreadable(why) => HandheldError::unreadable(path, &why),
        MessagesFault::Malformed(why) | MessagesFault::CutOff(why) => HandheldError::unreadable(path, &why),
    };
    let mut topic: Option<String> = None;
    let (mut poses, mut left_out) = (Trajectory::default(), 0);
    for message in messages_of(path).map_err(fault)? {
        let message = message.map_err(fault)?;
        if topic.as_ref().is_some_and(|topic| *topic != message.channel.topic) {
            continue;
        }
        let Some(found) = pose(&message) else { continue };
        let (at, pose) = found.map_err(|why| HandheldError::unreadable(path, &why))?;
        topic.get_or_insert_with(|| message.channel.topic.clone());
        match poses.push(at, pose) {
            Err(why @ vio_ekf::Error::NonFinite { .. }) => return Err(HandheldError::unreadable(path, &why)),
            pushed => left_out += usize::from(pushed.is_err()),
        }
    }
    let Some(topic) = topic else {
        let why = "no poses: expected foxglove.PoseInFrame, foxglove.FrameTransform or geometry_msgs/msg/PoseStamped";
        return Err(HandheldError::unreadable(path, &why));
    };
    Ok(RecordedPoses { source: format!("topic {topic}"), poses, left_out })
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
        "geometry_msgs/msg/PoseStamped" => cdr::decode(data).and_then(|cdr::PoseStamped { header, pose }| {
            Some((header.stamp(), isometry_of(pose.position, pose.orientation)?))
        }),
        _ => return None,
    };
    let bad = || format!("topic {}: a {} that cannot be decoded", message.channel.topic, schema_of(message));
    Some(found.ok_or_else(bad))
}
