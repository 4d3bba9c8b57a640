//! A mesh from a file stands somewhere, in some unit, lying or upright: brings it in front of the robot.

use std::path::Path;

use nalgebra::{Rotation3, Similarity3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::mesh_io::TriangleMesh;
use crate::region::Scene;

/// Height of the lowest vertex above the ground after placement, metres: room for the robot below its gun.
const CLEAR_OF_GROUND: f64 = 1.5;
/// A mesh whose normals agree more than this (mean normal, 1 = a plane) is a relief and is hung like a wall.
const RELIEF: f64 = 0.5;
/// Painted parts with a shorter level mean normal have no front.
const FACING: f64 = 0.1;

/// Which axis of the file points up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// x up.
    X,
    /// y up, as most OBJ files and all of glTF have it.
    Y,
    /// z up.
    Z,
    /// Any direction: the opposite of gravity in a scan.
    Direction([f64; 3]),
}

impl UpAxis {
    /// What programs usually mean by a file of this name: y for OBJ and OFF, y by definition for glTF, z otherwise.
    pub fn of_file(path: &Path) -> Self {
        let is = |usual: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(usual));
        if ["obj", "off", "glb", "gltf"].into_iter().any(is) { Self::Y } else { Self::Z }
    }

    /// The axis along a direction, where it is one.
    pub fn of_direction(direction: [f64; 3]) -> Self {
        match direction {
            [1.0, 0.0, 0.0] => Self::X,
            [0.0, 1.0, 0.0] => Self::Y,
            [0.0, 0.0, 1.0] => Self::Z,
            other => Self::Direction(other),
        }
    }

    /// `x`, `y`, `z`, `-y` or the direction.
    pub fn name(self) -> String {
        match self {
            Self::X => "x".into(),
            Self::Y => "y".into(),
            Self::Z => "z".into(),
            Self::Direction([-1.0, 0.0, 0.0]) => "-x".into(),
            Self::Direction([0.0, -1.0, 0.0]) => "-y".into(),
            Self::Direction([0.0, 0.0, -1.0]) => "-z".into(),
            Self::Direction([x, y, z]) => format!("{x},{y},{z}"),
        }
    }
}

/// How to place a mesh.
#[derive(Debug, Clone, Copy)]
pub struct MeshPlacement {
    /// Scale; `None` makes the longest side of the bounding box 3 m.
    pub scale: Option<f64>,
    /// The file's up axis.
    pub up: UpAxis,
}

/// Longest side when no scale is given, metres.
pub const LONGEST_SIDE: f64 = 3.0;

/// What is wrong with a mesh before placement.
#[derive(Debug, thiserror::Error)]
pub enum PlacementError {
    /// A vertex is NaN or infinite.
    #[error("vertex {0} is not finite: repair the mesh")]
    NotFinite(usize),
    /// All vertices are at one place.
    #[error("the mesh has no extent: all its vertices are at one point")]
    NoExtent,
    /// The direction is none.
    #[error("--up: give three finite numbers that are not all zero")]
    Up,
    /// The scale is not a positive number.
    #[error("--scale {0}: a scale must be positive and finite")]
    Scale(f64),
}

/// What was done to the mesh.
#[derive(Debug, Clone, Copy)]
pub struct PlacementResult {
    /// Scale used.
    pub scale: f64,
    /// Whether a lying relief was turned upright.
    pub hung: bool,
    /// Where a point of the mesh (about its origin) stands, metres, z up.
    pub world_from_mesh: Similarity3<f64>,
}

impl PlacementResult {
    /// Of a mesh that was turned about its middle, scaled and lifted.
    fn new(turn: Rotation3<f64>, middle: Vector3<f64>, scale: f64, lift: Vector3<f64>, hung: bool) -> Self {
        let rotation = UnitQuaternion::from_rotation_matrix(&turn);
        let translation = lift - turn * middle * scale;
        Self { scale, hung, world_from_mesh: Similarity3::new(translation, rotation.scaled_axis(), scale) }
    }
}

