//! A run as it goes, for viewers: pose, picture, tracking and the mesh where it changes, with Foxglove's schemas, over a WebSocket
//! and into a file.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use foxglove::messages::{
    CompressedImage, FrameTransform, FrameTransforms, LinePrimitive, Log, Pose, PoseInFrame, SceneEntity, SceneUpdate,
    Timestamp, TriangleListPrimitive, line_primitive,
};
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{Channel, Context, Encode, FoxgloveError, McapWriterHandle, PartialMetadata, RawChannel, Schema};
use image::codecs::jpeg::JpegEncoder;
use nalgebra::{Isometry3, Point3};
use serde::Serialize;
use tsdf_hash::mesh::{EmbeddedDeformation, IncrementalMesher, Mesh, PatchKey};
use tsdf_hash::tracking::TrackingOutcome;
use tsdf_hash::{ColourData, ColourView};

use super::error::ScanError;
use crate::recording::{log_message, point, quaternion, rgb, scene, vector};
use crate::say;
use crate::whole_file::WholeFile;

/// Frames between two pictures, and between two looks at what has changed of the mesh.
const PICTURE_EVERY: usize = 5;
const MESH_EVERY: usize = 10;
/// Poses that one line of the trajectory holds.
const LINE: usize = 64;
const JPEG_QUALITY: u8 = 80;

/// Who is told.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LiveSettings {
    /// Where viewers connect to.
    pub listen: Option<SocketAddr>,
    /// MCAP file that is written, or replaced.
    pub record: Option<PathBuf>,
}

/// Numbers of a frame.
#[derive(Serialize)]
struct Tracking {
    tracked: bool,
    overlap: f64,
    coverage: f64,
    agreement: f64,
    depth_scale: f64,
    intensity_scale: f64,
    degenerate_directions: usize,
}

const TRACKING_SCHEMA: &str = r#"{"type":"object","properties":{
"tracked":{"type":"boolean","description":"whether the pose is believed"},
"overlap":{"type":"number","description":"share of the map in view that was measured"},
"coverage":{"type":"number","description":"share of the frame that the map accounts for"},
"agreement":{"type":"number","description":"share of what is measured that agrees with the map"},
"depth_scale":{"type":"number","description":"residual of the distances, standard deviations of the noise model"},
"intensity_scale":{"type":"number","description":"residual of the intensities, grey levels of 255"},
"degenerate_directions":{"type":"integer","description":"directions of the pose that the frame does not fix"}}}"#;

/// What is told about a run.
pub(super) struct Live {
    transforms: Channel<FrameTransforms>,
    pose: Channel<PoseInFrame>,
    trajectory: Channel<SceneUpdate>,
    camera: Channel<CompressedImage>,
    map: Channel<SceneUpdate>,
    tracking: Arc<RawChannel>,
    log: Channel<Log>,
    /// A viewer came that has not seen what is there.
    newcomer: Arc<AtomicBool>,
    /// The trajectory in lines of so many poses: those that are complete are sent once.
    lines: Vec<Vec<Point3<f64>>>,
    lost: bool,
    /// A correction has bent the mesh that viewers see.
    bent: bool,
    frames: usize,
    /// Kept open as long as the run goes on.
    _context: Arc<Context>,
    recording: Option<McapWriterHandle<WholeFile>>,
}

/// Sees who subscribes.
struct Newcomers(Arc<AtomicBool>);

