//! Messages with Foxglove's schemas as those that ROS 2 has for them.

use foxglove::messages::{self, FrameTransform, LinePrimitive, SceneEntity, SceneUpdate, Timestamp, line_primitive};

use super::messages::{CameraInfo, JointState, Log, Marker, Markers, Transforms};
use crate::mcap_messages::cdr::{self, CompressedImage, Header, Image, Pose, PoseStamped, TransformStamped};
use crate::mcap_messages::fields::stamp;

/// Kinds of markers, and what is done with them.
const CUBE: i32 = 1;
const LINE_STRIP: i32 = 4;
const LINE_LIST: i32 = 5;
const TRIANGLE_LIST: i32 = 11;
pub(super) const DELETE: i32 = 2;
pub(super) const DELETE_ALL: i32 = 3;
/// Thickness of a line that has the same number of pixels from everywhere, metres.
const THIN: f64 = 0.005;

pub(super) fn header(time: Option<Timestamp>, frame: &str) -> Header {
    Header::new(time.map(stamp).unwrap_or_default(), frame)
}

fn pose(position: Option<messages::Vector3>, orientation: Option<messages::Quaternion>) -> Pose {
    let still = Pose::default();
    Pose {
        position: position.map_or(still.position, |p| [p.x, p.y, p.z]),
        orientation: orientation.map_or(still.orientation, |q| [q.x, q.y, q.z, q.w]),
    }
}

pub(super) fn pose_stamped(message: &messages::PoseInFrame) -> PoseStamped {
    let inner = message.pose.unwrap_or_default();
    PoseStamped { header: header(message.timestamp, &message.frame_id), pose: pose(inner.position, inner.orientation) }
}

pub(super) fn transforms<'a>(frames: impl IntoIterator<Item = &'a FrameTransform>) -> Transforms {
    let one = |frame: &FrameTransform| {
        let Pose { position, orientation } = pose(frame.translation, frame.rotation);
        TransformStamped {
            header: header(frame.timestamp, &frame.parent_frame_id),
            child_frame_id: frame.child_frame_id.clone(),
            translation: position,
            rotation: orientation,
        }
    };
    Transforms(frames.into_iter().map(one).collect())
}

pub(super) fn joint_state(message: &messages::JointStates) -> JointState {
    let of = |value: fn(&messages::JointState) -> Option<f64>| {
        // All or none, as the definition asks.
        message.joints.iter().map(value).collect::<Option<Vec<f64>>>().unwrap_or_default()
    };
    JointState {
        header: header(message.timestamp, ""),
        name: message.joints.iter().map(|joint| joint.name.clone()).collect(),
        position: of(|joint| joint.position),
        velocity: of(|joint| joint.velocity),
        effort: of(|joint| joint.effort),
    }
}

pub(super) fn image(message: &messages::RawImage) -> Image<'_> {
    Image {
        header: header(message.timestamp, &message.frame_id),
        height: message.height,
        width: message.width,
        encoding: message.encoding.clone(),
        is_bigendian: 0,
        step: message.step,
        data: &message.data,
    }
}

pub(super) fn compressed_image(message: &messages::CompressedImage) -> CompressedImage<'_> {
    let header = header(message.timestamp, &message.frame_id);
    CompressedImage { header, format: message.format.clone(), data: &message.data }
}

/// `None` for matrices of other sizes than they have.
pub(super) fn camera_info(message: messages::CameraCalibration) -> Option<CameraInfo> {
    let first = cdr::CameraInfo {
        header: header(message.timestamp, &message.frame_id),
        height: message.height,
        width: message.width,
        distortion_model: match message.distortion_model.as_str() {
            "kannala_brandt" => "equidistant".into(),
            _ => message.distortion_model,
        },
        d: message.d,
        k: message.k.try_into().ok()?,
    };
    let (r, p) = (message.r.try_into().ok()?, message.p.try_into().ok()?);
    Some(CameraInfo { first, r, p, ..CameraInfo::default() })
}

pub(super) fn log(message: messages::Log) -> Log {
    let time = header(message.timestamp, "").time();
    let level = 10 * u8::try_from(message.level.clamp(0, 5)).unwrap_or_default();
    let (name, file) = (message.name, message.file);
    Log { stamp: time, level, name, msg: message.message, file, function: String::new(), line: message.line }
}

