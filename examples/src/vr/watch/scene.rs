//! The scene as it is now: things, frames, the latest picture.

use std::collections::BTreeMap;

use foxglove::Decode as _;
use foxglove::messages::{CompressedImage, FrameTransform, FrameTransforms, Log, Pose, SceneUpdate};
use nalgebra::{Isometry3, Point3};

use super::feed::{FeedMessage, IMAGE, LOG, SCENE, TRANSFORM, TRANSFORMS};
use super::shapes::{Shapes, entity, isometry, picture};

/// Frames of frames: more is a circle.
const DEEPEST: usize = 64;
/// Formats of pictures that every browser draws.
const PICTURES: [&str; 3] = ["jpeg", "png", "webp"];

/// What a message has changed.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Change {
    Entity(String),
    Frames,
    Picture,
    Text(String),
}

/// Counts of what came.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SceneCounts {
    pub(super) messages: u64,
    pub(super) malformed: u64,
    pub(super) other_topics: u64,
    pub(super) not_drawn: u64,
}

/// A thing, encoded for the page.
struct Thing {
    bytes: Vec<u8>,
    triangles: u64,
    frame: String,
    /// Lowest and highest corner in its frame.
    bounds: Option<[[f32; 3]; 2]>,
}

/// The scene.
#[derive(Default)]
pub(super) struct Scene {
    things: BTreeMap<String, Thing>,
    /// Parent and pose in it of every frame.
    frames: BTreeMap<String, (String, Isometry3<f64>)>,
    picture: Vec<u8>,
    counts: SceneCounts,
}

impl Scene {
    /// Takes a message; what it has changed.
    pub(super) fn take(&mut self, message: &FeedMessage) -> Vec<Change> {
        let data = &message.data[..];
        let changes = match message.schema.as_str() {
            SCENE => SceneUpdate::decode(data).ok().map(|update| self.update(&message.topic, update)),
            TRANSFORM => FrameTransform::decode(data).ok().map(|frame| self.transform([frame])),
            TRANSFORMS => FrameTransforms::decode(data).ok().map(|frames| self.transform(frames.transforms)),
            IMAGE => CompressedImage::decode(data).ok().and_then(|image| self.show(&image)),
            LOG => Log::decode(data).ok().map(|log| vec![Change::Text(log.message)]),
            _ => {
                self.counts.other_topics += 1;
                return Vec::new();
            }
        };
        self.counts.messages += u64::from(changes.is_some());
        self.counts.malformed += u64::from(changes.is_none());
        changes.unwrap_or_default()
    }

