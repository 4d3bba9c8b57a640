//! The checked surface: one orientable, manifold piece of genus 0 with a boundary, and cuts along its edges.

use crate::error::Error;
use crate::half_edges::{BORDER, boundary_loops, fans, half_edge};
use crate::triangle::{self, Frame};

/// A triangle mesh that can be laid out in the plane: connected, manifold, consistently oriented, genus 0, at least one
/// boundary loop, no degenerate face. Made by [`largest_disk`](crate::largest_disk); vertices keep their order and are never moved or merged
/// (unless [`Repair::weld`](crate::disk::Repair::weld) asks).
///
/// Half-edge `3 f + k` runs from corner `k` of face `f` to corner `(k + 1) % 3`.
#[derive(Debug, Clone, PartialEq)]
pub struct Disk {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    pub(crate) vertex_source: Vec<u32>,
    pub(crate) face_source: Vec<u32>,
    pub(crate) reversed: Vec<bool>,
    /// Neighbours in the chart: seams count as border.
    pub(crate) twins: Vec<u32>,
    /// Neighbours on the surface, whether cut apart or not.
    pub(super) glued: Vec<u32>,
    /// The vertices that cuts added, at the end of the list: the vertex that each was split from.
    pub(super) copies: Vec<u32>,
    pub(super) cuts: usize,
    pub(crate) loops: Vec<Vec<u32>>,
    pub(crate) source_vertices: usize,
    pub(crate) source_faces: usize,
}

impl Disk {
    /// Vertex positions in the frame and unit (metres) of the input.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Corner indices into [`Self::positions`], counter-clockwise seen from the side the normals point to.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Input vertex of each disk vertex.
    pub fn vertex_source(&self) -> &[u32] {
        &self.vertex_source
    }

    /// Input face of each disk face.
    pub fn face_source(&self) -> &[u32] {
        &self.face_source
    }

    /// Which corner (0, 1, 2) of the input face corner `k` of disk face `face` was: they differ where the winding of
    /// the input was reversed.
    pub fn source_corner(&self, face: usize, k: usize) -> usize {
        if self.reversed[face] { [0, 2, 1][k] } else { k }
    }

    /// Boundary loops as vertex indices in the direction of their faces; the longest (in metres) first.
    pub fn boundary_loops(&self) -> &[Vec<u32>] {
        &self.loops
    }

    /// The half-edge on the other side of half-edge `h`, `None` on the boundary.
    pub fn twin(&self, h: usize) -> Option<usize> {
        (self.twins[h] != BORDER).then(|| self.twins[h] as usize)
    }

    /// The half-edge that touches half-edge `h` across a seam: neighbours on the surface that [`Self::cut`] took apart in
    /// the chart. `None` inside and on the boundary of the surface itself.
    pub fn across_seam(&self, h: usize) -> Option<usize> {
        (self.twins[h] == BORDER && self.glued[h] != BORDER).then(|| self.glued[h] as usize)
    }

    /// Number of cuts made.
    pub fn cuts(&self) -> usize {
        self.cuts
    }

    /// Length of all seams on the surface, metres; each is counted once.
    pub fn seam_length(&self) -> f64 {
        let seams = (0..self.twins.len()).filter(|&h| self.across_seam(h).is_some_and(|other| h < other));
        seams.map(|h| self.edge(h).norm()).fold(0.0, |sum, length| sum + length)
    }

    /// Length of a closed line of vertices, metres.
    pub(crate) fn loop_length(&self, vertices: &[u32]) -> f64 {
        let at = |v: u32| nalgebra::Vector3::from(self.positions[v as usize]);
        let next = vertices.iter().cycle().skip(1);
        vertices.iter().zip(next).map(|(&a, &b)| (at(a) - at(b)).norm()).sum()
    }