/// The markers of an entity, numbered from 0.
pub(super) fn markers(entity: &SceneEntity) -> Vec<Marker> {
    let lifetime = entity.lifetime.as_ref().map_or((0, 0), |l| (l.sec(), l.nsec()));
    let new = |kind: i32, pose: Option<messages::Pose>| Marker {
        header: header(entity.timestamp, &entity.frame_id),
        ns: entity.id.clone(),
        kind,
        pose: pose.map_or_else(Pose::default, |p| self::pose(p.position, p.orientation)),
        lifetime,
        frame_locked: entity.frame_locked,
        ..Marker::default()
    };
    let cubes = entity.cubes.iter().map(|cube| Marker {
        scale: cube.size.map_or([0.0; 3], |s| [s.x, s.y, s.z]),
        color: cube.color.map_or([0.7, 0.7, 0.7, 1.0], rgba),
        ..new(CUBE, cube.pose)
    });
    let lines = entity.lines.iter().map(|line| {
        let (kind, order) = line_order(line);
        let thickness = if line.scale_invariant { THIN } else { line.thickness };
        Marker {
            scale: [thickness, 0.0, 0.0],
            ..with_vertices(new(kind, line.pose), &line.points, line.color, &line.colors, &order)
        }
    });
    let triangles = entity.triangles.iter().map(|list| {
        let order: Vec<usize> = if list.indices.is_empty() {
            (0..list.points.len()).collect()
        } else {
            list.indices.iter().map(|&k| k as usize).collect()
        };
        let marker = Marker { scale: [1.0; 3], ..new(TRIANGLE_LIST, list.pose) };
        with_vertices(marker, &list.points, list.color, &list.colors, &order)
    });
    let all = cubes.chain(lines).chain(triangles);
    all.zip(0..).map(|(marker, id)| Marker { id, ..marker }).collect()
}

/// Kind of marker, and which points it has: ROS knows strips and pairs, no closed lines and no indices.
fn line_order(line: &LinePrimitive) -> (i32, Vec<usize>) {
    let mut order: Vec<usize> = if line.indices.is_empty() {
        (0..line.points.len()).collect()
    } else {
        line.indices.iter().map(|&k| k as usize).collect()
    };
    if line.r#type == line_primitive::Type::LineList as i32 {
        return (LINE_LIST, order);
    }
    if line.r#type == line_primitive::Type::LineLoop as i32 {
        order.extend(order.first().copied());
    }
    (LINE_STRIP, order)
}

/// A marker with those of the points that exist.
fn with_vertices(
    marker: Marker,
    points: &[messages::Point3],
    colour: Option<messages::Color>,
    colours: &[messages::Color],
    order: &[usize],
) -> Marker {
    let order = || order.iter().filter(|&&k| k < points.len());
    Marker {
        points: order().map(|&k| [points[k].x, points[k].y, points[k].z]).collect(),
        color: colour.map_or([1.0; 4], rgba),
        colors: if colours.len() < points.len() { Vec::new() } else { order().map(|&k| rgba(colours[k])).collect() },
        ..marker
    }
}

fn rgba(c: messages::Color) -> [f32; 4] {
    [c.r, c.g, c.b, c.a].map(|channel| channel as f32)
}

/// Scenes are told by entity, markers one by one: what an entity no longer has must be taken away.
#[derive(Default)]
pub(super) struct MarkerTable(std::collections::BTreeMap<String, i32>);

impl MarkerTable {
    /// The markers of an update, and those that it ends.
    pub(super) fn update(&mut self, scene: &SceneUpdate) -> Markers {
        let mut markers = Vec::new();
        for deletion in &scene.deletions {
            let header = header(deletion.timestamp, "");
            if deletion.r#type == messages::scene_entity_deletion::Type::All as i32 {
                self.0.clear();
                markers.push(Marker { header, action: DELETE_ALL, ..Marker::default() });
            } else {
                let had = self.0.remove(&deletion.id).unwrap_or(0);
                markers.extend((0..had).map(|id| gone(&header, &deletion.id, id)));
            }
        }
        for entity in &scene.entities {
            let new = self::markers(entity);
            let count = i32::try_from(new.len()).unwrap_or(i32::MAX);
            let had = self.0.insert(entity.id.clone(), count).unwrap_or(0);
            let header = header(entity.timestamp, &entity.frame_id);
            markers.extend(new);
            markers.extend((count..had).map(|id| gone(&header, &entity.id, id)));
        }
        Markers(markers)
    }
}

fn gone(header: &Header, ns: &str, id: i32) -> Marker {
    Marker { header: header.clone(), ns: ns.into(), id, action: DELETE, ..Marker::default() }
}

