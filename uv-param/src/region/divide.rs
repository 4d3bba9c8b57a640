//! Faces across the border of a region are divided, by halving longest sides, until they hardly matter.

use std::collections::{HashMap, HashSet};

use nalgebra::{Point3, Vector3};

use super::{check, same_places};
use crate::error::Error;

/// Halvings of one side at most: a wall of a kilometre to a millimetre.
const ROUNDS: usize = 64;
/// Samples along a side of a face at most.
const MOST_ALONG: usize = 400;

/// A place on a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Where it is, units of the mesh.
    pub point: Point3<f64>,
    /// Unit normal of the face; zero where it has none.
    pub normal: Vector3<f64>,
    /// Texture coordinates; zero where there are none.
    pub uv: [f64; 2],
}

/// A mesh to which vertices and faces may be added, with all that goes with them.
#[derive(Debug)]
pub struct EditableMesh<'a> {
    /// Vertices, any unit.
    pub positions: &'a mut Vec<[f32; 3]>,
    /// Vertex indices, three per face.
    pub faces: &'a mut Vec<[u32; 3]>,
    /// Colours per vertex, if there are any.
    pub colours: Option<&'a mut Vec<[f32; 3]>>,
    /// Texture coordinates, if there are any.
    pub uv: Option<EditableUv<'a>>,
}

/// Texture coordinates with indices of their own.
#[derive(Debug)]
pub struct EditableUv<'a> {
    /// Coordinates.
    pub coordinates: &'a mut Vec<[f32; 2]>,
    /// Three indices of them per face.
    pub faces: &'a mut Vec<[u32; 3]>,
}

/// A mesh that was divided at a border.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Division {
    /// Whether each face lies inside.
    pub inside: Vec<bool>,
    /// The face of the mesh before that each face is a part of.
    pub source: Vec<u32>,
}

/// What is known of a face.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Unknown,
    Mixed,
    Known(bool),
}

/// Divides faces that lie on both sides of a border until their sides are at most `finest` (units of the mesh). Faces are divided from
/// edge to edge: a surface without gaps keeps none.
///
/// # Errors
/// [`Error::IndexOutOfRange`], of texture coordinates, too; [`Error::Length`] for colours or texture coordinates that are not as many as
/// vertices or faces; [`Error::Setting`] for a `finest` that is not above 0.
pub fn divide_at_border(
    mut mesh: EditableMesh,
    finest: f64,
    inside: &dyn Fn(&Sample) -> bool,
) -> Result<Division, Error> {
    mesh.check()?;
    if finest.is_nan() || finest <= 0.0 {
        return Err(Error::Setting { name: "finest", value: finest, must_be: "above 0" });
    }
    let mesh = &mut mesh;
    let mut source: Vec<u32> = (0..mesh.faces.len() as u32).collect();
    let mut side = vec![Side::Unknown; mesh.faces.len()];
    for _ in 0..ROUNDS {
        for (face, side) in side.iter_mut().enumerate().filter(|(_, side)| **side == Side::Unknown) {
            *side = classify(mesh, face, finest, inside);
        }
        let joined = same_places(mesh.positions);
        let edge = |face: usize, k: usize| {
            let [a, b] = [k, (k + 1) % 3].map(|k| joined[mesh.faces[face][k] as usize]);
            (a.min(b), a.max(b))
        };
        let mut split: HashSet<(u32, u32)> = HashSet::new();
        for face in (0..mesh.faces.len()).filter(|&f| side[f] == Side::Mixed) {
            let corners = mesh.at(face);
            let longest = (0..3).fold(0, |best, k| if corners.side(k) > corners.side(best) { k } else { best });
            if corners.side(longest) > finest {
                split.insert(edge(face, longest));
            }
        }
        if split.is_empty() {
            break;
        }
        let marked: Vec<[bool; 3]> =
            (0..mesh.faces.len()).map(|f| [0, 1, 2].map(|k| split.contains(&edge(f, k)))).collect();
        divide(mesh, &marked, &mut side, &mut source);
    }
    let inside = (0..mesh.faces.len()).map(|face| match side[face] {
        Side::Known(inside) => inside,
        _ => inside(&mesh.at(face).sample([1.0 / 3.0; 3])),
    });
    Ok(Division { inside: inside.collect(), source })
}

impl EditableMesh<'_> {
    fn check(&self) -> Result<(), Error> {
        check(self.positions, self.faces)?;
        if let Some(colours) = &self.colours
            && colours.len() != self.positions.len()
        {
            return Err(Error::Length { what: "colours", expected: self.positions.len(), found: colours.len() });
        }
        if let Some(EditableUv { coordinates, faces }) = &self.uv {
            if faces.len() != self.faces.len() {
                return Err(Error::Length { what: "uv faces", expected: self.faces.len(), found: faces.len() });
            }
            for (face, corners) in faces.iter().enumerate() {
                if let Some(&index) = corners.iter().find(|&&i| i as usize >= coordinates.len()) {
                    return Err(Error::IndexOutOfRange { face, index, vertices: coordinates.len() });
                }
            }
        }
        Ok(())
    }

    fn at(&self, face: usize) -> Corners {
        let uv = self
            .uv
            .as_ref()
            .map_or([[0.0; 2]; 3], |uv| uv.faces[face].map(|i| uv.coordinates[i as usize].map(f64::from)));
        let points = self.faces[face].map(|v| Point3::from(self.positions[v as usize].map(f64::from)));
        Corners { points, uv }
    }
}

/// The corners of a face.
struct Corners {
    points: [Point3<f64>; 3],
    uv: [[f64; 2]; 3],
}

