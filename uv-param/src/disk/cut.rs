//! Opening a disk along its edges.

use super::adjacency::{boundary_loops, fans, half_edge};
use super::{BORDER, Disk};
use crate::error::Error;

impl Disk {
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
