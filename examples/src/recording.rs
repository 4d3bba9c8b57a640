//! The mission as an MCAP file with Foxglove's well-known schemas: opens in Foxglove and Rerun as it is.

mod origin;
mod paint_traces;

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::Encode;
use foxglove::messages::{
    Color, CubePrimitive, FrameTransform, FrameTransforms, JointState, JointStates, LinePrimitive, Log, Pose,
    PoseInFrame, Quaternion, SceneEntity, SceneUpdate, Timestamp, TriangleListPrimitive, Vector3 as FoxgloveVector3,
    line_primitive, log,
};
use nalgebra::{Isometry3, Point3};

pub use origin::{Attachment, Origin};
pub use paint_traces::PaintStyle;
use paint_traces::PaintTraces;
pub(crate) use paint_traces::point;

use crate::whole_file::WholeFile;

/// The robot at one moment of the flight.
#[derive(Debug, Clone, Copy)]
pub struct RobotState {
    /// Seconds since take-off.
    pub time: f64,
    /// Pose of the body.
    pub world_from_body: Isometry3<f64>,
    /// Along the arm: pan in the body's frame, tilt in pan's, the nozzle in tilt's (x along the spray).
    pub arm: [Isometry3<f64>; 3],
    /// Pan and tilt, radians.
    pub joints: [f64; 2],
    /// Where the spray axis meets the surface.
    pub hit: Option<Point3<f64>>,
    /// Paint flow, m³/s.
    pub flow: f64,
}

/// A mesh with one sRGB colour per vertex when it is painted, and one for all before.
pub struct ColouredMesh<'a> {
    /// Vertices, metres.
    pub positions: &'a [[f32; 3]],
    /// Triangles.
    pub faces: &'a [[u32; 3]],
    /// Colours in the end.
    pub colours: &'a [[u8; 3]],
    /// Colour of all of it in the beginning.
    pub bare: [u8; 3],
}

/// What is wrong with writing a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file could not be created.
    #[error("{path}: cannot be written ({source}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Encoding or writing a message failed.
    #[error("the recording could not be written: {0}")]
    Encoding(String),
}

/// Writes the recording, with each paint from its time on: the bare mesh first, then robot, spray and log as they come with the paint as traces, the painted mesh
/// in the end.
pub fn save_recording(
    path: &Path,
    mesh: &ColouredMesh,
    paints: &[(f64, PaintStyle)],
    states: &[RobotState],
    log_lines: &[(f64, String)],
    origin: &Origin,
) -> Result<(), RecordingError> {
    let mut recorder = Recorder::create(path)?;
    recorder.describe(origin)?;
    let transforms = recorder.channel::<FrameTransforms>("/tf")?;
    let pose = recorder.channel::<PoseInFrame>("/vehicle/pose")?;
    let joints = recorder.channel::<JointStates>("/joint_states")?;
    let surface = recorder.channel::<SceneUpdate>("/surface")?;
    let spray = recorder.channel::<SceneUpdate>("/spray")?;
    let traces = recorder.channel::<SceneUpdate>("/paint")?;
    let text = recorder.channel::<Log>("/log")?;

    let start = states.first().map_or(0.0, |m| m.time);
    recorder.write(surface, start, &mesh_scene(mesh, None))?;
    recorder.write(spray, start, &robot_scene())?;
    let mut log_lines = log_lines.iter().peekable();
    let mut paints = paints.iter().peekable();
    let Some((_, style)) = paints.next() else {
        return Err(RecordingError::Encoding("no paint is told of".into()));
    };
    let mut paint = PaintTraces::new(*style);
    for state in states {
        while let Some((_, style)) = paints.next_if(|(from, _)| *from <= state.time) {
            if let Some(trace) = paint.change(*style) {
                recorder.write(traces, state.time, &trace)?;
            }
        }
        while let Some((time, message)) = log_lines.next_if(|(time, _)| *time <= state.time) {
            recorder.write(text, *time, &log_message(*time, message))?;
        }
        let stamp = Some(Timestamp::saturating_from_epoch_secs_f64(state.time));
        let frame = |parent: &str, child: &str, pose: &Isometry3<f64>| FrameTransform {
            timestamp: stamp,
            parent_frame_id: parent.into(),
            child_frame_id: child.into(),
            translation: Some(vector(pose)),
            rotation: Some(quaternion(pose)),
        };
        let frames = vec![
            frame("world", "body", &state.world_from_body),
            frame("body", "pan", &state.arm[0]),
            frame("pan", "tilt", &state.arm[1]),
            frame("tilt", "nozzle", &state.arm[2]),
        ];
        recorder.write(transforms, state.time, &FrameTransforms { transforms: frames })?;
        let body = Some(Pose {
            position: Some(vector(&state.world_from_body)),
            orientation: Some(quaternion(&state.world_from_body)),
        });
        recorder.write(pose, state.time, &PoseInFrame { timestamp: stamp, frame_id: "world".into(), pose: body })?;
        let joint = |name: &str, position: f64| JointState {
            name: name.into(),
            position: Some(position),
            velocity: None,
            acceleration: None,
            effort: None,
        };
        let states = vec![joint("pan", state.joints[0]), joint("tilt", state.joints[1]), joint("valve", state.flow)];
        recorder.write(joints, state.time, &JointStates { timestamp: stamp, joints: states })?;
        recorder.write(spray, state.time, &spray_scene(state))?;
        if let Some(trace) = paint.push(state.time, state.hit, state.flow) {
            recorder.write(traces, state.time, &trace)?;
        }
    }
    let end = states.last().map_or(start, |state| state.time);
    recorder.write(traces, end, &PaintTraces::clear())?;
    recorder.write(surface, end, &mesh_scene(mesh, Some(mesh.colours)))?;
    recorder.finish()
}

