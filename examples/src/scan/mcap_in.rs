//! RGB-D recordings as MCAP: the images, cameras and transforms of ROS 2 or of Foxglove.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use foxglove::Decode;
use foxglove::messages::{CameraCalibration, FrameTransform, FrameTransforms};
use mcap::Message;
use nalgebra::Isometry3;
use tsdf_hash::Intrinsics;
use vio_ekf::{Stamp, Trajectory};

use super::decode::is_depth;
use super::error::SequenceError;
use super::image_source::{ImageSource, ImageTopic, reason};
use super::pairing::{NEAREST, nearest};
use super::sequence::{ColourCamera, FrameFiles, Sequence};
use crate::mcap_messages::fields::{isometry, isometry_of, stamp};
use crate::mcap_messages::images::{SCHEMAS, image, image_header};
use crate::mcap_messages::{cdr, messages_of, schema_of};
use crate::say;

/// Frames between a camera and the world; more make a circle.
const DEEPEST: usize = 32;

/// Opens a recording: one pass over everything, in which only the first image of a topic is looked at.
///
/// The first topic with depth images is taken, and the first with others as its colour. The pose of a frame is that of the depth camera's
/// frame in the world that the transforms lead to, if one of them is not static.
///
/// # Errors
/// [`SequenceError`] names what the file lacks.
pub(super) fn open_mcap(path: &Path) -> Result<Sequence, SequenceError> {
    let malformed = |why: String| SequenceError::malformed(path, 0, why);
    let mut found = Found::default();
    let messages = messages_of(path).map_err(|why| SequenceError::unreadable(path, &reason(why)))?;
    for message in messages {
        found.take(&message.map_err(|why| malformed(reason(why)))?).map_err(malformed)?;
    }
    let Found { topics, cameras, transforms } = found;
    let (depths, pictures): (Vec<_>, Vec<_>) = topics.into_iter().partition(|topic| topic.is_depth);
    let Some(depth) = depths.first() else {
        return Err(malformed(
            "no topic with depth images: expected sensor_msgs/msg/Image or foxglove.RawImage of 16UC1, mono16 or 32FC1, or \
             compressed images that hold a PNG of 16 bits"
                .into(),
        ));
    };
    depths[1..].iter().chain(pictures.get(1..).unwrap_or_default()).for_each(|unused| {
        say!("{}: topic {} is not used", path.display(), unused.name);
    });
    let Some(camera) = camera_of(&cameras, depth) else {
        return Err(malformed(format!(
            "no sensor_msgs/msg/CameraInfo or foxglove.CameraCalibration of the frame `{}`, that of topic {}",
            depth.frame, depth.name
        )));
    };
    if camera.distorted {
        eprintln!(
            "warning: {}: the images of {} are distorted, which is not corrected: record rectified ones",
            path.display(),
            depth.name
        );
    }
    let mut colour = pictures.first();
    let colour_camera = match colour {
        Some(picture) if picture.frame != depth.frame => {
            let place = transforms.still(&picture.frame, &depth.frame);
            if place.is_none() {
                eprintln!(
                    "warning: {}: no transform joins the frames `{}` and `{}`: colour is left out; --depth-from-colour says where the \
                     colour camera stands",
                    path.display(),
                    picture.frame,
                    depth.frame
                );
                colour = None;
            }
            let intrinsics = camera_of(&cameras, picture).map(|camera| camera.intrinsics);
            place.map(|depth_from_colour| ColourCamera { depth_from_colour, intrinsics })
        }
        _ => None,
    };
    let opened = |topic: &Topic| Arc::new(ImageTopic::new(path, &topic.name));
    let (depth_images, colour_images) = (opened(depth), colour.map(opened));
    let colour_stamps: Vec<f64> = colour.map_or_else(Vec::new, |c| c.stamps.iter().map(|s| s.as_secs()).collect());
    let mut frames: Vec<FrameFiles> = Vec::with_capacity(depth.stamps.len());
    let mut unordered = 0;
    for (index, stamp) in depth.stamps.iter().enumerate() {
        if frames.last().is_some_and(|last| stamp.as_secs() <= last.stamp) {
            unordered += 1;
            continue;
        }
        let paired = nearest(&colour_stamps, stamp.as_secs(), NEAREST);
        frames.push(FrameFiles {
            stamp: stamp.as_secs(),
            depth: ImageSource::Message { topic: Arc::clone(&depth_images), index },
            colour: colour_images
                .as_ref()
                .zip(paired)
                .map(|(topic, index)| ImageSource::Message { topic: Arc::clone(topic), index }),
            world_from_camera: transforms.world_from(&depth.frame, *stamp),
            lost: false,
        });
    }
    if unordered > 0 {
        eprintln!(
            "warning: {}: {unordered} depth images do not come later than the one before: left out",
            path.display()
        );
    }
    Ok(Sequence {
        layout: "MCAP",
        intrinsics: camera.intrinsics,
        camera_origin: format!("topic {}", camera.topic),
        image_size: camera.size,
        depth_scale: 1000.0,
        scale_origin: format!(
            "topic {}: 16 bits are millimetres, as REP 118 has it; floating point is metres",
            depth.name
        ),
        colour_camera,
        angular_rates: Vec::new(),
        frames,
    })
}

