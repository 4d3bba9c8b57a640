//! A recording with Foxglove's schemas once more, for ROS 2.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages;
use mcap::Message;

use super::convert::{MarkerTable, camera_info, compressed_image, image, joint_state, log, pose_stamped, transforms};
use super::messages::Text;
use super::writer::Ros2Writer;
use crate::mcap_messages::{MessagesFault, messages_of, schema_of};

/// Writes `NAME.ros2.mcap` beside a recording `NAME.mcap`: poses as `PoseStamped`, frames as `TFMessage`, scenes as `MarkerArray`, what
/// is JSON as `String`. Its path.
///
/// # Errors
/// Why it cannot be read or written, or a message that has no counterpart.
pub(crate) fn write_ros2_beside(recording: &Path) -> Result<PathBuf, String> {
    let target = recording.with_extension("ros2.mcap");
    let in_target = |error: mcap::McapError| format!("{}: {error}", target.display());
    let mut writer = Ros2Writer::create(&target).map_err(in_target)?;
    let mut scenes: BTreeMap<String, MarkerTable> = BTreeMap::new();
    let unread = |fault: MessagesFault| format!("{}: {fault}", recording.display());
    for message in messages_of(recording).map_err(unread)? {
        let message = message.map_err(unread)?;
        let table = scenes.entry(message.channel.topic.clone()).or_default();
        match rewrite(&message, table, &mut writer) {
            Ok(true) => {}
            Ok(false) => {
                let (schema, topic) = (schema_of(&message), &message.channel.topic);
                return Err(format!("{}: topic {topic}: no {schema} for ROS 2", recording.display()));
            }
            Err(error) => return Err(in_target(error)),
        }
    }
    writer.finish().map_err(in_target)?;
    Ok(target)
}

/// One message; whether there is one for it.
fn rewrite(message: &Message, table: &mut MarkerTable, writer: &mut Ros2Writer) -> mcap::McapResult<bool> {
    let (topic, time, data) = (message.channel.topic.as_str(), message.log_time, message.data.as_ref());
    macro_rules! as_ros {
        ($foxglove:ident, $convert:expr) => {
            match messages::$foxglove::decode(data) {
                Ok(read) => writer.write(topic, time, &$convert(read)).map(|()| true),
                Err(_) => Ok(false),
            }
        };
    }
    match (message.channel.message_encoding.as_str(), schema_of(message)) {
        ("cdr", name) => {
            let Some(schema) = &message.channel.schema else { return Ok(false) };
            let definition = || schema.data.to_vec();
            writer.write_encoded(topic, name, &schema.encoding, &definition, time, data).map(|()| true)
        }
        ("json", _) => {
            let text = String::from_utf8_lossy(data).into_owned();
            writer.write(topic, time, &Text(text)).map(|()| true)
        }
        (_, "foxglove.FrameTransform") => as_ros!(FrameTransform, |read| transforms([&read])),
        (_, "foxglove.FrameTransforms") => {
            as_ros!(FrameTransforms, |read: messages::FrameTransforms| transforms(&read.transforms))
        }
        (_, "foxglove.PoseInFrame") => as_ros!(PoseInFrame, |read| pose_stamped(&read)),
        (_, "foxglove.JointStates") => as_ros!(JointStates, |read| joint_state(&read)),
        (_, "foxglove.SceneUpdate") => as_ros!(SceneUpdate, |read| table.update(&read)),
        (_, "foxglove.Log") => as_ros!(Log, log),
        (_, "foxglove.RawImage") => as_ros!(RawImage, image),
        (_, "foxglove.CompressedImage") => as_ros!(CompressedImage, compressed_image),
        (_, "foxglove.CameraCalibration") => {
            let info = messages::CameraCalibration::decode(data).ok().and_then(camera_info);
            info.map_or(Ok(false), |info| writer.write(topic, time, &info).map(|()| true))
        }
        _ => Ok(false),
    }
}
