//! A painting as an MCAP file with Foxglove's schemas; its poses can be replayed with `--motion`.

use std::path::Path;

use foxglove::messages::{
    FrameTransform, FrameTransforms, JointState, JointStates, LinePrimitive, Log, Pose, PoseInFrame, SceneEntity,
    SceneUpdate, Timestamp, line_primitive,
};
use nalgebra::{Isometry3, Point3};
use paint_sim::droplets::GantryGeometry;

use super::error::HandheldError;
use super::object::PaintObject;
use super::painting::{PaintingLog, Tick};
use crate::recording::{ColouredMesh, Recorder, log_message, mesh_scene, point, quaternion, rgb, scene, vector};

/// Colour of the bare object and of the paint.
const BARE: [u8; 3] = [225, 225, 225];
const PAINT: [f64; 3] = [30.0, 60.0, 150.0];

/// Writes robot, nozzle, spray and log as they came, the bare object first and the painted one at the end.
pub(super) fn save(
    object: &PaintObject,
    geometry: &GantryGeometry,
    log: &PaintingLog,
    path: &Path,
) -> Result<(), HandheldError> {
    let mut recorder = Recorder::create(path)?;
    let pose = recorder.channel::<PoseInFrame>("/robot/pose")?;
    let transforms = recorder.channel::<FrameTransforms>("/tf")?;
    let joints = recorder.channel::<JointStates>("/joint_states")?;
    let surface = recorder.channel::<SceneUpdate>("/surface")?;
    let spray = recorder.channel::<SceneUpdate>("/spray")?;
    let text = recorder.channel::<Log>("/log")?;

    let positions: Vec<[f32; 3]> = object.chart.disk().positions().iter().map(|p| p.map(|c| c as f32)).collect();
    let colours = vertex_colours(object, log);
    let mesh =
        ColouredMesh { positions: &positions, faces: object.chart.disk().faces(), colours: &colours, bare: BARE };
    recorder.write(surface, 0.0, &mesh_scene(&mesh, None))?;
    let mut messages = log.messages.iter().peekable();
    for tick in &log.ticks {
        while let Some((time, message)) = messages.next_if(|(time, _)| *time <= tick.time) {
            recorder.write(text, *time, &log_message(*time, message))?;
        }
        let stamp = Some(Timestamp::saturating_from_epoch_secs_f64(tick.time));
        let robot = &tick.world_from_robot;
        let posed = Some(Pose { position: Some(vector(robot)), orientation: Some(quaternion(robot)) });
        recorder.write(pose, tick.time, &PoseInFrame { timestamp: stamp, frame_id: "world".into(), pose: posed })?;
        let zero = geometry.robot_from_zero;
        let nozzle = Isometry3::translation(zero.x, zero.y, zero.z + tick.position);
        let frame = |parent: &str, child: &str, pose: &Isometry3<f64>| FrameTransform {
            timestamp: stamp,
            parent_frame_id: parent.into(),
            child_frame_id: child.into(),
            translation: Some(vector(pose)),
            rotation: Some(quaternion(pose)),
        };
        let frames = vec![frame("world", "robot", robot), frame("robot", "nozzle", &nozzle)];
        recorder.write(transforms, tick.time, &FrameTransforms { transforms: frames })?;
        let slide = JointState {
            name: "slide".into(),
            position: Some(tick.position),
            velocity: None,
            acceleration: None,
            effort: None,
        };
        recorder.write(joints, tick.time, &JointStates { timestamp: stamp, joints: vec![slide] })?;
        recorder.write(spray, tick.time, &spray_scene(tick, &Point3::from((robot * nozzle).translation.vector)))?;
    }
    for (time, message) in messages {
        recorder.write(text, *time, &log_message(*time, message))?;
    }
    recorder.write(surface, log.duration(), &mesh_scene(&mesh, Some(&colours)))?;
    Ok(recorder.finish()?)
}

/// The spray ray: blue while paint flies.
fn spray_scene(tick: &Tick, tip: &Point3<f64>) -> SceneUpdate {
    let end = tick.hit.unwrap_or(*tip);
    let ray = LinePrimitive {
        r#type: line_primitive::Type::LineStrip as i32,
        pose: None,
        thickness: 1e-3,
        scale_invariant: false,
        points: vec![point(*tip), point(end)],
        color: Some(rgb(if tick.open > 0.0 { [30, 90, 220] } else { [170, 170, 170] })),
        colors: Vec::new(),
        indices: Vec::new(),
    };
    scene(vec![SceneEntity {
        timestamp: Some(Timestamp::saturating_from_epoch_secs_f64(tick.time)),
        frame_id: "world".into(),
        id: "spray".into(),
        lines: vec![ray],
        ..SceneEntity::default()
    }])
}

/// Colours of the vertices by the texels that they lie in. Meshes with few vertices show little of the paint: the textures show all.
fn vertex_colours(object: &PaintObject, log: &PaintingLog) -> Vec<[u8; 3]> {
    let coverage = &log.truth;
    let full = coverage.full_thickness();
    let share = |uv: [f64; 2]| {
        let [column, row] = object.texels.texel_of_uv(uv)?;
        let texel = row * object.texels.width + column;
        let area = object.texels.area_m2[texel];
        (area > 0.0).then(|| coverage.current()[texel] as f64 * paint_sim::spray::QUANTUM / (area * full))
    };
    let colour = |share: f64| [0, 1, 2].map(|k| (f64::from(BARE[k]) + (PAINT[k] - f64::from(BARE[k])) * share) as u8);
    object.chart.uv().iter().map(|uv| colour(share(*uv).unwrap_or(0.0).clamp(0.0, 1.0))).collect()
}
