//! One of the robots of a recording: its topics and frames.

use foxglove::messages::{
    CubePrimitive, FrameTransform, FrameTransforms, JointState, JointStates, LinePrimitive, Pose, PoseInFrame,
    SceneEntity, SceneUpdate, Timestamp, Vector3 as FoxgloveVector3, line_primitive,
};
use nalgebra::{Isometry3, Point3};

use super::messages::{point, quaternion, rgb, scene, vector};
use super::paint_traces::{PaintStyle, PaintTraces};
use super::recorder::{Recorder, RecordingError};

/// The robot at one moment of the flight.
#[derive(Debug, Clone, Copy)]
pub struct RobotState {
    /// Which robot, from 0.
    pub robot: usize,
    /// Seconds since the first take-off.
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

/// The channels of a robot, and the paint that it is spraying.
pub(super) struct RecordedRobot {
    /// Before the names of frames; nothing for the first robot.
    prefix: String,
    transforms: u16,
    pose: u16,
    joints: u16,
    spray: u16,
    traces: u16,
    paint: PaintTraces,
}

impl RecordedRobot {
    /// Opens the channels of a robot, from 0, and shows its body.
    pub(super) fn begin(
        recorder: &mut Recorder,
        robot: usize,
        time: f64,
        style: PaintStyle,
    ) -> Result<Self, RecordingError> {
        let prefix = if robot == 0 { String::new() } else { format!("robot_{}/", robot + 1) };
        let topic = |name: &str| format!("/{prefix}{name}");
        let own = Self {
            // Frames have names of their own, and viewers look for them here.
            transforms: recorder.channel::<FrameTransforms>("/tf")?,
            pose: recorder.channel::<PoseInFrame>(&topic("vehicle/pose"))?,
            joints: recorder.channel::<JointStates>(&topic("joint_states"))?,
            spray: recorder.channel::<SceneUpdate>(&topic("spray"))?,
            traces: recorder.channel::<SceneUpdate>(&topic("paint"))?,
            paint: PaintTraces::new(style),
            prefix,
        };
        recorder.write(own.spray, time, &robot_scene(own.named("body")))?;
        Ok(own)
    }

    /// Goes on with another paint.
    pub(super) fn change_paint(
        &mut self,
        recorder: &mut Recorder,
        time: f64,
        style: PaintStyle,
    ) -> Result<(), RecordingError> {
        self.paint.change(style).map_or(Ok(()), |trace| recorder.write(self.traces, time, &trace))
    }

    /// Writes where the robot is and what it sprays.
    pub(super) fn write(&mut self, recorder: &mut Recorder, state: &RobotState) -> Result<(), RecordingError> {
        let stamp = Some(Timestamp::saturating_from_epoch_secs_f64(state.time));
        let frame = |parent: String, child: &str, pose: &Isometry3<f64>| FrameTransform {
            timestamp: stamp,
            parent_frame_id: parent,
            child_frame_id: self.named(child),
            translation: Some(vector(pose)),
            rotation: Some(quaternion(pose)),
        };
        let frames = vec![
            frame("world".into(), "body", &state.world_from_body),
            frame(self.named("body"), "pan", &state.arm[0]),
            frame(self.named("pan"), "tilt", &state.arm[1]),
            frame(self.named("tilt"), "nozzle", &state.arm[2]),
        ];
        recorder.write(self.transforms, state.time, &FrameTransforms { transforms: frames })?;
        let body = Some(Pose {
            position: Some(vector(&state.world_from_body)),
            orientation: Some(quaternion(&state.world_from_body)),
        });
        recorder.write(
            self.pose,
            state.time,
            &PoseInFrame { timestamp: stamp, frame_id: "world".into(), pose: body },
        )?;
        let joint = |name: &str, position: f64| JointState {
            name: name.into(),
            position: Some(position),
            velocity: None,
            acceleration: None,
            effort: None,
        };
        let positions = vec![joint("pan", state.joints[0]), joint("tilt", state.joints[1]), joint("valve", state.flow)];
        recorder.write(self.joints, state.time, &JointStates { timestamp: stamp, joints: positions })?;
        recorder.write(self.spray, state.time, &spray_scene(state))?;
        match self.paint.push(state.time, state.hit, state.flow) {
            Some(trace) => recorder.write(self.traces, state.time, &trace),
            None => Ok(()),
        }
    }

    /// Takes the traces away: the finished picture takes their place.
    pub(super) fn finish(&self, recorder: &mut Recorder, time: f64) -> Result<(), RecordingError> {
        recorder.write(self.traces, time, &PaintTraces::clear())
    }

    fn named(&self, frame: &str) -> String {
        format!("{}{frame}", self.prefix)
    }
}

/// A box for the body that moves with its frame.
fn robot_scene(frame_id: String) -> SceneUpdate {
    let body = CubePrimitive {
        pose: None,
        size: Some(FoxgloveVector3 { x: 0.5, y: 0.5, z: 0.12 }),
        color: Some(rgb([230, 120, 30])),
    };
    scene(vec![SceneEntity {
        frame_id,
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
