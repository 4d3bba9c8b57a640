//! Any triangle mesh as oriented, edge-manifold pieces: what an atlas is made of.

pub mod file_frame;

use nalgebra::Vector3;

use crate::decimate::decimate;
use crate::disk::Disk;
use crate::error::Error;
use crate::half_edges::{BORDER, EdgeTable, half_edge};
use crate::polygon_soup::{check, faces_with_shape, find_root, weld};
use crate::triangle;

/// What [`Surface::new`] found and changed. Nothing of it moves a vertex.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct SurfaceReport {
    /// Parts that share no edge.
    pub parts: usize,
    /// Vertices that no face uses.
    pub unreferenced_vertices: usize,
    /// Faces with a repeated corner or without area; they are left out.
    pub degenerate_faces_dropped: usize,
    /// Faces with the same three corners as an earlier one; they are left out.
    pub duplicate_faces_dropped: usize,
    /// Vertices whose faces are joined to those of another one at the same position.
    pub welded_vertices: usize,
    /// Edges with three faces or more: opened, every face has a border there.
    pub non_manifold_edges_opened: usize,
    /// Edges opened because the surface would have one side only.
    pub one_sided_edges_opened: usize,
    /// Faces whose winding disagreed with the rest of their part and was reversed.
    pub reversed_faces: usize,
}

/// A triangle mesh of any topology whose faces agree in winding within every part, and whose edges have one or two faces.
/// Vertices keep their indices and places; only faces are left out.
///
/// Half-edge `3 f + k` runs from corner `k` of face `f` to corner `(k + 1) % 3`.
#[derive(Debug, Clone)]
pub struct Surface {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    face_source: Vec<u32>,
    reversed: Vec<bool>,
    twins: Vec<u32>,
    part: Vec<u32>,
    parts: usize,
    source_faces: usize,
}