/// Scales the mesh, turns its up axis to z, turns flat pieces upright like a wall that faces -x, and puts it over the origin clear
/// of the ground.
pub fn place_mesh(mesh: &mut TriangleMesh, placement: MeshPlacement) -> Result<PlacementResult, PlacementError> {
    let (low, high) = checked_bounds(mesh)?;
    let scale = checked_scale(placement.scale.unwrap_or(LONGEST_SIDE / (high - low).max()))?;
    let upright = upright(placement.up)?;
    let facing = upright * mean_normal(mesh);
    let hung = facing.norm() > RELIEF;
    let turn = if hung { hang(&facing) * upright } else { upright };
    let middle = (low + high) / 2.0;
    transform(mesh, |p| turn * (p - middle) * scale);
    let lift = Vector3::new(0.0, 0.0, CLEAR_OF_GROUND - bounds(mesh).0.z);
    transform(mesh, |p| p + lift);
    Ok(PlacementResult::new(turn, middle, scale, lift, hung))
}

/// Scales a place of which a part is painted (metres, unless the placement says otherwise), turns its up axis to z, turns it about z
/// so that the painted part faces -x, and puts it over the origin. Nothing is hung: what stands beside it tells how it stands.
pub fn place_scene(scene: &mut Scene, placement: MeshPlacement) -> Result<PlacementResult, PlacementError> {
    checked_bounds(&scene.canvas)?;
    let scale = checked_scale(placement.scale.unwrap_or(1.0))?;
    let upright = upright(placement.up)?;
    let facing = upright * mean_normal(&scene.canvas);
    let turn = if facing.xy().norm() > FACING { turn_to_robot(&facing) * upright } else { upright };
    let everything = [&mut scene.canvas, &mut scene.obstacles];
    // Both hold all vertices.
    let (low, high) = bounds(everything[0]);
    let middle = (low + high) / 2.0;
    let mut lowest = f64::INFINITY;
    for mesh in everything {
        transform(mesh, |p| turn * (p - middle) * scale);
        lowest = lowest.min(bounds(mesh).0.z);
    }
    let lift = Vector3::new(0.0, 0.0, CLEAR_OF_GROUND - lowest);
    for mesh in [&mut scene.canvas, &mut scene.obstacles] {
        transform(mesh, |p| p + lift);
    }
    Ok(PlacementResult::new(turn, middle, scale, lift, false))
}

fn checked_bounds(mesh: &TriangleMesh) -> Result<(Vector3<f64>, Vector3<f64>), PlacementError> {
    if let Some(k) = mesh.positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(PlacementError::NotFinite(k));
    }
    let (low, high) = bounds(mesh);
    let longest = (high - low).max();
    if longest.is_nan() || longest <= 0.0 {
        return Err(PlacementError::NoExtent);
    }
    Ok((low, high))
}

fn checked_scale(scale: f64) -> Result<f64, PlacementError> {
    if scale.is_finite() && scale > 0.0 { Ok(scale) } else { Err(PlacementError::Scale(scale)) }
}

/// The rotation that turns a file's up axis to z.
fn upright(up: UpAxis) -> Result<Rotation3<f64>, PlacementError> {
    Ok(match up {
        UpAxis::X => Rotation3::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_2),
        UpAxis::Y => Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2),
        UpAxis::Z => Rotation3::identity(),
        UpAxis::Direction(up) => {
            let up = Vector3::from(up).try_normalize(0.0).filter(|up| up.iter().all(|c| c.is_finite()));
            let up = up.ok_or(PlacementError::Up)?;
            // Straight down has no nearest rotation: any half turn will do.
            let half_turn = || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
            Rotation3::rotation_between(&up, &Vector3::z()).unwrap_or_else(half_turn)
        }
    })
}

/// The rotation about z that makes a level direction -x.
fn turn_to_robot(facing: &Vector3<f64>) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI - facing.y.atan2(facing.x))
}

