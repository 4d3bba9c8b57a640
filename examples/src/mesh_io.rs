//! Triangle meshes from files: OBJ (with or without texture coordinates), PLY (all encodings, vertex colours), OFF; and
//! the painted surface back out as PLY.

mod fault;
mod mesh;
mod obj;
mod off;
mod ply;

use std::path::{Path, PathBuf};

pub use mesh::{MeshUv, TriangleMesh};
pub use ply::{PlyMesh, write_ply};

use fault::Fault;

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
    #[error("{path}: extension is not .obj, .ply or .off: convert the mesh to one of these")]
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
}

/// Reads a mesh; the extension decides the format.
pub fn read_mesh(path: &Path) -> Result<TriangleMesh, MeshError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let parse = match extension.as_str() {
        "obj" => obj::parse,
        "off" => off::parse,
        "ply" => ply::parse,
        _ => return Err(MeshError::UnknownExtension { path: path.into() }),
    };
    let bytes = std::fs::read(path).map_err(|source| MeshError::Unreadable { path: path.into(), source })?;
    let mesh =
        parse(&bytes).map_err(|Fault { place, what }| MeshError::Malformed { path: path.into(), place, what })?;
    if mesh.faces.is_empty() {
        return Err(MeshError::Empty { path: path.into(), vertices: mesh.positions.len() });
    }
    Ok(mesh)
}