impl Surface {
    /// The faces of a mesh (metres) that have a shape, made edge-manifold and oriented. `join` treats vertices at exactly
    /// the same position as one: files often split vertices along texture seams, and the surface goes on there.
    ///
    /// # Errors
    /// [`Error::Empty`], [`Error::TooLarge`], [`Error::IndexOutOfRange`], [`Error::NonFinite`], [`Error::ZeroArea`].
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]], join: bool) -> Result<(Self, SurfaceReport), Error> {
        let mut report = SurfaceReport { unreferenced_vertices: check(positions, faces)?, ..SurfaceReport::default() };
        let mut soup: Vec<[u32; 3]> = faces.to_vec();
        if join {
            report.welded_vertices = weld(positions, &mut soup);
        }
        let shaped = faces_with_shape(positions, &soup);
        (report.degenerate_faces_dropped, report.duplicate_faces_dropped) = (shaped.degenerate, shaped.duplicate);
        if shaped.kept.is_empty() {
            return Err(Error::ZeroArea);
        }
        let mut kept: Vec<[u32; 3]> = shaped.kept.iter().map(|&f| soup[f as usize]).collect();
        let mut twins = pair_half_edges(positions.len(), &kept, &mut report);
        let reversed = orient(positions, &mut kept, &mut twins, &mut report);
        let (part, parts) = parts_of(&twins);
        report.parts = parts;
        let surface = Self {
            positions: positions.to_vec(),
            faces: kept,
            face_source: shaped.kept,
            reversed,
            twins,
            part,
            parts,
            source_faces: faces.len(),
        };
        Ok((surface, report))
    }

    /// Positions of the input, metres, all of them.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Corner indices into [`Self::positions`]; where vertices were joined, of the first vertex at the position.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Input face of every face.
    pub fn face_source(&self) -> &[u32] {
        &self.face_source
    }

    /// Faces of the input, left out ones included.
    pub fn source_face_count(&self) -> usize {
        self.source_faces
    }

    /// Which corner (0, 1, 2) of the input face corner `k` of `face` was: they differ where the winding was reversed.
    pub fn source_corner(&self, face: usize, k: usize) -> usize {
        if self.reversed[face] { [0, 2, 1][k] } else { k }
    }

    /// The half-edge on the other side of half-edge `h`, `None` on the boundary.
    pub fn twin(&self, h: usize) -> Option<usize> {
        (self.twins[h] != BORDER).then(|| self.twins[h] as usize)
    }

    /// Part that a face belongs to, `0..part_count`, in the order of their first faces.
    pub fn part(&self, face: usize) -> usize {
        self.part[face] as usize
    }

    /// Number of parts that share no edge.
    pub fn part_count(&self) -> usize {
        self.parts
    }

    /// Area of one face, m^2.
    pub fn face_area(&self, face: usize) -> f64 {
        0.5 * self.face_cross(face).norm()
    }

    /// Area of all faces, m^2.
    pub fn area(&self) -> f64 {
        (0..self.faces.len()).map(|f| self.face_area(f)).sum()
    }

    pub(crate) fn face_cross(&self, face: usize) -> Vector3<f64> {
        triangle::cross(self.corners(face))
    }

    pub(crate) fn corners(&self, face: usize) -> [[f64; 3]; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    /// From the start to the end of half-edge `h`.
    pub(crate) fn edge(&self, h: usize) -> Vector3<f64> {
        let corners = self.corners(h / 3).map(Vector3::from);
        corners[(h + 1) % 3] - corners[h % 3]
    }

    /// Start and end vertex of half-edge `h`.
    pub(crate) fn ends(&self, h: usize) -> [u32; 2] {
        let (a, b) = half_edge(&self.faces, h);
        [a, b]
    }

    /// A surface of about `target` faces whose vertices are some of these, with the same topology; edges for which `kept` holds stay. Also, for
    /// every half-edge of it, one of this surface for which `kept` is the same, and for every vertex the one onto which it went.
    pub(crate) fn coarser(&self, kept: impl Fn(usize) -> bool, target: usize) -> (Self, Vec<u32>, Vec<u32>) {
        let mut pinned = vec![false; self.positions.len()];
        for h in (0..self.twins.len()).filter(|&h| kept(h)) {
            for v in self.ends(h) {
                pinned[v as usize] = true;
            }
        }
        let found = decimate(&self.positions, &self.faces, &self.twins, pinned, target);
        let count = found.faces.len();
        let surface = Self {
            positions: self.positions.clone(),
            face_source: (0..count as u32).collect(),
            reversed: vec![false; count],
            part: (0..count).map(|f| self.part[found.half_edge_source[3 * f] as usize / 3]).collect(),
            parts: self.parts,
            source_faces: count,
            faces: found.faces,
            twins: found.twins,
        };
        (surface, found.half_edge_source, found.root)
    }

    /// Some faces as a surface of their own, open along the half-edges for which `seam` holds; `None` unless they can be laid
    /// out in the plane (in one piece, without handles, with a boundary).
    pub(crate) fn disk(&self, faces: &[u32], seam: impl Fn(usize) -> bool, lookup: &mut FaceLookup) -> Option<Disk> {
        Some(self.piece(faces, seam, lookup)).filter(Disk::is_planar)
    }

    /// The same, whatever its shape.
    pub(crate) fn piece(&self, faces: &[u32], seam: impl Fn(usize) -> bool, lookup: &mut FaceLookup) -> Disk {
        lookup.set(faces);
        let mut twins = vec![BORDER; 3 * faces.len()];
        let mut glued = twins.clone();
        for (local, &f) in faces.iter().enumerate() {
            for k in 0..3 {
                let h = 3 * f as usize + k;
                let Some(twin) = self.twin(h) else { continue };
                let Some(other) = lookup.get(twin / 3) else { continue };
                let twin_here = (3 * other + twin % 3) as u32;
                glued[3 * local + k] = twin_here;
                if !seam(h) {
                    twins[3 * local + k] = twin_here;
                }
            }
        }
        lookup.clear(faces);
        let reversed = faces.iter().map(|&f| self.reversed[f as usize]).collect();
        let source = faces.iter().map(|&f| self.face_source[f as usize]).collect();
        let corners: Vec<[u32; 3]> = faces.iter().map(|&f| self.faces[f as usize]).collect();
        Disk::from_faces(&self.positions, &corners, twins, glued, source, reversed, self.source_faces)
    }
}