impl Corners {
    /// Length of the side that begins at corner `k`.
    fn side(&self, k: usize) -> f64 {
        (self.points[(k + 1) % 3] - self.points[k]).norm()
    }

    fn samples(&self, finest: f64) -> Vec<Sample> {
        let longest = (0..3).map(|k| self.side(k)).fold(0.0, f64::max);
        let n = ((longest / finest).ceil() as usize).clamp(1, MOST_ALONG);
        // On the border of a face two faces decide alike only by chance.
        let drawn_in = |a: usize, b: usize| [a, b, n - a - b].map(|k| 0.998 * k as f64 / n as f64 + 0.002 / 3.0);
        let grid = (0..=n).flat_map(|a| (0..=n - a).map(move |b| (a, b)));
        let mut samples: Vec<Sample> = grid.map(|(a, b)| self.sample(drawn_in(a, b))).collect();
        samples.push(self.sample([1.0 / 3.0; 3]));
        samples
    }

    fn sample(&self, weights: [f64; 3]) -> Sample {
        let [a, b, c] = self.points.map(|p| p.coords);
        let mut uv = [0.0; 2];
        for (weight, at) in weights.iter().zip(&self.uv) {
            uv = [uv[0] + weight * at[0], uv[1] + weight * at[1]];
        }
        Sample {
            point: Point3::from(a * weights[0] + b * weights[1] + c * weights[2]),
            normal: (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default(),
            uv,
        }
    }
}

/// Places on a face with these corners, at most `finest` apart (units of the mesh): its corners among them (drawn in a little), its centre
/// last. Without texture coordinates.
pub fn samples_of_face(corners: [[f32; 3]; 3], finest: f64) -> Vec<Sample> {
    let points = corners.map(|corner| Point3::from(corner.map(f64::from)));
    Corners { points, uv: [[0.0; 2]; 3] }.samples(finest)
}

fn classify(mesh: &EditableMesh, face: usize, finest: f64, inside: &dyn Fn(&Sample) -> bool) -> Side {
    let samples = mesh.at(face).samples(finest);
    let count = samples.iter().filter(|s| inside(s)).count();
    if count > 0 && count < samples.len() { Side::Mixed } else { Side::Known(count > 0) }
}

/// Halves the marked sides (side `k` runs from corner `k` to the next); both faces of an edge have it marked, so nothing tears.
fn divide(mesh: &mut EditableMesh, marked: &[[bool; 3]], side: &mut Vec<Side>, source: &mut Vec<u32>) {
    let old = std::mem::take(mesh.faces);
    let old_source = std::mem::take(source);
    let old_side = std::mem::take(side);
    let old_uv = mesh.uv.as_mut().map(|uv| std::mem::take(uv.faces));
    let (mut vertices, mut coordinates) = (HashMap::new(), HashMap::new());
    for (f, face) in old.iter().enumerate() {
        let mut middle = [None; 3];
        let mut middle_uv = [0; 3];
        for k in (0..3).filter(|&k| marked[f][k]) {
            let next = (k + 1) % 3;
            middle[k] = Some(middle_vertex(mesh, face[k], face[next], &mut vertices));
            if let (Some(EditableUv { coordinates: known, .. }), Some(faces)) = (&mut mesh.uv, &old_uv) {
                let [a, b] = [faces[f][k], faces[f][next]];
                middle_uv[k] = *coordinates.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let [p, q] = [a, b].map(|i| known[i as usize]);
                    known.push([0, 1].map(|c| 0.5 * (p[c] + q[c])));
                    known.len() as u32 - 1
                });
            }
        }
        for pieces in pieces(middle.map(|m| m.is_some())) {
            // 0..3 are corners, 3..6 the middles of the sides.
            let vertex = |k: usize| if k < 3 { face[k] } else { middle[k - 3].unwrap_or(face[k - 3]) };
            mesh.faces.push(pieces.map(vertex));
            if let (Some(uv), Some(faces)) = (&mut mesh.uv, &old_uv) {
                uv.faces.push(pieces.map(|k| if k < 3 { faces[f][k] } else { middle_uv[k - 3] }));
            }
            source.push(old_source[f]);
            side.push(if old_side[f] == Side::Mixed && marked[f] != [false; 3] { Side::Unknown } else { old_side[f] });
        }
    }
}

fn middle_vertex(mesh: &mut EditableMesh, a: u32, b: u32, known: &mut HashMap<(u32, u32), u32>) -> u32 {
    *known.entry((a.min(b), a.max(b))).or_insert_with(|| {
        let mean = |p: [f32; 3], q: [f32; 3]| [0, 1, 2].map(|c| 0.5 * (p[c] + q[c]));
        mesh.positions.push(mean(mesh.positions[a as usize], mesh.positions[b as usize]));
        if let Some(colours) = &mut mesh.colours {
            colours.push(mean(colours[a as usize], colours[b as usize]));
        }
        mesh.positions.len() as u32 - 1
    })
}

/// The triangles of a face whose marked sides are halved, wound as it was.
fn pieces(marked: [bool; 3]) -> Vec<[usize; 3]> {
    match marked.iter().filter(|m| **m).count() {
        0 => vec![[0, 1, 2]],
        3 => vec![[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
        1 => {
            let k = marked.iter().position(|m| *m).unwrap_or(0);
            let (a, b, c) = (k, (k + 1) % 3, (k + 2) % 3);
            vec![[a, 3 + k, c], [3 + k, b, c]]
        }
        _ => {
            // The side that stays whole runs from a to b.
            let a = marked.iter().position(|m| !*m).unwrap_or(0);
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            vec![[a, b, 3 + b], [a, 3 + b, 3 + c], [3 + c, 3 + b, c]]
        }
    }
}