/// The rotation that makes a flat piece face -x: about z alone if it already stands. One that lies is tipped up first, so that
/// who looks at it from above with y up and x to the right sees it so on the wall.
fn hang(facing: &Vector3<f64>) -> Rotation3<f64> {
    let flat = Vector3::new(facing.x, facing.y, 0.0);
    let tip = if flat.norm() > 0.7 * facing.norm() {
        Rotation3::identity()
    } else {
        let hung = Rotation3::from_basis_unchecked(&[-Vector3::y(), Vector3::z(), -Vector3::x()]);
        let straighten = Rotation3::rotation_between(&(hung * facing), &-Vector3::x());
        straighten.unwrap_or_else(Rotation3::identity) * hung
    };
    turn_to_robot(&(tip * facing)) * tip
}

/// Sum of the area vectors over the sum of their lengths: length 1 for a plane, 0 for a closed surface.
pub(crate) fn mean_normal(mesh: &TriangleMesh) -> Vector3<f64> {
    let (sum, total) =
        mesh.area_vectors().fold((Vector3::zeros(), 0.0), |(sum, total), area| (sum + area, total + area.norm()));
    if total > 0.0 { sum / total } else { sum }
}

fn bounds(mesh: &TriangleMesh) -> (Vector3<f64>, Vector3<f64>) {
    let points = mesh.positions.iter().map(|p| Vector3::from(p.map(f64::from)));
    points.fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(l, h), p| (l.inf(&p), h.sup(&p)))
}

