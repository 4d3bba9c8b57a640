//! The connected components of a mesh.

use crate::mesh::triangle_mesh::Mesh;

impl Mesh {
    /// The mesh without connected components of fewer than `least` triangles; all else stays in its order.
    ///
    /// Where the noise of single readings is larger than the truncation distance, some of them leave specks behind the surface, or before it,
    /// that no other reading contradicts. Thin things that were seen in pieces go with them.
    #[must_use]
    pub fn without_small_components(&self, least: usize) -> Self {
        let roots = self.roots();
        let mut triangles = vec![0_usize; self.positions.len()];
        for face in &self.faces {
            triangles[roots[face[0] as usize] as usize] += 1;
        }
        let mut kept = Self::default();
        let mut names = vec![u32::MAX; self.positions.len()];
        for face in self.faces.iter().filter(|face| triangles[roots[face[0] as usize] as usize] >= least) {
            kept.faces.push(face.map(|vertex| {
                let k = vertex as usize;
                if names[k] == u32::MAX {
                    names[k] = kept.positions.len() as u32;
                    kept.positions.push(self.positions[k]);
                    kept.normals.push(self.normals[k]);
                    kept.colours.push(self.colours[k]);
                }
                names[k]
            }));
        }
        kept
    }

    /// For each vertex one of its component, the same for all of them.
    fn roots(&self) -> Vec<u32> {
        let mut parents: Vec<u32> = (0..self.positions.len() as u32).collect();
        for &[a, b, c] in &self.faces {
            for other in [b, c] {
                let (from, to) = (root(&mut parents, a), root(&mut parents, other));
                // The lower one stays, so that the order of the faces plays no part.
                parents[from.max(to) as usize] = from.min(to);
            }
        }
        (0..self.positions.len() as u32).map(|vertex| root(&mut parents, vertex)).collect()
    }
}

/// The root of a vertex; halves the way there.
fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        let above = parents[parents[vertex as usize] as usize];
        parents[vertex as usize] = above;
        vertex = above;
    }
    vertex
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of triangles along x, from a first vertex on.
    fn strip(mesh: &mut Mesh, triangles: u32, reversed: bool) {
        let first = mesh.positions.len() as u32;
        for k in 0..triangles + 2 {
            mesh.positions.push([k as f32, (k % 2) as f32, first as f32]);
            mesh.normals.push([0.0, 0.0, first as f32]);
            mesh.colours.push([first as u8; 3]);
        }
        let mut faces: Vec<[u32; 3]> = (0..triangles).map(|k| [0, 1, 2].map(|n| first + k + n)).collect();
        if reversed {
            faces.reverse();
        }
        mesh.faces.extend(faces);
    }

    #[test]
    fn components_of_fewer_triangles_go() {
        let mut mesh = Mesh::default();
        for (triangles, reversed) in [(1, false), (40, true), (4, false), (5, true)] {
            strip(&mut mesh, triangles, reversed);
        }
        // Two strips that meet in one vertex are one.
        strip(&mut mesh, 3, false);
        let last = mesh.positions.len() as u32 - 1;
        strip(&mut mesh, 2, true);
        let (beside, faces) = (last + 1, mesh.faces.len());
        mesh.faces[faces - 1] = mesh.faces[faces - 1].map(|k| if k == beside { last } else { k });
        let kept = mesh.without_small_components(5);
        assert_eq!(kept.faces.len(), 40 + 5 + 5);
        // Each corner has the place, the normal and the colour that it had.
        let corners = |mesh: &Mesh, from: usize, count: usize| -> Vec<([f32; 3], [f32; 3], [u8; 3])> {
            let all = mesh.faces[from..from + count].iter().flatten().map(|&k| k as usize);
            all.map(|k| (mesh.positions[k], mesh.normals[k], mesh.colours[k])).collect()
        };
        assert_eq!(corners(&kept, 0, 40), corners(&mesh, 1, 40));
        assert_eq!(corners(&kept, 40, 10), corners(&mesh, 45, 10));
        // The one vertex is not there twice.
        assert_eq!(kept.positions.len(), 42 + 7 + 5 + 4 - 1);
        assert_eq!(mesh.without_small_components(0).faces.len(), mesh.faces.len());
        assert_eq!(mesh.without_small_components(41), Mesh::default());
    }
}