/// Place of a face in a list, for one list at a time: as large as the surface, so that it is made once.
pub(crate) struct FaceLookup(Vec<u32>);

impl FaceLookup {
    pub(crate) fn new(surface: &Surface) -> Self {
        Self(vec![BORDER; surface.faces.len()])
    }

    pub(crate) fn set(&mut self, faces: &[u32]) {
        for (local, &f) in faces.iter().enumerate() {
            self.0[f as usize] = local as u32;
        }
    }

    pub(crate) fn clear(&mut self, faces: &[u32]) {
        for &f in faces {
            self.0[f as usize] = BORDER;
        }
    }

    pub(crate) fn get(&self, face: usize) -> Option<usize> {
        (self.0[face] != BORDER).then(|| self.0[face] as usize)
    }
}

/// Half-edges that share an edge with exactly one other.
fn pair_half_edges(vertices: usize, faces: &[[u32; 3]], report: &mut SurfaceReport) -> Vec<u32> {
    let mut twins = vec![BORDER; 3 * faces.len()];
    for group in EdgeTable::new(vertices, faces).groups() {
        if let &[h, g] = group {
            (twins[h as usize], twins[g as usize]) = (g, h);
        } else if group.len() > 2 {
            report.non_manifold_edges_opened += 1;
        }
    }
    twins
}

/// Makes the winding of every part consistent, with the side that has more area; opens edges at which no winding fits.
fn orient(positions: &[[f64; 3]], faces: &mut [[u32; 3]], twins: &mut [u32], report: &mut SurfaceReport) -> Vec<bool> {
    let mut reversed: Vec<Option<bool>> = vec![None; faces.len()];
    let mut members = Vec::new();
    for start in 0..faces.len() {
        if reversed[start].is_some() {
            continue;
        }
        reversed[start] = Some(false);
        members.clear();
        members.push(start);
        let mut next = 0;
        // Breadth first: contradictions are met far from the start, where the two ways around meet.
        while let Some(&f) = members.get(next) {
            next += 1;
            for h in 3 * f..3 * f + 3 {
                if twins[h] == BORDER {
                    continue;
                }
                let other = twins[h] as usize;
                let same_direction = half_edge(faces, h).0 == half_edge(faces, other).0;
                let wanted = reversed[f].map(|r| r ^ same_direction);
                let g = other / 3;
                if reversed[g].is_none() {
                    reversed[g] = wanted;
                    members.push(g);
                } else if reversed[g] != wanted {
                    (twins[h], twins[other]) = (BORDER, BORDER);
                    report.one_sided_edges_opened += 1;
                }
            }
        }
        let area = |f: usize| triangle::cross(faces[f].map(|v| positions[v as usize])).norm();
        let signed: f64 = members.iter().map(|&f| if reversed[f] == Some(true) { -area(f) } else { area(f) }).sum();
        if signed < 0.0 {
            for &f in &members {
                reversed[f] = reversed[f].map(|r| !r);
            }
        }
    }
    let reversed: Vec<bool> = reversed.into_iter().map(|r| r == Some(true)).collect();
    report.reversed_faces = reversed.iter().filter(|&&r| r).count();
    let moved = |h: u32| if reversed[h as usize / 3] { h / 3 * 3 + 2 - h % 3 } else { h };
    let old = twins.to_vec();
    for (h, &twin) in old.iter().enumerate() {
        twins[moved(h as u32) as usize] = if twin == BORDER { BORDER } else { moved(twin) };
    }
    for (face, _) in faces.iter_mut().zip(&reversed).filter(|(_, r)| **r) {
        face.swap(1, 2);
    }
    reversed
}