    /// An entity as the page takes it; one that is gone has no parts.
    pub(super) fn entity(&self, key: &str) -> Vec<u8> {
        self.things.get(key).map_or_else(|| entity(key, "", &[]), |thing| thing.bytes.clone())
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &String> {
        self.things.keys()
    }

    pub(super) fn triangles(&self) -> u64 {
        self.things.values().map(|thing| thing.triangles).sum()
    }

    /// The latest picture as the page takes it; empty before the first.
    pub(super) fn picture(&self) -> &[u8] {
        &self.picture
    }

    pub(super) fn counts(&self) -> SceneCounts {
        self.counts
    }

    /// Pose of every frame in the frame at the root of its tree. Roots themselves are not listed.
    pub(super) fn frames(&self) -> impl Iterator<Item = (&str, Isometry3<f64>)> {
        self.frames.keys().filter_map(|name| Some((name.as_str(), self.pose(name)?)))
    }

    /// Lowest and highest corner of what does not move: of the surfaces in a frame that has no parent.
    pub(super) fn bounds(&self) -> Option<[Point3<f64>; 2]> {
        let fixed = self.things.values().filter(|thing| !self.frames.contains_key(&thing.frame));
        let bounds = fixed.filter_map(|thing| thing.bounds).reduce(|[low, high], [l, h]| {
            [std::array::from_fn(|k| low[k].min(l[k])), std::array::from_fn(|k| high[k].max(h[k]))]
        });
        bounds.map(|bounds| bounds.map(|corner| Point3::from(corner.map(f64::from))))
    }

    fn pose(&self, name: &str) -> Option<Isometry3<f64>> {
        let mut pose = Isometry3::identity();
        let mut at = name;
        for _ in 0..DEEPEST {
            let Some((parent, parent_from_frame)) = self.frames.get(at) else { return Some(pose) };
            pose = parent_from_frame * pose;
            at = parent;
        }
        None
    }

    fn update(&mut self, topic: &str, update: SceneUpdate) -> Vec<Change> {
        let prefix = format!("{topic} ");
        let mut changes = Vec::new();
        for deletion in update.deletions {
            let of_topic = self.things.range(prefix.clone()..).map(|(key, _)| key);
            let of_topic = of_topic.take_while(|key| key.starts_with(&prefix));
            // 1 is all of the topic.
            let gone: Vec<String> =
                of_topic.filter(|key| deletion.r#type == 1 || key[prefix.len()..] == deletion.id).cloned().collect();
            for key in gone {
                self.things.remove(&key);
                changes.push(Change::Entity(key));
            }
        }
        for new in update.entities {
            let key = format!("{prefix}{}", new.id);
            let shapes = Shapes::of(&new);
            self.counts.malformed += shapes.malformed;
            self.counts.not_drawn += shapes.not_drawn;
            let thing = Thing {
                bytes: entity(&key, &new.frame_id, &shapes.parts),
                triangles: shapes.triangles(),
                bounds: shapes.bounds(),
                frame: new.frame_id,
            };
            self.things.insert(key.clone(), thing);
            changes.push(Change::Entity(key));
        }
        changes
    }

    fn transform(&mut self, frames: impl IntoIterator<Item = FrameTransform>) -> Vec<Change> {
        for frame in frames {
            match isometry(Some(&Pose { position: frame.translation, orientation: frame.rotation })) {
                Some(pose) => {
                    self.frames.insert(frame.child_frame_id, (frame.parent_frame_id, pose));
                }
                None => self.counts.malformed += 1,
            }
        }
        vec![Change::Frames]
    }

    fn show(&mut self, image: &CompressedImage) -> Option<Vec<Change>> {
        let format = image.format.to_lowercase().replace("jpg", "jpeg");
        if !PICTURES.contains(&format.as_str()) {
            return None;
        }
        self.picture = picture(&image.frame_id, &format, &image.data);
        Some(vec![Change::Picture])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foxglove::Encode as _;
    use foxglove::messages::{Quaternion, SceneEntity, SceneEntityDeletion, Vector3};

    fn message(topic: &str, schema: &str, encode: impl FnOnce(&mut Vec<u8>)) -> FeedMessage {
        let mut data = Vec::new();
        encode(&mut data);
        FeedMessage { topic: topic.into(), schema: schema.into(), data }
    }

    fn update(topic: &str, update: &SceneUpdate) -> FeedMessage {
        message(topic, SCENE, |data| update.encode(data).unwrap())
    }

    fn entities(ids: &[&str]) -> SceneUpdate {
        let entity = |id: &&str| SceneEntity { id: (*id).into(), ..SceneEntity::default() };
        SceneUpdate { deletions: Vec::new(), entities: ids.iter().map(entity).collect() }
    }

    fn deletion(kind: i32, id: &str) -> SceneUpdate {
        let deletion = SceneEntityDeletion { timestamp: None, r#type: kind, id: id.into() };
        SceneUpdate { deletions: vec![deletion], entities: Vec::new() }
    }

    #[test]
    fn entities_stay_until_they_are_deleted_on_their_topic() {
        let mut scene = Scene::default();
        scene.take(&update("/paint", &entities(&["trace-1", "trace-2"])));
        scene.take(&update("/paint2", &entities(&["trace-1"])));
        let keys = |scene: &Scene| scene.keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&scene), ["/paint trace-1", "/paint trace-2", "/paint2 trace-1"]);
        assert_eq!(scene.take(&update("/paint", &deletion(0, "trace-2"))), [Change::Entity("/paint trace-2".into())]);
        assert_eq!(keys(&scene), ["/paint trace-1", "/paint2 trace-1"]);
        scene.take(&update("/paint", &deletion(1, "")));
        assert_eq!(keys(&scene), ["/paint2 trace-1"]);
        scene.take(&FeedMessage { topic: "/map".into(), schema: SCENE.into(), data: vec![255; 9] });
        scene.take(&FeedMessage { topic: "/imu".into(), schema: "foxglove.Imu".into(), data: Vec::new() });
        let counts = scene.counts();
        assert_eq!((counts.messages, counts.malformed, counts.other_topics), (4, 1, 1));
    }

    #[test]
    fn frames_are_chained_to_their_root_and_circles_left_out() {
        let frame = |parent: &str, child: &str, x: f64| FrameTransform {
            timestamp: None,
            parent_frame_id: parent.into(),
            child_frame_id: child.into(),
            translation: Some(Vector3 { x, y: 0.0, z: 0.0 }),
            rotation: Some(Quaternion { x: 0.0, y: 0.0, z: 1.0, w: 0.0 }),
        };
        let transforms = vec![
            frame("world", "body", 1.0),
            frame("body", "nozzle", 0.25),
            frame("b", "a", 0.0),
            frame("a", "b", 0.0),
        ];
        let mut scene = Scene::default();
        scene.take(&message("/tf", TRANSFORMS, |data| FrameTransforms { transforms }.encode(data).unwrap()));
        let frames: Vec<(&str, f64)> = scene.frames().map(|(name, pose)| (name, pose.translation.x)).collect();
        // Half a turn at the body: its x is the world's -x.
        assert_eq!(frames, [("body", 1.0), ("nozzle", 0.75)]);
    }
}