/// Writes messages with Foxglove's schemas, time stamps in seconds.
pub(crate) struct Recorder {
    writer: mcap::Writer<WholeFile>,
    sequence: u32,
}

impl Recorder {
    pub(crate) fn create(path: &Path) -> Result<Self, RecordingError> {
        Self::new(path, WholeFile::create(path))
    }

    /// For what cannot be made again: as much of it as [`Recorder::flush`] has seen stays, whatever happens.
    #[cfg(feature = "vr")]
    pub(crate) fn create_kept(path: &Path) -> Result<Self, RecordingError> {
        Self::new(path, WholeFile::create_kept(path))
    }

    fn new(path: &Path, file: std::io::Result<WholeFile>) -> Result<Self, RecordingError> {
        let file = file.map_err(|source| RecordingError::Unwritable { path: path.display().to_string(), source })?;
        let options = mcap::WriteOptions::new().compression(None).library("paintcopter");
        Ok(Self { writer: options.create(file).map_err(failed)?, sequence: 0 })
    }

    /// Writes the index; then the file has its name.
    pub(crate) fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map_err(failed)?;
        self.writer.into_inner().commit().map_err(failed)
    }

    /// Metadata and attachments.
    pub(crate) fn describe(&mut self, origin: &Origin) -> Result<(), RecordingError> {
        self.writer.write_metadata(&origin.metadata()).map_err(failed)?;
        for Attachment { name, media_type, data } in &origin.attachments {
            // Without times: the same mission gives the same bytes.
            let (name, media_type) = ((*name).into(), (*media_type).into());
            let file = mcap::Attachment { log_time: 0, create_time: 0, name, media_type, data: data.into() };
            self.writer.attach(&file).map_err(failed)?;
        }
        Ok(())
    }

    /// What was written so far can be read, even if nothing more comes.
    #[cfg(feature = "vr")]
    pub(crate) fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(failed)
    }

    pub(crate) fn channel<T: Encode>(&mut self, topic: &str) -> Result<u16, RecordingError> {
        let schema = match T::get_schema() {
            Some(s) => self.writer.add_schema(&s.name, &s.encoding, &s.data).map_err(failed)?,
            None => 0,
        };
        self.writer.add_channel(schema, topic, &T::get_message_encoding(), &BTreeMap::new()).map_err(failed)
    }

    /// A channel of JSON messages of our own, with the schema that describes them.
    #[cfg(feature = "vr")]
    pub(crate) fn json_channel(&mut self, topic: &str, name: &str, schema: &str) -> Result<u16, RecordingError> {
        let schema = self.writer.add_schema(name, "jsonschema", schema.as_bytes()).map_err(failed)?;
        self.writer.add_channel(schema, topic, "json", &BTreeMap::new()).map_err(failed)
    }

    #[cfg(feature = "vr")]
    pub(crate) fn write_json(
        &mut self,
        channel_id: u16,
        time: f64,
        message: &impl serde::Serialize,
    ) -> Result<(), RecordingError> {
        self.write_bytes(channel_id, nanoseconds(time), &serde_json::to_vec(message).map_err(failed)?)
    }

    pub(crate) fn write<T: Encode>(&mut self, channel_id: u16, time: f64, message: &T) -> Result<(), RecordingError> {
        let mut data = Vec::with_capacity(message.encoded_len().unwrap_or(256));
        message.encode(&mut data).map_err(failed)?;
        self.write_bytes(channel_id, nanoseconds(time), &data)
    }

    /// A message that is encoded already, `log_time` in nanoseconds.
    pub(crate) fn write_bytes(&mut self, channel_id: u16, log_time: u64, data: &[u8]) -> Result<(), RecordingError> {
        self.sequence += 1;
        let header =
            mcap::records::MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, data).map_err(failed)
    }
}

