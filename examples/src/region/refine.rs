//! Faces across the border of a region are divided, by halving longest sides, until they hardly matter.

use std::collections::{HashMap, HashSet};

use nalgebra::{Point3, Vector3};

use crate::mesh_io::TriangleMesh;

/// Halvings of one side at most: a wall of a kilometre to a millimetre.
const ROUNDS: usize = 64;
/// Samples along a side of a face at most.
const MOST_ALONG: usize = 400;

/// A place on a mesh.
pub(super) struct Sample {
    pub(super) point: Point3<f64>,
    /// Unit normal of the face; zero where it has none.
    pub(super) normal: Vector3<f64>,
    /// Texture coordinates; zero where there are none.
    pub(super) uv: [f64; 2],
}

/// What is known of a face.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Unknown,
    Mixed,
    Known(bool),
}

/// Divides faces that lie on both sides of a region's border until their sides are at most `finest`; which faces lie inside.
pub(super) fn refine(mesh: &mut TriangleMesh, finest: f64, inside: &dyn Fn(&Sample) -> bool) -> Vec<bool> {
    let mut side = vec![Side::Unknown; mesh.faces.len()];
    for _ in 0..ROUNDS {
        for (face, side) in side.iter_mut().enumerate().filter(|(_, side)| **side == Side::Unknown) {
            *side = classify(mesh, face, finest, inside);
        }
        let joined = same_places(mesh);
        let edge = |face: usize, k: usize| {
            let [a, b] = [k, (k + 1) % 3].map(|k| joined[mesh.faces[face][k] as usize]);
            (a.min(b), a.max(b))
        };
        let mut split: HashSet<(u32, u32)> = HashSet::new();
        for face in (0..mesh.faces.len()).filter(|&f| side[f] == Side::Mixed) {
            let length = |k: usize| (corner(mesh, face, (k + 1) % 3) - corner(mesh, face, k)).norm();
            let longest = (0..3).fold(0, |best, k| if length(k) > length(best) { k } else { best });
            if length(longest) > finest {
                split.insert(edge(face, longest));
            }
        }
        if split.is_empty() {
            break;
        }
        let marked: Vec<[bool; 3]> =
            (0..mesh.faces.len()).map(|f| [0, 1, 2].map(|k| split.contains(&edge(f, k)))).collect();
        divide(mesh, &marked, &mut side);
    }
    (0..mesh.faces.len())
        .map(|face| match side[face] {
            Side::Known(inside) => inside,
            _ => inside(&sample(mesh, face, [1.0 / 3.0; 3])),
        })
        .collect()
}

/// Places on a face, at most `finest` apart: its corners among them (drawn in a little), its centre last.
pub(super) fn samples_of_face(mesh: &TriangleMesh, face: usize, finest: f64) -> Vec<Sample> {
    let longest = (0..3).map(|k| (corner(mesh, face, (k + 1) % 3) - corner(mesh, face, k)).norm()).fold(0.0, f64::max);
    let n = ((longest / finest).ceil() as usize).clamp(1, MOST_ALONG);
    // On the border of a face two faces decide alike only by chance.
    let drawn_in = |a: usize, b: usize| [a, b, n - a - b].map(|k| 0.998 * k as f64 / n as f64 + 0.002 / 3.0);
    let grid = (0..=n).flat_map(|a| (0..=n - a).map(move |b| (a, b)));
    let mut samples: Vec<Sample> = grid.map(|(a, b)| sample(mesh, face, drawn_in(a, b))).collect();
    samples.push(sample(mesh, face, [1.0 / 3.0; 3]));
    samples
}

fn classify(mesh: &TriangleMesh, face: usize, finest: f64, inside: &dyn Fn(&Sample) -> bool) -> Side {
    let samples = samples_of_face(mesh, face, finest);
    let count = samples.iter().filter(|s| inside(s)).count();
    if count > 0 && count < samples.len() { Side::Mixed } else { Side::Known(count > 0) }
}

fn corner(mesh: &TriangleMesh, face: usize, k: usize) -> Point3<f64> {
    Point3::from(mesh.positions[mesh.faces[face][k] as usize].map(f64::from))
}

fn sample(mesh: &TriangleMesh, face: usize, weights: [f64; 3]) -> Sample {
    let [a, b, c] = [0, 1, 2].map(|k| corner(mesh, face, k).coords);
    let mut uv = [0.0; 2];
    if let Some(own) = &mesh.uv {
        for (weight, &i) in weights.iter().zip(&own.faces[face]) {
            let at = own.coordinates[i as usize];
            uv = [uv[0] + weight * f64::from(at[0]), uv[1] + weight * f64::from(at[1])];
        }
    }
    Sample {
        point: Point3::from(a * weights[0] + b * weights[1] + c * weights[2]),
        normal: (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default(),
        uv,
    }
}

/// For every vertex the first one at the same place: files double vertices along texture seams.
pub(super) fn same_places(mesh: &TriangleMesh) -> Vec<u32> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    // Zero has two bit patterns.
    let key = |p: &[f32; 3]| p.map(|c| (c + 0.0).to_bits());
    mesh.positions.iter().enumerate().map(|(k, p)| *first.entry(key(p)).or_insert(k as u32)).collect()
}

/// Halves the marked sides (side `k` runs from corner `k` to the next); both faces of an edge have it marked, so nothing tears.
fn divide(mesh: &mut TriangleMesh, marked: &[[bool; 3]], side: &mut Vec<Side>) {
    let old = std::mem::take(&mut mesh.faces);
    let old_side = std::mem::take(side);
    let old_uv = mesh.uv.as_mut().map(|uv| std::mem::take(&mut uv.faces));
    let old_materials = mesh.materials.as_mut().map(|m| std::mem::take(&mut m.faces));
    let (mut vertices, mut coordinates) = (HashMap::new(), HashMap::new());
    for (f, face) in old.iter().enumerate() {
        let mut middle = [None; 3];
        let mut middle_uv = [0; 3];
        for k in (0..3).filter(|&k| marked[f][k]) {
            let next = (k + 1) % 3;
            middle[k] = Some(middle_vertex(mesh, face[k], face[next], &mut vertices));
            if let (Some(uv), Some(faces)) = (&mut mesh.uv, &old_uv) {
                let [a, b] = [faces[f][k], faces[f][next]];
                middle_uv[k] = *coordinates.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let [p, q] = [a, b].map(|i| uv.coordinates[i as usize]);
                    uv.coordinates.push([0, 1].map(|c| 0.5 * (p[c] + q[c])));
                    uv.coordinates.len() as u32 - 1
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
            if let (Some(materials), Some(faces)) = (&mut mesh.materials, &old_materials) {
                materials.faces.push(faces[f]);
            }
            side.push(if old_side[f] == Side::Mixed && marked[f] != [false; 3] { Side::Unknown } else { old_side[f] });
        }
    }
}

fn middle_vertex(mesh: &mut TriangleMesh, a: u32, b: u32, known: &mut HashMap<(u32, u32), u32>) -> u32 {
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