fn transform(mesh: &mut TriangleMesh, f: impl Fn(Vector3<f64>) -> Vector3<f64>) {
    for position in &mut mesh.positions {
        *position = f(Vector3::from(position.map(f64::from))).map(|c| c as f32).into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(corners: [[f32; 3]; 4]) -> TriangleMesh {
        TriangleMesh { positions: corners.to_vec(), faces: vec![[0, 1, 2], [0, 2, 3]], ..TriangleMesh::default() }
    }

    #[test]
    fn a_lying_terrain_is_hung_to_face_the_robot() {
        // y up, lying in xz: the normal is +y.
        let mut mesh = square([[0.0, 0.0, 0.0], [0.0, 0.0, 10.0], [20.0, 0.0, 10.0], [20.0, 0.0, 0.0]]);
        let placed = place_mesh(&mut mesh, MeshPlacement { scale: None, up: UpAxis::Y }).unwrap();
        assert!(placed.hung && (placed.scale - 0.15).abs() < 1e-12);
        let normal = mean_normal(&mesh);
        assert!((normal + Vector3::x()).norm() < 1e-6, "{normal}");
        assert!((bounds(&mesh).0.z - CLEAR_OF_GROUND).abs() < 1e-5);
    }

    /// A map lies on a table, north away from the viewer: on the wall north is up and east to the right of the robot, which
    /// looks along x.
    #[test]
    fn what_lies_is_hung_as_it_is_looked_at() {
        let map = |up: UpAxis| {
            // Corners: south west, south east, north east, north west.
            let flat = [[0.0_f32, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]];
            let mut mesh = square(flat.map(|[east, north]| match up {
                UpAxis::Y => [east, 0.0, -north],
                _ => [east, north, 0.0],
            }));
            place_mesh(&mut mesh, MeshPlacement { scale: Some(1.0), up }).unwrap();
            mesh.positions
        };
        for up in [UpAxis::Y, UpAxis::Z] {
            let [south_west, south_east, north_east, north_west] = map(up)[..] else { panic!("four corners") };
            for (south, north) in [(south_west, north_west), (south_east, north_east)] {
                assert!((north[2] - south[2] - 2.0).abs() < 1e-5, "{up:?}");
            }
            for (west, east) in [(south_west, south_east), (north_west, north_east)] {
                assert!((west[1] - east[1] - 3.0).abs() < 1e-5, "{up:?}");
            }
        }
    }

    #[test]
    fn a_standing_wall_only_turns_about_z() {
        let mut mesh = square([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0]]);
        place_mesh(&mut mesh, MeshPlacement { scale: Some(1.0), up: UpAxis::Z }).unwrap();
        let (low, high) = bounds(&mesh);
        assert!((mean_normal(&mesh) + Vector3::x()).norm() < 1e-6);
        assert!((high.z - low.z - 1.0).abs() < 1e-5 && (high.y - low.y - 2.0).abs() < 1e-5);
    }

    /// A slender pyramid along each axis stands on its base, its point up.
    #[test]
    fn what_points_up_in_the_file_points_up() {
        let down = UpAxis::Direction([0.0, -1.0, 0.0]);
        for (up, [along, across, aside]) in
            [(UpAxis::X, [0, 1, 2]), (UpAxis::Y, [1, 2, 0]), (UpAxis::Z, [2, 0, 1]), (down, [1, 0, 2])]
        {
            let sign = if up == down { -1.0 } else { 1.0 };
            let corner = |a: f32, b: f32, height: f32| {
                let mut at = [0.0; 3];
                (at[across], at[aside], at[along]) = (a, b, sign * height);
                at
            };
            let base = [(-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)];
            let mut mesh = square(base.map(|(a, b)| corner(a, b, 0.0)));
            mesh.positions.push(corner(0.0, 0.0, 2.0));
            mesh.faces.extend([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]);
            place_mesh(&mut mesh, MeshPlacement { scale: Some(1.0), up }).unwrap();
            let heights: Vec<f64> = mesh.positions.iter().map(|p| f64::from(p[2])).collect();
            assert!(heights[..4].iter().all(|z| (z - CLEAR_OF_GROUND).abs() < 1e-5), "{up:?}: {heights:?}");
            assert!((heights[4] - CLEAR_OF_GROUND - 2.0).abs() < 1e-5, "{up:?}: {heights:?}");
        }
    }

    /// A wall that faces +y, with a block a metre before it and lower: both are turned, scaled and lifted as one.
    #[test]
    fn a_place_moves_as_one() {
        let wall = [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [4.0, 0.0, 2.0], [4.0, 0.0, 0.0]];
        let block = [[1.0, 1.0, -1.0], [1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [3.0, 1.0, -1.0]];
        let positions = [wall, block].concat();
        let part = |faces: [[u32; 3]; 2]| TriangleMesh {
            positions: positions.clone(),
            faces: faces.to_vec(),
            ..TriangleMesh::default()
        };
        let mut scene =
            Scene { canvas: part([[0, 1, 2], [0, 2, 3]]), obstacles: part([[4, 5, 6], [4, 6, 7]]), ..Scene::default() };
        assert!((mean_normal(&scene.canvas) - Vector3::y()).norm() < 1e-6);
        place_scene(&mut scene, MeshPlacement { scale: Some(0.5), up: UpAxis::Z }).unwrap();
        // Half as large, facing -x with the file's x to the robot's left: the box around all is 4 m by 1 m by 3 m.
        let expected = positions
            .iter()
            .map(|[x, y, z]| [0.5 * (0.5 - y), 0.5 * (x - 2.0), 0.5 * (z + 1.0) + CLEAR_OF_GROUND as f32]);
        for (k, expected) in expected.enumerate() {
            for mesh in [&scene.canvas, &scene.obstacles] {
                let error = (Vector3::from(mesh.positions[k]) - Vector3::from(expected)).norm();
                assert!(error < 1e-5, "{k}: {:?} {expected:?}", mesh.positions[k]);
            }
        }
    }

    #[test]
    fn bad_scales_and_meshes_are_refused() {
        let mesh = || square([[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        for scale in [-1.0, 0.0, f64::NAN] {
            assert!(matches!(
                place_mesh(&mut mesh(), MeshPlacement { scale: Some(scale), up: UpAxis::Z }),
                Err(PlacementError::Scale(_))
            ));
        }
        let mut bad = mesh();
        bad.positions[2][1] = f32::NAN;
        assert!(matches!(
            place_mesh(&mut bad, MeshPlacement { scale: None, up: UpAxis::Z }),
            Err(PlacementError::NotFinite(2))
        ));
    }
}