fn nanoseconds(time: f64) -> u64 {
    (time.max(0.0) * 1e9).round() as u64
}

fn failed(error: impl std::fmt::Display) -> RecordingError {
    RecordingError::Encoding(error.to_string())
}

pub(crate) fn vector(pose: &Isometry3<f64>) -> FoxgloveVector3 {
    let t = pose.translation.vector;
    FoxgloveVector3 { x: t.x, y: t.y, z: t.z }
}

pub(crate) fn quaternion(pose: &Isometry3<f64>) -> Quaternion {
    let q = pose.rotation.quaternion();
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

pub(crate) fn rgb([r, g, b]: [u8; 3]) -> Color {
    Color { r: f64::from(r) / 255.0, g: f64::from(g) / 255.0, b: f64::from(b) / 255.0, a: 1.0 }
}

pub(crate) fn scene(entities: Vec<SceneEntity>) -> SceneUpdate {
    SceneUpdate { deletions: Vec::new(), entities }
}

/// The mesh in the colours of its vertices, or bare.
pub(crate) fn mesh_scene(mesh: &ColouredMesh, colours: Option<&[[u8; 3]]>) -> SceneUpdate {
    let triangles = TriangleListPrimitive {
        pose: None,
        points: mesh.positions.iter().map(|p| point(p.map(f64::from))).collect(),
        color: colours.is_none().then(|| rgb(mesh.bare)),
        colors: colours.unwrap_or_default().iter().map(|&c| rgb(c)).collect(),
        indices: mesh.faces.iter().flatten().copied().collect(),
    };
    scene(vec![SceneEntity {
        frame_id: "world".into(),
        id: "surface".into(),
        triangles: vec![triangles],
        ..SceneEntity::default()
    }])
}

/// A box for the body that moves with its frame.
fn robot_scene() -> SceneUpdate {
    let body = CubePrimitive {
        pose: None,
        size: Some(FoxgloveVector3 { x: 0.5, y: 0.5, z: 0.12 }),
        color: Some(rgb([230, 120, 30])),
    };
    scene(vec![SceneEntity {
        frame_id: "body".into(),
        id: "robot".into(),
        frame_locked: true,
        cubes: vec![body],
        ..SceneEntity::default()
    }])
}

/// The arm from body to nozzle, and the spray ray: blue while the valve is open.
fn spray_scene(state: &RobotState) -> SceneUpdate {
    let tip = Point3::from((state.world_from_body * state.arm[0] * state.arm[1] * state.arm[2]).translation.vector);
    let end = state.hit.unwrap_or(tip);
    let body = Point3::from(state.world_from_body.translation.vector);
    let line = |a: Point3<f64>, b: Point3<f64>, thickness: f64, colour: [u8; 3]| LinePrimitive {
        r#type: line_primitive::Type::LineStrip as i32,
        pose: None,
        thickness,
        scale_invariant: false,
        points: vec![point(a), point(b)],
        color: Some(rgb(colour)),
        colors: Vec::new(),
        indices: Vec::new(),
    };
    let ray = if state.flow > 0.0 { [30, 90, 220] } else { [170, 170, 170] };
    scene(vec![SceneEntity {
        timestamp: Some(Timestamp::saturating_from_epoch_secs_f64(state.time)),
        frame_id: "world".into(),
        id: "spray".into(),
        lines: vec![line(body, tip, 0.03, [60, 60, 60]), line(tip, end, 0.01, ray)],
        ..SceneEntity::default()
    }])
}

pub(crate) fn log_message(time: f64, message: &str) -> Log {
    Log {
        timestamp: Some(Timestamp::saturating_from_epoch_secs_f64(time)),
        level: log::Level::Info as i32,
        message: message.into(),
        name: "paintcopter".into(),
        file: String::new(),
        line: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foxglove::Decode as _;

    #[test]
    fn the_recording_reads_back() {
        let path = std::env::temp_dir().join(format!("paintcopter-recording-{}.mcap", std::process::id()));
        let moment = |time: f64| RobotState {
            time,
            world_from_body: Isometry3::translation(1.0, 2.0, 3.0),
            arm: [Isometry3::translation(0.5, 0.0, 0.0), Isometry3::identity(), Isometry3::identity()],
            joints: [0.1, -0.2],
            hit: Some(Point3::new(1.6, 2.0, 3.0)),
            flow: 1e-7,
        };
        let mesh = ColouredMesh {
            positions: &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            faces: &[[0, 1, 2]],
            colours: &[[255, 0, 0]; 3],
            bare: [200, 180, 150],
        };
        let paint = PaintStyle { width: 0.05, max_flow: 2e-7, colour: [40, 30, 20] };
        // The valve is shut at the fourth of five moments.
        let flow = |k: i32| if k == 3 { 0.0 } else { 1e-7 };
        let states: Vec<RobotState> =
            (0..5).map(|k| RobotState { flow: flow(k), ..moment(f64::from(k) * 0.5) }).collect();
        let urdf = Attachment { name: "robot.urdf", media_type: "application/xml", data: b"<robot/>".to_vec() };
        let origin = Origin { seed: Some(7), attachments: vec![urdf] };
        let log = [(0.0, "take-off".into()), (1.0, "layer 1".into())];
        save_recording(&path, &mesh, &[(0.0, paint)], &states, &log, &origin).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(metadata.metadata["seed"], "7");
        let attached = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
        assert_eq!((attached.name.as_str(), &attached.data[..]), ("robot.urdf", &b"<robot/>"[..]));
        let mut count = BTreeMap::new();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            let schema = message.channel.schema.as_ref().unwrap().name.clone();
            assert!(schema.starts_with("foxglove."), "{schema}");
            *count.entry(message.channel.topic.clone()).or_insert(0) += 1;
        }
        let expected = [
            ("/joint_states", 5),
            ("/log", 2),
            ("/paint", 2),
            ("/spray", 6),
            ("/surface", 2),
            ("/tf", 5),
            ("/vehicle/pose", 5),
        ];
        assert_eq!(count, expected.map(|(t, n)| (t.to_string(), n)).into());
        // One trace of three points, half transparent, then its removal.
        let of = |topic: &str| -> Vec<SceneUpdate> {
            let stream = mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap());
            stream.filter(|m| m.channel.topic == topic).map(|m| SceneUpdate::decode(&*m.data).unwrap()).collect()
        };
        let (traces, surfaces) = (of("/paint"), of("/surface"));
        let line = &traces[0].entities[0].lines[0];
        assert_eq!((line.points.len(), line.colors.len(), line.colors[0].a), (3, 3, 0.5));
        assert!(traces[1].entities.is_empty() && traces[1].deletions.len() == 1);
        let coloured: Vec<usize> = surfaces.iter().map(|s| s.entities[0].triangles[0].colors.len()).collect();
        assert_eq!(coloured, [0, 3]);
    }
}
