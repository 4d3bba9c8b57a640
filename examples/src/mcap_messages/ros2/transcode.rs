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

#[cfg(test)]
mod tests {
    use foxglove::messages::{FrameTransform, FrameTransforms, Log, Pose, PoseInFrame, Quaternion, Timestamp, Vector3};

    use super::*;
    use crate::mcap_messages::cdr;
    use crate::recording::Recorder;

    #[test]
    fn every_message_comes_out_in_cdr_with_its_values() {
        let path = std::env::temp_dir().join(format!("paintcopter-ros2-{}.mcap", std::process::id()));
        let mut recorder = Recorder::create(&path).unwrap();
        let timestamp = Some(Timestamp::new(7, 250_000_000));
        let place = Vector3 { x: 1.0, y: -2.0, z: 3.0 };
        let turn = Quaternion { x: 0.0, y: 0.6, z: 0.0, w: 0.8 };
        let frame = FrameTransform {
            timestamp,
            parent_frame_id: "world".into(),
            child_frame_id: "body".into(),
            translation: Some(place),
            rotation: Some(turn),
        };
        let tf = recorder.channel::<FrameTransforms>("/tf").unwrap();
        recorder.write(tf, 7.25, &FrameTransforms { transforms: vec![frame] }).unwrap();
        let pose = recorder.channel::<PoseInFrame>("/pose").unwrap();
        let posed = Some(Pose { position: Some(place), orientation: Some(turn) });
        recorder.write(pose, 7.25, &PoseInFrame { timestamp, frame_id: "world".into(), pose: posed }).unwrap();
        let log = recorder.channel::<Log>("/log").unwrap();
        let line = Log { timestamp, level: 3, message: "gusts".into(), ..Log::default() };
        recorder.write(log, 7.5, &line).unwrap();
        recorder.finish().unwrap();

        let written = write_ros2_beside(&path).unwrap();
        let bytes = std::fs::read(&written).unwrap();
        for file in [&path, &written] {
            std::fs::remove_file(file).unwrap();
        }
        // After the magic number, the opcode and the record's length: the length of the profile's name, and the name.
        assert_eq!(&bytes[17..25], b"\x04\0\0\0ros2");
        let messages: Vec<Message> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
        let told: Vec<_> = messages.iter().map(|m| (m.channel.topic.as_str(), schema_of(m), m.log_time)).collect();
        assert_eq!(
            told,
            [
                ("/tf", "tf2_msgs/msg/TFMessage", 7_250_000_000),
                ("/pose", "geometry_msgs/msg/PoseStamped", 7_250_000_000),
                ("/log", "rcl_interfaces/msg/Log", 7_500_000_000),
            ]
        );
        assert!(messages.iter().all(|m| m.channel.message_encoding == "cdr"));
        let transforms: Vec<cdr::TransformStamped> = cdr::decode(&messages[0].data).unwrap();
        let read = &transforms[0];
        assert_eq!((read.header.frame_id.as_str(), read.child_frame_id.as_str()), ("world", "body"));
        assert_eq!(
            (read.header.time(), read.translation, read.rotation),
            ((7, 250_000_000), [1.0, -2.0, 3.0], [0.0, 0.6, 0.0, 0.8])
        );
        let (header, position, orientation): (cdr::Header, [f64; 3], [f64; 4]) =
            cdr::decode(&messages[1].data).unwrap();
        assert_eq!(
            (header.frame_id.as_str(), position, orientation),
            ("world", [1.0, -2.0, 3.0], [0.0, 0.6, 0.0, 0.8])
        );
        // Foxglove counts warnings as 3, ROS as 30.
        let (_, level, _, message): ((i32, u32), u8, String, String) = cdr::decode(&messages[2].data).unwrap();
        assert_eq!((level, message.as_str()), (30, "gusts"));
    }
}
