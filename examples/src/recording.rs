//! The mission as an MCAP file with Foxglove's well-known schemas: opens in Foxglove and Rerun as it is.

mod messages;
mod origin;
mod paint_traces;
mod recorded_robot;
mod recorder;

use std::path::Path;

use foxglove::messages::{Log, SceneEntity, SceneUpdate, Timestamp, TriangleListPrimitive, log};

pub(crate) use messages::{point, rgb, scene};
#[cfg(any(feature = "handheld", feature = "scan", feature = "vr"))]
pub(crate) use messages::{quaternion, vector};
pub use origin::{Attachment, Origin};
pub use paint_traces::PaintStyle;
use recorded_robot::RecordedRobot;
pub use recorded_robot::RobotState;
pub(crate) use recorder::Recorder;
pub use recorder::RecordingError;

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

/// Writes the recording, with each paint from its time on: the bare mesh first, then robots, sprays and log as they come with the paint as traces, the
/// painted mesh in the end. States and log are sorted by time. Topics and frames of robots after the first begin with `robot_2` and so on.
pub fn save_recording(
    path: &Path,
    mesh: &ColouredMesh,
    paints: &[(f64, PaintStyle)],
    states: &mut [RobotState],
    log_lines: &mut [(f64, String)],
    origin: &Origin,
) -> Result<(), RecordingError> {
    let mut recorder = Recorder::create(path)?;
    recorder.describe(origin)?;
    let surface = recorder.channel::<SceneUpdate>("/surface")?;
    let text = recorder.channel::<Log>("/log")?;
    let mut paints = paints.iter().peekable();
    let Some((_, style)) = paints.next() else {
        return Err(RecordingError::Encoding("no paint is told of".into()));
    };
    states.sort_by(|a, b| a.time.total_cmp(&b.time));
    log_lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    let start = states.first().map_or(0.0, |m| m.time);
    recorder.write(surface, start, &mesh_scene(mesh, None))?;
    let count = states.iter().map(|state| state.robot + 1).max().unwrap_or(1);
    let mut robots = Vec::with_capacity(count);
    for robot in 0..count {
        robots.push(RecordedRobot::begin(&mut recorder, robot, start, *style)?);
    }
    let mut log_lines = log_lines.iter().peekable();
    for state in &*states {
        while let Some((_, style)) = paints.next_if(|(from, _)| *from <= state.time) {
            for robot in &mut robots {
                robot.change_paint(&mut recorder, state.time, *style)?;
            }
        }
        while let Some((time, message)) = log_lines.next_if(|(time, _)| *time <= state.time) {
            recorder.write(text, *time, &log_message(*time, message))?;
        }
        robots[state.robot].write(&mut recorder, state)?;
    }
    let end = states.last().map_or(start, |state| state.time);
    for robot in &robots {
        robot.finish(&mut recorder, end)?;
    }
    recorder.write(surface, end, &mesh_scene(mesh, Some(mesh.colours)))?;
    recorder.finish()
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
    use std::collections::BTreeMap;

    use foxglove::Decode as _;
    use foxglove::messages::FrameTransforms;
    use nalgebra::{Isometry3, Point3};

    use super::*;

    /// The second robot's states come last: they are sorted, with topics and frames of their own.
    #[test]
    fn several_robots_have_topics_and_frames_of_their_own() {
        let path = std::env::temp_dir().join(format!("paintcopter-robots-{}.mcap", std::process::id()));
        let state = |robot: usize, time: f64| RobotState {
            robot,
            time,
            world_from_body: Isometry3::translation(robot as f64, 0.0, 1.0),
            arm: [Isometry3::identity(); 3],
            joints: [0.0; 2],
            hit: None,
            flow: 0.0,
        };
        let mut states = [state(0, 0.0), state(0, 1.0), state(0, 2.0), state(1, 0.5), state(1, 1.5)];
        let mesh = ColouredMesh { positions: &[[0.0; 3]; 3], faces: &[], colours: &[[0; 3]; 3], bare: [0; 3] };
        let paint = PaintStyle { width: 0.05, max_flow: 2e-7, colour: [40, 30, 20] };
        save_recording(&path, &mesh, &[(0.0, paint)], &mut states, &mut [], &Origin::default()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let (mut count, mut bodies, mut last) = (BTreeMap::new(), Vec::new(), 0);
        for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
            assert!(message.log_time >= last, "{}", message.log_time);
            last = message.log_time;
            *count.entry(message.channel.topic.clone()).or_insert(0) += 1;
            if message.channel.topic == "/tf" {
                let body = FrameTransforms::decode(&*message.data).unwrap().transforms[0].clone();
                bodies.push((body.child_frame_id, body.translation.unwrap().x));
            }
        }
        assert_eq!((count["/vehicle/pose"], count["/robot_2/vehicle/pose"], count["/tf"]), (3, 2, 5));
        let expected = [("body", 0.0), ("robot_2/body", 1.0), ("body", 0.0), ("robot_2/body", 1.0), ("body", 0.0)];
        assert_eq!(bodies, expected.map(|(name, x)| (name.to_string(), x)));
    }

    #[test]
    fn the_recording_reads_back() {
        let path = std::env::temp_dir().join(format!("paintcopter-recording-{}.mcap", std::process::id()));
        let moment = |time: f64| RobotState {
            robot: 0,
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
        let mut states: Vec<RobotState> =
            (0..5).map(|k| RobotState { flow: flow(k), ..moment(f64::from(k) * 0.5) }).collect();
        let urdf = Attachment { name: "robot.urdf", media_type: "application/xml", data: b"<robot/>".to_vec() };
        let origin = Origin { seed: Some(7), attachments: vec![urdf] };
        let mut log = [(0.0, "take-off".into()), (1.0, "layer 1".into())];
        save_recording(&path, &mesh, &[(0.0, paint)], &mut states, &mut log, &origin).unwrap();
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
