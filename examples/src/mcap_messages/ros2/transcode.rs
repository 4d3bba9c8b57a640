//! A recording with Foxglove's schemas once more, for ROS 2.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use foxglove::Decode;
use foxglove::messages;
use mcap::{McapResult, Message};

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
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(in_target(error)),
            None => {
                let (schema, topic) = (schema_of(&message), &message.channel.topic);
                return Err(format!("{}: topic {topic}: no {schema} for ROS 2", recording.display()));
            }
        }
    }
    writer.finish().map_err(in_target)?;
    Ok(target)
}

/// One message; `None` where there is none for it.
fn rewrite(message: &Message, table: &mut MarkerTable, writer: &mut Ros2Writer) -> Option<McapResult<()>> {
    use messages::{FrameTransform, FrameTransforms, JointStates, PoseInFrame, RawImage, SceneUpdate};
    let (topic, time, data) = (message.channel.topic.as_str(), message.log_time, message.data.as_ref());
    Some(match (message.channel.message_encoding.as_str(), schema_of(message)) {
        ("cdr", name) => {
            let schema = message.channel.schema.as_ref()?;
            writer.write_encoded(topic, name, &schema.encoding, &|| schema.data.to_vec(), time, data)
        }
        ("json", _) => writer.write(topic, time, &Text(String::from_utf8_lossy(data).into_owned())),
        (_, "foxglove.FrameTransform") => writer.write(topic, time, &transforms([&decoded::<FrameTransform>(data)?])),
        (_, "foxglove.FrameTransforms") => {
            writer.write(topic, time, &transforms(&decoded::<FrameTransforms>(data)?.transforms))
        }
        (_, "foxglove.PoseInFrame") => writer.write(topic, time, &pose_stamped(&decoded::<PoseInFrame>(data)?)),
        (_, "foxglove.JointStates") => writer.write(topic, time, &joint_state(&decoded::<JointStates>(data)?)),
        (_, "foxglove.SceneUpdate") => writer.write(topic, time, &table.update(&decoded::<SceneUpdate>(data)?)),
        (_, "foxglove.Log") => writer.write(topic, time, &log(decoded(data)?)),
        (_, "foxglove.RawImage") => writer.write(topic, time, &image(&decoded::<RawImage>(data)?)),
        (_, "foxglove.CompressedImage") => writer.write(topic, time, &compressed_image(&decoded(data)?)),
        (_, "foxglove.CameraCalibration") => writer.write(topic, time, &camera_info(decoded(data)?)?),
        _ => return None,
    })
}

fn decoded<M: Decode>(data: &[u8]) -> Option<M> {
    M::decode(data).ok()
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
