//! Triangles, lines and boxes of a scene as the page takes them.

use foxglove::messages::{Color, CubePrimitive, LinePrimitive, Point3, Pose, SceneEntity, TriangleListPrimitive};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

/// Colour of what has none.
const GREY: Color = Color { r: 0.7, g: 0.7, b: 0.7, a: 1.0 };

/// One kind of geometry of an entity.
#[derive(Debug, Default, Serialize)]
pub(super) struct Part {
    /// Points in pairs, not corners of triangles.
    lines: bool,
    /// Thickness of lines: metres, or pixels.
    thickness: f64,
    pixels: bool,
    vertices: usize,
    corners: usize,
    #[serde(skip)]
    positions: Vec<[f32; 3]>,
    #[serde(skip)]
    colours: Vec<[u8; 4]>,
    #[serde(skip)]
    indices: Vec<u32>,
}

/// What became of an entity.
pub(super) struct Shapes {
    pub(super) parts: Vec<Part>,
    /// Parts that contradict themselves, and parts of kinds that are not drawn.
    pub(super) malformed: u64,
    pub(super) not_drawn: u64,
}

impl Shapes {
    pub(super) fn of(entity: &SceneEntity) -> Self {
        let parts = (entity.triangles.iter().map(triangles))
            .chain(entity.lines.iter().map(segments))
            .chain(entity.cubes.iter().map(cube));
        let (sound, broken): (Vec<_>, Vec<_>) = parts.partition(Option::is_some);
        let others = entity.arrows.len()
            + entity.spheres.len()
            + entity.cylinders.len()
            + entity.texts.len()
            + entity.models.len();
        Self {
            parts: sound.into_iter().flatten().filter(|part| part.vertices > 0).collect(),
            malformed: broken.len() as u64,
            not_drawn: others as u64,
        }
    }

    /// Lowest and highest corner of what has triangles.
    pub(super) fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let corners = self.parts.iter().filter(|part| !part.lines).flat_map(|part| &part.positions);
        corners.fold(None, |bounds, p| {
            let [low, high] = bounds.unwrap_or([*p; 2]);
            Some([std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))])
        })
    }

    pub(super) fn triangles(&self) -> u64 {
        self.parts.iter().map(|part| part.corners as u64 / 3).sum()
    }
}

/// `3 0 0 0`, length of a JSON head (u32), the head (key, frame, parts), then for every part its points (f32), colours (u8, red green
/// blue alpha) and corners (u32). The head ends at a multiple of four bytes. Without parts the entity is taken away.
pub(super) fn entity(key: &str, frame: &str, parts: &[Part]) -> Vec<u8> {
    let mut head = serde_json::json!({ "key": key, "frame": frame, "parts": parts }).to_string();
    head.extend(std::iter::repeat_n(' ', head.len().next_multiple_of(4) - head.len()));
    let mut bytes = vec![3, 0, 0, 0];
    bytes.extend((head.len() as u32).to_le_bytes());
    bytes.extend(head.as_bytes());
    for part in parts {
        bytes.extend(part.positions.iter().flatten().flat_map(|c| c.to_le_bytes()));
        bytes.extend(part.colours.iter().flatten());
        bytes.extend(part.indices.iter().flat_map(|c| c.to_le_bytes()));
    }
    bytes
}

/// `4 0 0 0`, length of a JSON head (u32), the head (frame, format), then the file.
pub(super) fn picture(frame: &str, format: &str, data: &[u8]) -> Vec<u8> {
    let head = serde_json::json!({ "frame": frame, "format": format }).to_string();
    let mut bytes = vec![4, 0, 0, 0];
    bytes.extend((head.len() as u32).to_le_bytes());
    bytes.extend(head.as_bytes());
    bytes.extend(data);
    bytes
}

/// A message's pose; none is the identity, and one without a rotation is `None`.
pub(super) fn isometry(pose: Option<&Pose>) -> Option<Isometry3<f64>> {
    let Some(pose) = pose else { return Some(Isometry3::identity()) };
    let translation = pose.position.map_or_else(Vector3::zeros, |p| Vector3::new(p.x, p.y, p.z));
    let q = pose.orientation.map_or_else(Quaternion::identity, |q| Quaternion::new(q.w, q.x, q.y, q.z));
    let rotation = UnitQuaternion::try_new(q, 1e-6)?;
    let finite = translation.iter().chain(rotation.coords.iter()).all(|c| c.is_finite());
    finite.then(|| Isometry3::from_parts(Translation3::from(translation), rotation))
}

fn triangles(list: &TriangleListPrimitive) -> Option<Part> {
    let positions = placed(&list.points, list.pose.as_ref())?;
    let indices = order(&list.indices, positions.len())?;
    let colours = coloured(&list.colors, list.color, positions.len())?;
    indices.len().is_multiple_of(3).then(|| part(positions, colours, indices))
}