/// Part of every face, numbered by first faces, and how many there are.
fn parts_of(twins: &[u32]) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..twins.len() as u32 / 3).collect();
    for (h, &twin) in twins.iter().enumerate().filter(|(_, twin)| **twin != BORDER) {
        let (a, b) = (find_root(&mut parent, h as u32 / 3), find_root(&mut parent, twin / 3));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut number = vec![BORDER; parent.len()];
    let mut count = 0;
    let part = (0..parent.len() as u32)
        .map(|f| {
            let root = find_root(&mut parent, f) as usize;
            if number[root] == BORDER {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect();
    (part, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps around a torus, both ways.
    const STEPS: u32 = 40;

    fn torus() -> Surface {
        let at = |i: u32, j: u32| (i % STEPS) * STEPS + j % STEPS;
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for (i, j) in (0..STEPS * STEPS).map(|k| (k / STEPS, k % STEPS)) {
            let [u, v] = [i, j].map(|k| f64::from(k) * std::f64::consts::TAU / f64::from(STEPS));
            positions.push([(2.0 + v.cos()) * u.cos(), (2.0 + v.cos()) * u.sin(), v.sin()]);
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        Surface::new(&positions, &faces, true).unwrap().0
    }

    #[test]
    fn a_coarser_torus_is_a_torus_with_the_wanted_edges() {
        let fine = torus();
        let around = |h: usize| fine.ends(h).iter().all(|v| v / STEPS == 5);
        let (coarse, sources, roots) = fine.coarser(around, 700);
        let count = coarse.faces().len();
        assert!((500..=700).contains(&count), "{count}");
        // Every edge has two faces that run along it in opposite directions.
        for h in 0..3 * count {
            let twin = coarse.twin(h).unwrap();
            assert_eq!(coarse.twin(twin), Some(h));
            let [a, b] = coarse.ends(h);
            assert_eq!(coarse.ends(twin), [b, a]);
        }
        // One handle: V - E + F = 0.
        let mut used: Vec<u32> = coarse.faces().iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        assert_eq!(used.len() + count, 3 * count / 2);
        assert!(roots.iter().all(|root| used.binary_search(root).is_ok()));
        let kept = (0..3 * count).filter(|&h| around(sources[h] as usize)).collect::<Vec<_>>();
        assert_eq!(kept.len(), 2 * STEPS as usize);
        assert!(kept.iter().all(|&h| coarse.ends(h).iter().all(|v| v / STEPS == 5)));
        // A torus of these radii; the coarse one is inscribed.
        let exact = 8.0 * std::f64::consts::PI.powi(2);
        assert!(coarse.area() < exact && coarse.area() > 0.93 * exact, "{}", coarse.area() / exact);
    }

    /// A flat sheet with a hole of three edges: it must not shrink to two edges between the same vertices.
    #[test]
    fn a_hole_keeps_three_edges() {
        let n = 12_u32;
        let at = |i: u32, j: u32| i * (n + 1) + j;
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
            positions.push([f64::from(i), f64::from(j), 0.0]);
            if i < n && j < n {
                faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                if (i, j) != (6, 5) {
                    faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
        let (fine, _) = Surface::new(&positions, &faces, true).unwrap();
        let (coarse, _, _) = fine.coarser(|_| false, 10);
        assert!(coarse.faces().len() < 60, "{}", coarse.faces().len());
        let mut border: Vec<[u32; 2]> = (0..3 * coarse.faces().len())
            .filter(|&h| coarse.twin(h).is_none())
            .map(|h| coarse.ends(h))
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        let count = border.len();
        border.sort_unstable();
        border.dedup();
        assert!(border.len() == count && count >= 6, "{count} edges of the border, {} of them different", border.len());
    }
}
