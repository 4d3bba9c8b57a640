//! Meshes as binary PLY.
//!
//! Written here rather than by `ply-rs-bw`, which the binaries of the workspace read with: that keeps a map of properties per
//! vertex, and brings a parser generator that a library which only writes has no use for.

use std::io::Write;

use crate::error::Error;
use crate::mesh::triangle_mesh::Mesh;

/// Writes a mesh as binary little-endian PLY with normals and 8-bit colours.
///
/// # Errors
/// [`Error::Write`] when the writer fails.
///
/// ```
/// # use tsdf_hash::mesh::write_ply;
/// # use tsdf_hash::{Map, Settings};
/// let mut file = Vec::new();
/// write_ply(&Map::new(Settings::default())?.mesh(), &mut file)?;
/// assert!(file.starts_with(b"ply\nformat binary_little_endian 1.0\nelement vertex 0\n"));
/// # Ok::<(), tsdf_hash::Error>(())
/// ```
pub fn write_ply(mesh: &Mesh, mut out: impl Write) -> Result<(), Error> {
    let property = |kind: &str, names: &[&str]| -> String {
        names.iter().map(|name| ["property ", kind, " ", name, "\n"].concat()).collect()
    };
    let mut buffer = [
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len()),
        property("float", &["x", "y", "z", "nx", "ny", "nz"]),
        property("uchar", &["red", "green", "blue"]),
        format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", mesh.faces.len()),
    ]
    .concat()
    .into_bytes();
    for ((position, normal), colour) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.colours) {
        for value in position.iter().chain(normal) {
            buffer.extend_from_slice(&value.to_le_bytes());
        }
        buffer.extend_from_slice(colour);
        flush_full(&mut buffer, &mut out)?;
    }
    for face in &mesh.faces {
        buffer.push(3);
        for vertex in face {
            buffer.extend_from_slice(&vertex.to_le_bytes());
        }
        flush_full(&mut buffer, &mut out)?;
    }
    out.write_all(&buffer)?;
    out.flush()?;
    Ok(())
}

/// Hands the buffer on when it is large, so that an unbuffered file is as fast as a buffered one.
fn flush_full(buffer: &mut Vec<u8>, out: &mut impl Write) -> std::io::Result<()> {
    if buffer.len() >= 1 << 16 {
        out.write_all(buffer)?;
        buffer.clear();
    }
    Ok(())
}