#[cfg(test)]
mod tests {
    use foxglove::messages::scene_entity_deletion::Type;
    use foxglove::messages::{Color, Point3, SceneEntityDeletion, TriangleListPrimitive};

    use super::*;

    fn line(points: &[f64], kind: line_primitive::Type, indices: &[u32]) -> LinePrimitive {
        let points = points.iter().map(|&x| Point3 { x, y: 0.0, z: 0.0 }).collect();
        LinePrimitive { points, r#type: kind as i32, indices: indices.to_vec(), ..LinePrimitive::default() }
    }

    fn entity(id: &str, lines: Vec<LinePrimitive>) -> SceneEntity {
        SceneEntity { id: id.into(), lines, ..SceneEntity::default() }
    }

    fn update(deletions: Vec<(Type, &str)>, entities: Vec<SceneEntity>) -> SceneUpdate {
        let deletion = |(kind, id): (Type, &str)| SceneEntityDeletion {
            r#type: kind as i32,
            id: id.into(),
            ..SceneEntityDeletion::default()
        };
        SceneUpdate { deletions: deletions.into_iter().map(deletion).collect(), entities }
    }

    fn x_of(marker: &Marker) -> Vec<f64> {
        marker.points.iter().map(|p| p[0]).collect()
    }

    #[test]
    fn lines_become_strips_and_pairs() {
        use line_primitive::Type::{LineList, LineLoop, LineStrip};
        let entity = entity(
            "way",
            vec![
                line(&[0.0, 1.0, 2.0], LineStrip, &[]),
                line(&[0.0, 1.0, 2.0], LineLoop, &[]),
                // An index that no point has.
                line(&[0.0, 1.0, 2.0], LineList, &[2, 0, 0, 1, 7]),
            ],
        );
        let made = markers(&entity);
        assert_eq!(made.iter().map(|m| (m.kind, m.id)).collect::<Vec<_>>(), [(4, 0), (4, 1), (5, 2)]);
        let expected = [vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 2.0, 0.0], vec![2.0, 0.0, 0.0, 1.0]];
        assert!(made.iter().zip(expected).all(|(marker, expected)| x_of(marker) == expected));
    }

    #[test]
    fn triangles_have_the_corners_and_colours_of_their_indices() {
        let points = [0.0, 1.0, 2.0, 3.0].map(|x| Point3 { x, y: 0.0, z: 0.0 }).to_vec();
        let colors = [0.0, 0.25, 0.5, 1.0].map(|r| Color { r, g: 0.0, b: 0.0, a: 1.0 }).to_vec();
        let list = TriangleListPrimitive { points, colors, indices: vec![3, 1, 0], ..TriangleListPrimitive::default() };
        let made = markers(&SceneEntity { triangles: vec![list], ..SceneEntity::default() });
        assert_eq!(made[0].kind, 11);
        assert_eq!(x_of(&made[0]), [3.0, 1.0, 0.0]);
        assert_eq!(made[0].colors.iter().map(|c| c[0]).collect::<Vec<_>>(), [1.0, 0.25, 0.0]);
    }

    #[test]
    fn what_an_entity_no_longer_has_is_taken_away() {
        let strip = || line(&[0.0, 1.0], line_primitive::Type::LineStrip, &[]);
        let mut table = MarkerTable::default();
        let mut told = |scene: SceneUpdate| {
            let markers = table.update(&scene).0;
            markers.into_iter().map(|m| (m.ns, m.id, m.action)).collect::<Vec<_>>()
        };
        let mark = |ns: &str, id: i32, action: i32| (ns.to_string(), id, action);
        let first =
            told(update(Vec::new(), vec![entity("a", vec![strip(), strip(), strip()]), entity("b", vec![strip()])]));
        assert_eq!(first, [mark("a", 0, 0), mark("a", 1, 0), mark("a", 2, 0), mark("b", 0, 0)]);
        assert_eq!(
            told(update(Vec::new(), vec![entity("a", vec![strip()])])),
            [mark("a", 0, 0), mark("a", 1, 2), mark("a", 2, 2)]
        );
        assert_eq!(told(update(vec![(Type::MatchingId, "a")], Vec::new())), [mark("a", 0, 2)]);
        assert_eq!(told(update(vec![(Type::All, "")], Vec::new())), [mark("", 0, 3)]);
        // It is known to be gone.
        assert_eq!(told(update(Vec::new(), vec![entity("b", Vec::new())])), []);
    }
}