impl ServerListener for Newcomers {
    fn on_subscribe(&self, _: Client, _: ChannelView) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Live {
    /// Opens the door and the file; `None` if nobody is to be told.
    pub(super) fn open(settings: &LiveSettings) -> Result<Option<Self>, ScanError> {
        if *settings == LiveSettings::default() {
            return Ok(None);
        }
        let context = Context::new();
        let recording = match &settings.record {
            Some(path) => {
                let refuse = |why: String| ScanError::Unwritable { path: path.display().to_string(), why };
                let file = WholeFile::create(path).map_err(|e| refuse(e.to_string()))?;
                Some(context.mcap_writer().create(file).map_err(|e| refuse(e.to_string()))?)
            }
            None => None,
        };
        let newcomer = Arc::new(AtomicBool::new(false));
        if let Some(address) = settings.listen {
            let server = context
                .websocket_server()
                .name("scan")
                .bind(address.ip().to_string(), address.port())
                .listener(Arc::new(Newcomers(newcomer.clone())));
            let refuse = |source: FoxgloveError| ScanError::Listen { address, why: source.to_string() };
            let handle = server.start_blocking().map_err(refuse)?;
            // An address with port 0 asks for any.
            let address = SocketAddr::new(address.ip(), handle.port());
            say!("live view: ws://{address} (Foxglove: open connection, Foxglove WebSocket)");
        }
        Ok(Some(Self {
            transforms: channel(&context, "/tf"),
            pose: channel(&context, "/camera/pose"),
            trajectory: channel(&context, "/trajectory"),
            camera: channel(&context, "/camera/image"),
            map: channel(&context, "/map"),
            tracking: context
                .channel_builder("/tracking")
                .message_encoding("json")
                .schema(Schema::new("Tracking", "jsonschema", TRACKING_SCHEMA.as_bytes().to_vec()))
                .build_raw()
                .map_err(|e| ScanError::Recording(e.to_string()))?,
            log: channel(&context, "/log"),
            newcomer,
            lines: Vec::new(),
            lost: false,
            bent: false,
            frames: 0,
            _context: context,
            recording,
        }))
    }

    /// A frame was placed, and fused if frames are.
    pub(super) fn frame(
        &mut self,
        stamp: f64,
        world_from_camera: &Isometry3<f64>,
        colour: Option<&ColourView>,
        mesher: &mut IncrementalMesher,
    ) {
        let (time, meta) = (timestamp(stamp), at(stamp));
        let (position, orientation) = (vector(world_from_camera), quaternion(world_from_camera));
        let transform = FrameTransform {
            timestamp: Some(time),
            parent_frame_id: "world".into(),
            child_frame_id: "camera".into(),
            translation: Some(position),
            rotation: Some(orientation),
        };
        self.transforms.log_with_meta(&FrameTransforms { transforms: vec![transform] }, meta);
        let pose = Some(Pose { position: Some(position), orientation: Some(orientation) });
        self.pose.log_with_meta(&PoseInFrame { timestamp: Some(time), frame_id: "world".into(), pose }, meta);
        self.extend(Point3::from(world_from_camera.translation.vector));
        self.draw_line(stamp, self.lines.len() - 1);
        let picture = colour.filter(|_| self.frames.is_multiple_of(PICTURE_EVERY)).and_then(jpeg);
        if let Some(data) = picture {
            let (data, format) = (data.into(), "jpeg".into());
            let image = CompressedImage { timestamp: Some(time), frame_id: "camera".into(), data, format };
            self.camera.log_with_meta(&image, meta);
        }
        if self.newcomer.swap(false, Ordering::Relaxed) {
            (0..self.lines.len()).for_each(|n| self.draw_line(stamp, n));
            self.draw_patches(stamp, &mesher.patches(), mesher);
        } else if self.frames.is_multiple_of(MESH_EVERY) {
            self.mesh(stamp, mesher);
        }
        self.frames += 1;
    }

    /// What has changed of the mesh.
    fn mesh(&self, stamp: f64, mesher: &mut IncrementalMesher) {
        let changed = mesher.take_changed_patches();
        self.draw_patches(stamp, &changed, mesher);
    }

    /// The mesh is as it stays.
    pub(super) fn finished(&self, stamp: f64, mesher: &mut IncrementalMesher) {
        self.mesh(stamp, mesher);
        if self.bent {
            // What no frame that moved had seen is still shown bent.
            self.draw_patches(stamp, &mesher.patches(), mesher);
        }
    }

    /// Nothing more is told: the recording is whole.
    pub(super) fn close(self) -> Result<(), ScanError> {
        let Some(recording) = self.recording else { return Ok(()) };
        let file = recording.close().map_err(|e| ScanError::Recording(e.to_string()))?;
        file.commit().map_err(|e| ScanError::Recording(e.to_string()))
    }

    /// All frames have moved: the mesh is bent after them until the map has followed.
    pub(super) fn corrected(
        &mut self,
        stamp: f64,
        poses: &[Isometry3<f64>],
        deformation: &EmbeddedDeformation,
        mesher: &IncrementalMesher,
    ) {
        self.bent = true;
        for patch in mesher.patches() {
            let mut mesh = mesher.patch(patch);
            deformation.apply(&mut mesh);
            self.map.log_with_meta(&patch_scene(stamp, patch, mesh), at(stamp));
        }
        self.lines.clear();
        for pose in poses {
            self.extend(Point3::from(pose.translation.vector));
        }
        (0..self.lines.len()).for_each(|n| self.draw_line(stamp, n));
        self.say(stamp, "the trajectory and the map were corrected");
    }

    fn draw_patches(&self, stamp: f64, patches: &[PatchKey], mesher: &IncrementalMesher) {
        for patch in patches {
            self.map.log_with_meta(&patch_scene(stamp, *patch, mesher.patch(*patch)), at(stamp));
        }
    }

    /// How a frame was tracked, or not.
    pub(super) fn tracking(&mut self, stamp: f64, outcome: &TrackingOutcome) {
        match (self.lost, outcome.is_tracked()) {
            (false, false) => self.say(stamp, "the camera is lost"),
            (true, true) => self.say(stamp, "the camera is found again"),
            _ => {}
        }
        self.lost = !outcome.is_tracked();
        let numbers = Tracking {
            tracked: outcome.is_tracked(),
            overlap: outcome.overlap,
            coverage: outcome.coverage,
            agreement: outcome.agreement,
            depth_scale: outcome.depth_scale,
            intensity_scale: outcome.intensity_scale,
            degenerate_directions: outcome.degenerate.len(),
        };
        if let Ok(text) = serde_json::to_vec(&numbers) {
            self.tracking.log_with_meta(&text, at(stamp));
        }
    }

    /// A sentence: lost, found, corrected, left out.
    pub(super) fn say(&self, stamp: f64, text: &str) {
        let message = Log { name: "scan".into(), ..log_message(stamp, text) };
        self.log.log_with_meta(&message, at(stamp));
    }

    fn extend(&mut self, position: Point3<f64>) {
        match self.lines.last_mut() {
            Some(line) if line.len() < LINE => line.push(position),
            // The next line begins where this one ends.
            Some(line) => {
                let end = line.last().copied();
                self.lines.push(end.into_iter().chain([position]).collect());
            }
            None => self.lines.push(vec![position]),
        }
    }

    fn draw_line(&self, stamp: f64, number: usize) {
        let line = LinePrimitive {
            r#type: line_primitive::Type::LineStrip as i32,
            pose: None,
            thickness: 2.0,
            scale_invariant: true,
            points: self.lines[number].iter().map(|p| point(*p)).collect(),
            color: Some(rgb([30, 90, 220])),
            colors: Vec::new(),
            indices: Vec::new(),
        };
        let entity = SceneEntity { lines: vec![line], ..entity(stamp, format!("trajectory {number}")) };
        self.trajectory.log_with_meta(&scene(vec![entity]), at(stamp));
    }
}

fn channel<T: Encode>(context: &Arc<Context>, topic: &str) -> Channel<T> {
    context.channel_builder(topic).build()
}

fn timestamp(stamp: f64) -> Timestamp {
    Timestamp::saturating_from_epoch_secs_f64(stamp)
}

/// Stamps of the recording, not of the clock: the same run makes the same file.
fn at(stamp: f64) -> PartialMetadata {
    PartialMetadata { log_time: Some((stamp.max(0.0) * 1e9).round() as u64) }
}

/// Something in the world that takes the place of what had its name before.
fn entity(stamp: f64, id: String) -> SceneEntity {
    SceneEntity { timestamp: Some(timestamp(stamp)), frame_id: "world".into(), id, ..SceneEntity::default() }
}

/// A patch takes the place of what it was before.
fn patch_scene(stamp: f64, key: PatchKey, mesh: Mesh) -> SceneUpdate {
    let PatchKey([x, y, z]) = key;
    let triangles = TriangleListPrimitive {
        pose: None,
        points: mesh.positions.iter().map(|p| point(Point3::from(p.map(f64::from)))).collect(),
        color: None,
        colors: mesh.colours.iter().map(|colour| rgb(*colour)).collect(),
        indices: mesh.faces.into_flattened(),
    };
    let entity = SceneEntity { triangles: vec![triangles], ..entity(stamp, format!("patch {x} {y} {z}")) };
    scene(vec![entity])
}

/// `None` where the encoder refuses the size.
fn jpeg(colour: &ColourView) -> Option<Vec<u8>> {
    let rgb8: Vec<u8> = match colour.data {
        ColourData::Rgb8(data) => data.to_vec(),
        ColourData::Rgb16(data) => data.iter().map(|value| (value >> 8) as u8).collect(),
    };
    let (width, height) = (u32::try_from(colour.width).ok()?, u32::try_from(colour.height).ok()?);
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY)
        .encode(&rgb8, width, height, image::ExtendedColorType::Rgb8)
        .ok()?;
    Some(out)
}
