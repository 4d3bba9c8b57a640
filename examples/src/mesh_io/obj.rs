//! Wavefront OBJ: v (with optional colour), vt, f. Groups, normals and materials are passed over.
//!
//! Read here and not by `tobj` (4.0.5): that tears a mesh at every group, numbers the vertices anew, gives corners without
//! texture coordinates those of the corner before, names no line in its errors, and overflows on `f 1/-9`. `obj` and `obj-rs`
//! know no vertex colours.

use super::fault::{Fault, number};
use super::mesh::{MeshUv, TriangleMesh, fan};

pub(super) fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    let text = String::from_utf8_lossy(bytes);
    let mut mesh = TriangleMesh::default();
    let mut colours: Vec<[f32; 3]> = Vec::new();
    let mut uv = MeshUv::default();
    let mut corners: Vec<(u32, Option<u32>)> = Vec::new();
    let mut every_corner_has_uv = true;
    for (k, line) in text.lines().enumerate() {
        let k = k + 1;
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                mesh.positions.push([
                    number(&mut words, k, "x")?,
                    number(&mut words, k, "y")?,
                    number(&mut words, k, "z")?,
                ]);
                let rest: Vec<f32> = words.filter_map(|w| w.parse().ok()).collect();
                if let [r, g, b] = rest[..] {
                    colours.push([r, g, b]);
                }
            }
            Some("vt") => uv.coordinates.push([number(&mut words, k, "u")?, number(&mut words, k, "v")?]),
            Some("f") => {
                corners.clear();
                for word in words {
                    corners.push(corner(word, mesh.positions.len(), uv.coordinates.len(), k)?);
                }
                if corners.len() < 3 {
                    return Err(Fault::at_line(k, format!("a face has {} corners, expected 3 or more", corners.len())));
                }
                fan(&corners, |triangle| {
                    mesh.faces.push(triangle.map(|c| c.0));
                    if let [(_, Some(a)), (_, Some(b)), (_, Some(c))] = triangle {
                        uv.faces.push([a, b, c]);
                    } else {
                        every_corner_has_uv = false;
                    }
                });
            }
            _ => {}
        }
    }
    if colours.len() == mesh.positions.len() && !colours.is_empty() {
        mesh.colours = Some(colours);
    }
    if every_corner_has_uv && !uv.faces.is_empty() {
        mesh.uv = Some(uv);
    }
    Ok(mesh)
}

/// One face corner `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last.
fn corner(word: &str, vertices: usize, coordinates: usize, line: usize) -> Result<(u32, Option<u32>), Fault> {
    let resolve = |text: &str, count: usize, what: &str| -> Result<u32, Fault> {
        let index: i64 = text
            .parse()
            .map_err(|_| Fault::at_line(line, format!("face corner \"{word}\": {what} index is not an integer")))?;
        let zero_based = if index < 0 { count as i64 + index } else { index - 1 };
        if (0..count as i64).contains(&zero_based) {
            Ok(zero_based as u32)
        } else {
            Err(Fault::at_line(line, format!("face corner \"{word}\": {what} {index} does not exist ({count} so far)")))
        }
    };
    let mut parts = word.split('/');
    let vertex = resolve(parts.next().unwrap_or(""), vertices, "vertex")?;
    let coordinate = match parts.next() {
        Some(text) if !text.is_empty() => Some(resolve(text, coordinates, "texture coordinate")?),
        _ => None,
    };
    Ok((vertex, coordinate))
}
