//! A motion from an MCAP recording.

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::Decode;
use foxglove::messages::{FrameTransforms, JointStates, PoseInFrame};
use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use super::motion::NozzleSample;
use crate::mcap_messages::fields::isometry;
use crate::mcap_messages::{MessagesFault, messages_of, schema_of};

/// Name of the nozzle's frame, and of the joint that tells the flow, m³/s.
const NOZZLE: &str = "nozzle";
const VALVE: &str = "valve";

/// Reads the nozzle from transforms that lead to a frame called `nozzle` (`foxglove.FrameTransforms`), or else from the first topic with
/// `foxglove.PoseInFrame`; x points along the spray. The flow is that of a joint called `valve` (`foxglove.JointStates`) unless there is one for all.
///
/// # Errors
/// What is wrong.
pub(super) fn read_mcap(path: &Path, flow: Option<f64>) -> Result<Vec<NozzleSample>, String> {
    let fault = |why: MessagesFault| why.to_string();
    let (mut chained, mut posed) = (Vec::new(), Vec::new());
    let mut topic: Option<String> = None;
    let mut valve = None;
    for message in messages_of(path).map_err(fault)? {
        let message = message.map_err(fault)?;
        let (data, time) = (message.data.as_ref(), message.log_time as f64 * 1e-9);
        let sample = |pose: Isometry3<f64>, flow: f64| NozzleSample {
            time,
            position: Point3::from(pose.translation.vector),
            axis: UnitVector3::new_normalize(pose.rotation * Vector3::x()),
            flow,
        };
        match schema_of(&message) {
            "foxglove.FrameTransforms" => {
                let decoded = FrameTransforms::decode(data).map_err(|error| error.to_string())?;
                let pose = nozzle_of(&decoded);
                chained.extend(pose.map(|pose| sample(pose, flow.or(valve).unwrap_or_default())));
            }
            "foxglove.JointStates" => {
                let decoded = JointStates::decode(data).map_err(|error| error.to_string())?;
                let told = decoded.joints.iter().find(|joint| joint.name == VALVE).and_then(|joint| joint.position);
                valve = told.or(valve);
                // The joints of a moment come after its transforms.
                if let (None, Some(told), Some(last)) = (flow, told, chained.last_mut()) {
                    let last: &mut NozzleSample = last;
                    if last.time == time {
                        last.flow = told;
                    }
                }
            }
            "foxglove.PoseInFrame" if topic.as_ref().is_none_or(|topic| *topic == message.channel.topic) => {
                topic.get_or_insert_with(|| message.channel.topic.clone());
                let decoded = PoseInFrame::decode(data).map_err(|error| error.to_string())?;
                let pose = decoded.pose.and_then(|pose| isometry(pose.position, pose.orientation));
                posed.extend(pose.map(|pose| sample(pose, flow.or(valve).unwrap_or_default())));
            }
            _ => {}
        }
    }
    if flow.is_none() && valve.is_none() {
        return Err(format!("tells of no flow: expected a joint called {VALVE} (foxglove.JointStates), or --flow"));
    }
    let samples = if chained.is_empty() { posed } else { chained };
    if samples.is_empty() {
        let why =
            "tells of no nozzle: expected foxglove.FrameTransforms to a frame called nozzle, or foxglove.PoseInFrame";
        return Err(why.into());
    }
    Ok(samples)
}

/// From the frame that is no other's child down to the nozzle.
fn nozzle_of(transforms: &FrameTransforms) -> Option<Isometry3<f64>> {
    let mut parents: BTreeMap<&str, (&str, Isometry3<f64>)> = BTreeMap::new();
    for transform in &transforms.transforms {
        let pose = isometry(transform.translation, transform.rotation)?;
        parents.insert(&transform.child_frame_id, (&transform.parent_frame_id, pose));
    }
    let (mut frame, mut pose) = parents.remove(NOZZLE)?;
    // Each is taken once, so that a ring ends.
    while let Some((parent, from_parent)) = parents.remove(frame) {
        (frame, pose) = (parent, from_parent * pose);
    }
    Some(pose)
}
