//! Triangle meshes from files: OBJ (with texture coordinates and materials), glTF, PLY (all encodings, vertex colours), STL, OFF; and
//! the painted surface back out as PLY.

mod fault;
mod gltf;
mod material;
mod mesh;
mod mtl;
mod obj;
mod off;
mod ply;
mod stl;

use std::path::{Path, PathBuf};

pub use material::{MaterialError, MeshMaterial, MeshMaterials, TextureSource};
pub use mesh::{MeshUv, TriangleMesh};
pub use ply::{PlyMesh, write_ply};

pub(crate) use gltf::GENERATOR;

use fault::Fault;
use mesh::Parsed;
use uv_param::surface::file_frame::{Recentred, recentre};

/// What is wrong with a mesh file.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file cannot be opened or read.
    #[error("{path}: cannot be read ({source}): check the path and its permissions")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The extension is not one of ours.
    #[error("{path}: extension is not .obj, .glb, .gltf, .ply, .stl or .off: convert the mesh to one of these")]
    UnknownExtension {
        /// The file.
        path: PathBuf,
    },
    /// The text does not follow the format.
    #[error("{path}, {place}: {what}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line or element.
        place: String,
        /// What is wrong and what was expected.
        what: String,
    },
    /// There is nothing to paint in it.
    #[error("{path}: holds {vertices} vertices and no triangle: export a mesh with faces")]
    Empty {
        /// The file.
        path: PathBuf,
        /// Vertices found.
        vertices: usize,
    },
    /// What it holds cannot be kept.
    #[error("{path}: {source}")]
    Unkept {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: uv_param::Error,
    },
}

/// Reads a mesh; the extension decides the format.
pub fn read_mesh(path: &Path) -> Result<TriangleMesh, MeshError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let parse: fn(&[u8], &Path) -> Result<Parsed, Fault> = match extension.as_str() {
        "glb" | "gltf" => gltf::parse,
        "obj" => obj::parse,
        "off" => |bytes, _| off::parse(bytes),
        "ply" => |bytes, _| ply::parse(bytes),
        "stl" => |bytes, _| stl::parse(bytes),
        _ => return Err(MeshError::UnknownExtension { path: path.into() }),
    };
    let bytes = std::fs::read(path).map_err(|source| MeshError::Unreadable { path: path.into(), source })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let Parsed { mut mesh, points } = parse(&bytes, folder).map_err(|Fault { place, what }| MeshError::Malformed {
        path: path.into(),
        place,
        what,
    })?;
    if mesh.faces.is_empty() {
        return Err(MeshError::Empty { path: path.into(), vertices: points.len() });
    }
    let Recentred { origin, positions } =
        recentre(&points, &mesh.faces).map_err(|source| MeshError::Unkept { path: path.into(), source })?;
    if origin != [0.0; 3] {
        let [x, y, z] = origin;
        mesh.notes
            .push(format!("lies far from the origin of its coordinates: moved by {x}, {y}, {z} while it is worked on"));
    }
    mesh.origin = origin;
    mesh.positions = positions;
    Ok(mesh)
}