/// Pairs of points, so that the page need not know the kinds of lines.
fn segments(line: &LinePrimitive) -> Option<Part> {
    let points = placed(&line.points, line.pose.as_ref())?;
    let colours = coloured(&line.colors, line.color, points.len())?;
    let order = order(&line.indices, points.len())?;
    let mut pairs: Vec<u32> = match line.r#type {
        2 => order.chunks_exact(2).flatten().copied().collect(),
        _ => order.windows(2).flatten().copied().collect(),
    };
    if let (1, [first, .., last]) = (line.r#type, &order[..]) {
        pairs.extend([*last, *first]);
    }
    let of = |k: &u32| *k as usize;
    let part =
        part(pairs.iter().map(|k| points[of(k)]).collect(), pairs.iter().map(|k| colours[of(k)]).collect(), Vec::new());
    let thickness = if line.thickness.is_finite() { line.thickness.max(0.0) } else { return None };
    Some(Part { lines: true, thickness, pixels: line.scale_invariant, ..part })
}

fn cube(cube: &CubePrimitive) -> Option<Part> {
    let size = cube.size?;
    let corner = |k: u32| {
        let side = |bit: u32, length: f64| if k & bit == 0 { -0.5 * length } else { 0.5 * length };
        Point3 { x: side(1, size.x), y: side(2, size.y), z: side(4, size.z) }
    };
    let corners: Vec<Point3> = (0..8).map(corner).collect();
    let positions = placed(&corners, cube.pose.as_ref())?;
    let colours = coloured(&[], cube.color, positions.len())?;
    // Each side, seen from outside counter-clockwise.
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Some(part(positions, colours, sides.into_iter().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]).collect()))
}

fn part(positions: Vec<[f32; 3]>, colours: Vec<[u8; 4]>, indices: Vec<u32>) -> Part {
    Part { vertices: positions.len(), corners: indices.len(), positions, colours, indices, ..Part::default() }
}

fn placed(points: &[Point3], pose: Option<&Pose>) -> Option<Vec<[f32; 3]>> {
    let pose = isometry(pose)?;
    let place = |p: &Point3| (pose * nalgebra::Point3::new(p.x, p.y, p.z)).map(|c| c as f32).into();
    let positions: Vec<[f32; 3]> = points.iter().map(place).collect();
    positions.iter().flatten().all(|c| c.is_finite()).then_some(positions)
}

/// The corners as they are listed, or all of them one after the other.
fn order(indices: &[u32], points: usize) -> Option<Vec<u32>> {
    if indices.is_empty() {
        return Some((0..points as u32).collect());
    }
    indices.iter().all(|k| (*k as usize) < points).then(|| indices.to_vec())
}

fn coloured(colours: &[Color], colour: Option<Color>, points: usize) -> Option<Vec<[u8; 4]>> {
    let byte = |c: f64| (255.0 * c).round().clamp(0.0, 255.0) as u8;
    let bytes = |c: &Color| [byte(c.r), byte(c.g), byte(c.b), byte(c.a)];
    if colours.is_empty() {
        return Some(vec![bytes(&colour.unwrap_or(GREY)); points]);
    }
    (colours.len() == points).then(|| colours.iter().map(bytes).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Point3 {
        Point3 { x, y: 0.0, z: 0.0 }
    }

    fn line(kind: i32) -> LinePrimitive {
        LinePrimitive {
            r#type: kind,
            thickness: 0.1,
            points: (0..4).map(|k| at(f64::from(k))).collect(),
            ..LinePrimitive::default()
        }
    }

    #[test]
    fn strips_loops_and_lists_become_pairs() {
        let along = |kind| segments(&line(kind)).unwrap().positions.iter().map(|p| p[0] as i32).collect::<Vec<_>>();
        assert_eq!(along(0), [0, 1, 1, 2, 2, 3]);
        assert_eq!(along(1), [0, 1, 1, 2, 2, 3, 3, 0]);
        assert_eq!(along(2), [0, 1, 2, 3]);
    }

    #[test]
    fn a_box_is_closed_and_looks_outwards() {
        let size = Some(foxglove::messages::Vector3 { x: 2.0, y: 4.0, z: 6.0 });
        let part = cube(&CubePrimitive { pose: None, size, color: None }).unwrap();
        // The divergence theorem: signed volumes of the tetrahedra to the origin.
        let corner = |k: u32| Vector3::from(part.positions[k as usize]).map(f64::from);
        let volume: f64 =
            part.indices.chunks(3).map(|t| corner(t[0]).dot(&corner(t[1]).cross(&corner(t[2]))) / 6.0).sum();
        assert!((volume - 48.0).abs() < 1e-9, "{volume}");
    }

    #[test]
    fn what_contradicts_itself_is_counted_and_left_out() {
        let sound =
            TriangleListPrimitive { points: vec![at(0.0), at(1.0), at(2.0)], ..TriangleListPrimitive::default() };
        let entity = SceneEntity {
            triangles: vec![
                sound.clone(),
                TriangleListPrimitive { indices: vec![0, 1, 3], ..sound.clone() },
                TriangleListPrimitive { indices: vec![0, 1], ..sound.clone() },
                TriangleListPrimitive { colors: vec![GREY], ..sound.clone() },
                TriangleListPrimitive { points: vec![at(f64::NAN); 3], ..sound },
            ],
            lines: vec![LinePrimitive { thickness: f64::NAN, ..line(0) }],
            ..SceneEntity::default()
        };
        let shapes = Shapes::of(&entity);
        assert_eq!((shapes.parts.len(), shapes.malformed, shapes.triangles()), (1, 5, 1));
        let bytes = super::entity("a key", "world", &shapes.parts);
        let head = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
        assert_eq!((bytes.len(), head % 4), (8 + head + 3 * (12 + 4) + 3 * 4, 0));
    }
}