    /// Faces of a larger surface, neighbours (`twins`) and glued seams given, corners numbered as there. Every fan of faces gets a
    /// vertex of its own; those that seams parted from another stand at the end. Not asked: whether it is a disk.
    pub(crate) fn from_faces(
        positions: &[[f64; 3]],
        corners: &[[u32; 3]],
        twins: Vec<u32>,
        glued: Vec<u32>,
        face_source: Vec<u32>,
        reversed: Vec<bool>,
        source_faces: usize,
    ) -> Self {
        let (fan_of_corner, fan_source) = fans(corners, &twins);
        // The fan that each fan is part of when seams are shut, and the first fan of each.
        let (whole_of_corner, wholes) = fans(corners, &glued);
        let mut first_fan = vec![BORDER; wholes.len()];
        let mut whole_of_fan = vec![BORDER; fan_source.len()];
        for (&fan, &whole) in fan_of_corner.iter().zip(&whole_of_corner) {
            whole_of_fan[fan as usize] = whole;
            let first = &mut first_fan[whole as usize];
            *first = (*first).min(fan);
        }
        let is_copy = |fan: u32| first_fan[whole_of_fan[fan as usize] as usize] != fan;
        let mut order: Vec<u32> = (0..fan_source.len() as u32).collect();
        order.sort_unstable_by_key(|&fan| (is_copy(fan), fan_source[fan as usize], fan));
        let mut rank = vec![0u32; order.len()];
        for (new, &fan) in order.iter().enumerate() {
            rank[fan as usize] = new as u32;
        }
        let original = |fan: u32| rank[first_fan[whole_of_fan[fan as usize] as usize] as usize];
        let copies = order.iter().filter(|&&fan| is_copy(fan)).map(|&fan| original(fan)).collect();
        let renumbered = |f: usize| [0, 1, 2].map(|k| rank[fan_of_corner[3 * f + k] as usize]);
        let faces: Vec<[u32; 3]> = (0..corners.len()).map(renumbered).collect();
        let vertex_source: Vec<u32> = order.iter().map(|&fan| fan_source[fan as usize]).collect();
        let loops = boundary_loops(vertex_source.len(), &faces, &twins);
        let mut disk = Self {
            positions: vertex_source.iter().map(|&v| positions[v as usize]).collect(),
            faces,
            vertex_source,
            face_source,
            reversed,
            twins,
            glued,
            copies,
            cuts: 0,
            loops,
            source_vertices: positions.len(),
            source_faces,
        };
        disk.sort_loops();
        disk
    }

    /// Some of its faces, in any number of pieces; sources of vertices and faces are those of the whole.
    pub(crate) fn part(&self, wanted: &[bool]) -> Self {
        let faces: Vec<usize> = (0..wanted.len()).filter(|&f| wanted[f]).collect();
        let mut local = vec![BORDER; wanted.len()];
        for (i, &f) in faces.iter().enumerate() {
            local[f] = i as u32;
        }
        let half_edges = faces.iter().flat_map(|&f| 3 * f..3 * f + 3);
        let twin = |h: usize| match self.twins[h] {
            BORDER => BORDER,
            twin if local[twin as usize / 3] == BORDER => BORDER,
            twin => 3 * local[twin as usize / 3] + twin % 3,
        };
        let twins: Vec<u32> = half_edges.map(twin).collect();
        let corners: Vec<[u32; 3]> = faces.iter().map(|&f| self.faces[f]).collect();
        let source = faces.iter().map(|&f| f as u32).collect();
        let reversed = faces.iter().map(|&f| self.reversed[f]).collect();
        Self::from_faces(&self.positions, &corners, twins.clone(), twins, source, reversed, wanted.len())
    }

    /// Whether it can be laid out in the plane, if it is in one piece.
    pub(crate) fn is_planar(&self) -> bool {
        !self.loops.is_empty() && self.euler_characteristic() + self.loops.len() as isize == 2
    }

    pub(super) fn sort_loops(&mut self) {
        let mut loops = std::mem::take(&mut self.loops);
        loops.sort_by(|a, b| self.loop_length(b).total_cmp(&self.loop_length(a)));
        self.loops = loops;
    }

    /// From the start to the end of half-edge `h`.
    pub(crate) fn edge(&self, h: usize) -> nalgebra::Vector3<f64> {
        let corners = self.corners(h / 3).map(nalgebra::Vector3::from);
        corners[(h + 1) % 3] - corners[h % 3]
    }

    /// For every vertex after the first `count` the vertex that it was split from by the cut that added it.
    pub(crate) fn copied_after(&self, count: usize) -> &[u32] {
        &self.copies[count - self.uncut_vertex_count()..]
    }

    /// One name for all copies of a vertex on the two sides of seams.
    pub(crate) fn uncut_vertex(&self, mut v: u32) -> u32 {
        while let Some(copy) = (v as usize).checked_sub(self.uncut_vertex_count()) {
            v = self.copies[copy];
        }
        v
    }

    fn uncut_vertex_count(&self) -> usize {
        self.positions.len() - self.copies.len()
    }

    /// Number of vertices of the mesh this disk was taken from.
    pub fn source_vertex_count(&self) -> usize {
        self.source_vertices
    }

    /// Number of faces of the mesh this disk was taken from.
    pub fn source_face_count(&self) -> usize {
        self.source_faces
    }

    /// Surface area in m^2.
    pub fn area(&self) -> f64 {
        (0..self.faces.len()).map(|f| self.face_area(f)).sum()
    }

    /// Area of one face in m^2.
    pub fn face_area(&self, face: usize) -> f64 {
        0.5 * self.face_cross(face).norm()
    }

    /// Cross product of the first two edges of a face: twice its area along its normal.
    pub(crate) fn face_cross(&self, face: usize) -> nalgebra::Vector3<f64> {
        triangle::cross(self.corners(face))
    }

    /// Every face laid isometrically into a plane of its own.
    pub(crate) fn frames(&self) -> Vec<Frame> {
        (0..self.faces.len()).map(|f| Frame::new(self.corners(f))).collect()
    }

