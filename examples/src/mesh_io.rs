//! Triangle meshes from files: OBJ (with or without texture coordinates), PLY (all encodings, vertex colours), OFF; and
//! the painted surface back out as PLY.

mod obj;
mod off;
mod ply;

use std::path::{Path, PathBuf};

pub use ply::write_ply;

/// A triangle mesh as it stands in a file: nothing welded, nothing repaired. Lengths in the file's unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices, three per triangle; polygons are fanned.
    pub faces: Vec<[u32; 3]>,
    /// Colours per vertex, sRGB in `[0, 1]`, where the file has them.
    pub colours: Option<Vec<[f32; 3]>>,
    /// Texture coordinates with indices of their own, where the file has them.
    pub uv: Option<MeshUv>,
}

/// Texture coordinates of an OBJ: indices separate from the vertices'.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshUv {
    /// Coordinates; v = 1 is the top row of the image.
    pub coordinates: Vec<[f32; 2]>,
    /// Indices into `coordinates`, three per triangle.
    pub faces: Vec<[u32; 3]>,
}

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

/// A fault at a place in a file, before the path is known.
struct Fault {
    place: String,
    what: String,
}

impl Fault {
    fn at_line(line: usize, what: impl Into<String>) -> Self {
        Self { place: format!("line {line}"), what: what.into() }
    }
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

/// Splits a polygon into a fan of triangles about its first corner.
fn fan<T: Copy>(corners: &[T], mut triangle: impl FnMut([T; 3])) {
    for k in 1..corners.len().saturating_sub(1) {
        triangle([corners[0], corners[k], corners[k + 1]]);
    }
}

/// Parses the next number of a line.
fn number<'a, T: std::str::FromStr>(
    words: &mut impl Iterator<Item = &'a str>,
    line: usize,
    what: &str,
) -> Result<T, Fault> {
    let word = words.next().ok_or_else(|| Fault::at_line(line, format!("{what} is missing")))?;
    word.parse().map_err(|_| Fault::at_line(line, format!("{what} \"{word}\" is not a number of the expected kind")))
}
