//! The surface as the page takes it: little-endian.

use serde::Serialize;

use super::message::{SURFACE, with_head};
use super::session::ShownSurface;
use crate::design_places::vertex_places;
use crate::mesh_io::TriangleMesh;
use crate::mission::KnownSurface;

/// The head: counts of what follows.
#[derive(Serialize)]
struct SurfaceHead {
    surface: u64,
    /// Vertices and faces of the painted part, and of the rest.
    vertices: [usize; 2],
    faces: [usize; 2],
    /// Width and height of the plane of pictures, m.
    extent: [f64; 2],
    area_m2: f64,
}

/// What a surface looks like. Painted part: positions (3 f32), texture coordinates in metres from the lower left corner of the texels (2 f32), faces
/// (3 u32). The rest: positions, faces.
pub(super) struct Geometry {
    bytes: Vec<u8>,
    vertices: [usize; 2],
    faces: [usize; 2],
}

impl Geometry {
    pub(super) fn new(known: &KnownSurface) -> Self {
        let surface = known.surface();
        let rest = compact(known.scene().obstacles.positions.as_slice(), &known.scene().obstacles.faces);
        let (positions, faces) = (surface.vertices(), surface.disk().faces());
        let mut bytes = Vec::new();
        floats(&mut bytes, positions.as_flattened());
        pairs(&mut bytes, surface.chart.uv());
        words(&mut bytes, faces.as_flattened());
        floats(&mut bytes, rest.positions.as_flattened());
        words(&mut bytes, rest.faces.as_flattened());
        let (vertices, faces) = ([positions.len(), rest.positions.len()], [faces.len(), rest.faces.len()]);
        Self { bytes, vertices, faces }
    }

    /// The same surface to look at, whatever its texels.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.bytes == other.bytes && self.vertices == other.vertices
    }
}

/// A geometry, then metres to the right of and above the middle of the plane of pictures for each vertex of the painted part (2 f32). Beside it what the
/// session needs of it.
pub(super) fn surface_message(number: u64, known: &KnownSurface, geometry: &Geometry) -> (Vec<u8>, ShownSurface) {
    let (places, extent) = vertex_places(known.surface());
    let mut body = geometry.bytes.clone();
    pairs(&mut body, &places);
    let Geometry { vertices, faces, .. } = *geometry;
    let head = SurfaceHead { surface: number, vertices, faces, extent, area_m2: known.surface().disk().area() };
    let scene = known.scene();
    let shown = ShownSurface { number, extent, world_from_mesh: scene.world_from_mesh, origin: scene.canvas.origin };
    (with_head(SURFACE, &head, &body), shown)
}

/// A mesh without vertices that no face has.
fn compact(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> TriangleMesh {
    let mut number_of = vec![u32::MAX; positions.len()];
    let mut mesh = TriangleMesh::default();
    for face in faces {
        let corners = face.map(|corner| {
            let number = &mut number_of[corner as usize];
            if *number == u32::MAX {
                *number = mesh.positions.len() as u32;
                mesh.positions.push(positions[corner as usize]);
            }
            *number
        });
        mesh.faces.push(corners);
    }
    mesh
}

fn floats(body: &mut Vec<u8>, values: &[f32]) {
    body.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

fn pairs(body: &mut Vec<u8>, values: &[[f64; 2]]) {
    body.extend(values.iter().flatten().flat_map(|value| (*value as f32).to_le_bytes()));
}

fn words(body: &mut Vec<u8>, values: &[u32]) {
    body.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}