    pub(crate) fn corners(&self, face: usize) -> [[f64; 3]; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    /// Turns the surface inside out: every normal points to the other side (and the layout is mirrored).
    pub fn reverse(&mut self) {
        for (f, face) in self.faces.iter_mut().enumerate() {
            face.swap(1, 2);
            self.reversed[f] = !self.reversed[f];
        }
        // Half-edge k of a reversed face runs along the old half-edge [2, 1, 0][k].
        let moved = |h: u32| h / 3 * 3 + (2 - h % 3);
        for twins in [&mut self.twins, &mut self.glued] {
            let old = twins.clone();
            for (h, &twin) in old.iter().enumerate() {
                twins[moved(h as u32) as usize] = if twin == BORDER { BORDER } else { moved(twin) };
            }
        }
        for vertices in &mut self.loops {
            vertices.reverse();
        }
    }

    /// The same surface with a seam along a path of vertices, each joined to the next by an edge. Faces, positions and
    /// area stay as they are; vertices that the seam passes are doubled, the copies stand at the end of the list and keep
    /// their [`Self::vertex_source`]. Edges of the path that lie on the boundary need no cut and get none: a path
    /// may lead along a hole, which it opens.
    ///
    /// # Errors
    /// [`Error::Cut`] if two vertices of the path share no edge, if nothing would open, or if the surface would fall apart.
    pub fn cut(&self, path: &[u32]) -> Result<Self, Error> {
        let mut disk = self.clone();
        disk.open_edges(path)?;
        let (fan_of_corner, vertex_of_fan) = fans(&disk.faces, &disk.twins);
        let mut seen = vec![false; disk.positions.len()];
        let mut name_of_fan = Vec::with_capacity(vertex_of_fan.len());
        for vertex in vertex_of_fan {
            let v = vertex as usize;
            if !std::mem::replace(&mut seen[v], true) {
                name_of_fan.push(vertex);
                continue;
            }
            name_of_fan.push(disk.positions.len() as u32);
            disk.positions.push(self.positions[v]);
            disk.vertex_source.push(self.vertex_source[v]);
            disk.copies.push(vertex);
        }
        for (corner, &fan) in fan_of_corner.iter().enumerate() {
            disk.faces[corner / 3][corner % 3] = name_of_fan[fan as usize];
        }
        disk.loops = boundary_loops(disk.positions.len(), &disk.faces, &disk.twins);
        disk.sort_loops();
        disk.cuts += 1;
        disk.check_whole(path)?;
        Ok(disk)
    }

    /// Euler characteristic: vertices - edges + faces; 1 for a disk, one less for every hole.
    pub fn euler_characteristic(&self) -> isize {
        let border = self.twins.iter().filter(|&&t| t == BORDER).count();
        let edges = usize::midpoint(self.twins.len(), border);
        self.positions.len() as isize - edges as isize + self.faces.len() as isize
    }

    fn open_edges(&mut self, path: &[u32]) -> Result<(), Error> {
        let mut wanted: Vec<(u32, u32, usize)> =
            path.windows(2).enumerate().map(|(i, e)| (e[0].min(e[1]), e[0].max(e[1]), i)).collect();
        wanted.sort_unstable();
        let mut found = vec![false; wanted.len()];
        let mut opened = false;
        for h in 0..self.twins.len() {
            let (a, b) = half_edge(&self.faces, h);
            let edge = (a.min(b), a.max(b));
            let same = wanted.partition_point(|&(a, b, _)| (a, b) < edge);
            for (at, _) in wanted.iter().enumerate().skip(same).take_while(|(_, w)| (w.0, w.1) == edge) {
                found[at] = true;
                opened |= self.twins[h] != BORDER;
                self.twins[h] = BORDER;
            }
        }
        if let Some(at) = found.iter().position(|f| !f) {
            return Err(Error::Cut { index: wanted[at].2, problem: "no edge joins it to the next; list neighbours" });
        }
        if !opened {
            return Err(Error::Cut { index: 0, problem: "it has no edge inside the surface; lead it inwards" });
        }
        Ok(())
    }

    /// Cuts cannot add handles, so that the Euler characteristic tells whether the surface is in one piece.
    fn check_whole(&self, path: &[u32]) -> Result<(), Error> {
        let last = path.len() - 1;
        if self.euler_characteristic() + self.loops.len() as isize != 2 {
            return Err(Error::Cut { index: last, problem: "it would cut off a part; end it inside" });
        }
        // A single edge that touches no boundary: its ends have no second fan to part with.
        let shut = |h: usize| self.across_seam(h).is_some_and(|other| half_edge_ends_meet(&self.faces, h, other));
        if (0..self.twins.len()).any(shut) {
            return Err(Error::Cut {
                index: last,
                problem: "an edge alone inside does not open; make the path longer",
            });
        }
        Ok(())
    }
}

/// Whether two half-edges join the same two vertices.
fn half_edge_ends_meet(faces: &[[u32; 3]], h: usize, other: usize) -> bool {
    let (a, b) = half_edge(faces, h);
    half_edge(faces, other) == (b, a)
}