/// Images of one topic.
struct Topic {
    name: String,
    frame: String,
    is_depth: bool,
    stamps: Vec<Stamp>,
}

struct Camera {
    topic: String,
    frame: String,
    intrinsics: Intrinsics,
    size: Option<[usize; 2]>,
    distorted: bool,
}

/// That of the same frame; of several, the one whose topic begins most alike. The only one needs no name.
fn camera_of<'a>(cameras: &'a [Camera], images: &Topic) -> Option<&'a Camera> {
    let alike = |camera: &&Camera| camera.topic.bytes().zip(images.name.bytes()).take_while(|(a, b)| a == b).count();
    let same = cameras.iter().filter(|camera| camera.frame == images.frame);
    same.max_by_key(alike).or(cameras.first().filter(|_| cameras.len() == 1))
}

#[derive(Default)]
struct Found {
    topics: Vec<Topic>,
    cameras: Vec<Camera>,
    transforms: Transforms,
}

impl Found {
    fn take(&mut self, message: &Message) -> Result<(), String> {
        let (topic, data, name) = (&message.channel.topic, message.data.as_ref(), schema_of(message));
        let bad = || format!("topic {topic}: a {name} that cannot be decoded");
        match name {
            _ if SCHEMAS.contains(&name) => {
                let (stamp, frame) = image_header(name, data).ok_or_else(bad)?;
                if let Some(known) = self.topics.iter_mut().find(|known| known.name == *topic) {
                    known.stamps.push(stamp);
                } else {
                    let is_depth = image(message).is_some_and(|(_, data)| is_depth(&data));
                    self.topics.push(Topic { name: topic.clone(), frame, is_depth, stamps: vec![stamp] });
                }
            }
            "sensor_msgs/msg/CameraInfo" if self.is_new(topic) => {
                let info: cdr::CameraInfo = cdr::decode(data).ok_or_else(bad)?;
                let size = [info.width, info.height];
                self.add_camera(topic, info.header.frame_id, size, &info.k, &info.d).ok_or_else(bad)?;
            }
            "foxglove.CameraCalibration" if self.is_new(topic) => {
                let camera = CameraCalibration::decode(data).map_err(|_| bad())?;
                let size = [camera.width, camera.height];
                self.add_camera(topic, camera.frame_id, size, &camera.k, &camera.d).ok_or_else(bad)?;
            }
            "foxglove.FrameTransform" => {
                self.transforms.foxglove(FrameTransform::decode(data).map_err(|_| bad())?).ok_or_else(bad)?;
            }
            "foxglove.FrameTransforms" => {
                for transform in FrameTransforms::decode(data).map_err(|_| bad())?.transforms {
                    self.transforms.foxglove(transform).ok_or_else(bad)?;
                }
            }
            "tf2_msgs/msg/TFMessage" => {
                let transforms: Vec<cdr::TransformStamped> = cdr::decode(data).ok_or_else(bad)?;
                for t in transforms {
                    let pose = isometry_of(t.translation, t.rotation).ok_or_else(bad)?;
                    let stamp = t.header.stamp();
                    self.transforms.add(t.header.frame_id, t.child_frame_id, stamp, pose);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// A camera is believed to stay as its first message says.
    fn is_new(&self, topic: &str) -> bool {
        self.cameras.iter().all(|camera| camera.topic != topic)
    }

    fn add_camera(&mut self, topic: &str, frame: String, size: [u32; 2], k: &[f64], d: &[f64]) -> Option<()> {
        let &[fx, _, cx, _, fy, cy, ..] = k else { return None };
        let size = (size[0] > 0 && size[1] > 0).then_some(size.map(|side| side as usize));
        let (intrinsics, distorted) = (Intrinsics { fx, fy, cx, cy }, d.iter().any(|d| *d != 0.0));
        self.cameras.push(Camera { topic: topic.into(), frame, intrinsics, size, distorted });
        Some(())
    }
}

/// A tree of frames, by their children.
#[derive(Default)]
struct Transforms(BTreeMap<String, Joint>);

/// `parent_from_child` over time.
struct Joint {
    parent: String,
    poses: Trajectory,
    /// Whether it is not always the same.
    moves: bool,
}

impl Transforms {
    fn foxglove(&mut self, t: FrameTransform) -> Option<()> {
        let pose = isometry(t.translation, t.rotation)?;
        self.add(t.parent_frame_id, t.child_frame_id, t.timestamp.map(stamp).unwrap_or_default(), pose);
        Some(())
    }

    fn add(&mut self, parent: String, child: String, stamp: Stamp, pose: Isometry3<f64>) {
        let joint = self.0.entry(child).or_insert_with(|| Joint {
            parent: String::new(),
            poses: Trajectory::default(),
            moves: false,
        });
        joint.parent = parent;
        joint.moves |= joint.poses.poses().first().is_some_and(|first| *first != pose);
        // What is repeated, or comes late, says nothing new.
        let _ = joint.poses.push(stamp, pose);
    }

    /// The pose of a frame in the root of its tree, and whether it moves; `None` where a moving part was not seen at that time.
    fn to_root(&self, frame: &str, stamp: Stamp) -> Option<(Isometry3<f64>, bool)> {
        let (mut at, mut pose, mut moves) = (frame, Isometry3::identity(), false);
        for _ in 0..DEEPEST {
            let Some(joint) = self.0.get(at) else { return Some((pose, moves)) };
            moves |= joint.moves;
            let still = joint.poses.poses().first().filter(|_| !joint.moves).copied();
            pose = still.or_else(|| joint.poses.pose_at(stamp).ok())? * pose;
            at = &joint.parent;
        }
        None
    }

    /// `None` where nothing moves: then no pose was recorded.
    fn world_from(&self, frame: &str, stamp: Stamp) -> Option<Isometry3<f64>> {
        self.to_root(frame, stamp).filter(|(_, moves)| *moves).map(|(pose, _)| pose)
    }

    /// `to_from_frame` of two frames that do not move against each other.
    fn still(&self, frame: &str, to: &str) -> Option<Isometry3<f64>> {
        let chain = |from: &str| {
            let (mut links, mut at) = (vec![(from.to_string(), Isometry3::identity())], from.to_string());
            for _ in 0..DEEPEST {
                let Some(joint) = self.0.get(&at) else { break };
                let Some(still) = joint.poses.poses().first().filter(|_| !joint.moves) else { break };
                let pose = links[links.len() - 1].1;
                links.push((joint.parent.clone(), still * pose));
                at.clone_from(&joint.parent);
            }
            links
        };
        let (from, to) = (chain(frame), chain(to));
        let shared =
            from.iter().find_map(|(name, a)| to.iter().find(|(other, _)| other == name).map(|(_, b)| (a, b)))?;
        Some(shared.1.inverse() * shared.0)
    }
}
