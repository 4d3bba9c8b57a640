//! Meshes as Wavefront OBJ.
//!
//! `tobj`, the well-kept crate for the format, reads only.

use std::io::Write;

use crate::error::Error;
use crate::mesh::triangle_mesh::Mesh;

/// Writes a mesh as Wavefront OBJ with normals, and with colours `0..=1` behind the coordinates of the vertices, where
/// most programs look for them. Numbers are written so that they read back to the same bits.
///
/// # Errors
/// [`Error::Write`] when the writer fails.
///
/// ```
/// # use tsdf_hash::mesh::{Mesh, write_obj};
/// let mesh = Mesh {
///     positions: vec![[0.0, 0.0, 1.5], [1.0, 0.0, 1.5], [0.0, 1.0, 1.5]],
///     faces: vec![[0, 1, 2]],
///     normals: vec![[0.0, 0.0, 1.0]; 3],
///     colours: vec![[255, 0, 51]; 3],
/// };
/// let mut file = Vec::new();
/// write_obj(&mesh, &mut file)?;
/// assert!(file.starts_with(b"v 0 0 1.5 1 0 0.2\n") && file.ends_with(b"f 1//1 2//2 3//3\n"));
/// # Ok::<(), tsdf_hash::Error>(())
/// ```
pub fn write_obj(mesh: &Mesh, out: impl Write) -> Result<(), Error> {
    let mut out = std::io::BufWriter::with_capacity(1 << 16, out);
    for ([x, y, z], colour) in mesh.positions.iter().zip(&mesh.colours) {
        let [r, g, b] = colour.map(|c| f32::from(c) / 255.0);
        writeln!(out, "v {x} {y} {z} {r} {g} {b}")?;
    }
    for [x, y, z] in &mesh.normals {
        writeln!(out, "vn {x} {y} {z}")?;
    }
    for face in &mesh.faces {
        // The first vertex is 1.
        let [a, b, c] = face.map(|k| k + 1);
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    out.flush()?;
    Ok(())
}
