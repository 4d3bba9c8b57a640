//! Wavefront OBJ: v (with optional colour), vt, f, mtllib, usemtl. Groups and normals are passed over.
//!
//! Read here and not by `tobj` (4.0.5): that tears a mesh at every group, numbers the vertices anew, gives corners without
//! texture coordinates those of the corner before, names no line in its errors, and overflows on `f 1/-9`. `obj` and `obj-rs`
//! know no vertex colours.

use std::collections::HashMap;
use std::path::Path;

use super::fault::{Fault, number};
use super::material::{MeshMaterial, MeshMaterials};
use super::mesh::{MeshUv, Parsed, fan};
use super::mtl;

pub(super) fn parse(bytes: &[u8], folder: &Path) -> Result<Parsed, Fault> {
    let text = String::from_utf8_lossy(bytes);
    let mut parsed = Parsed::default();
    let mut colours: Vec<[f32; 3]> = Vec::new();
    let mut uv = MeshUv::default();
    let mut corners: Vec<(u32, Option<u32>)> = Vec::new();
    let mut faces_without_uv = 0;
    let mut used = UsedMaterials::default();
    for (k, line) in text.lines().enumerate() {
        let k = k + 1;
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                parsed.points.push([
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
            Some("mtllib") => {
                let name = line.trim().trim_start_matches("mtllib").trim();
                used.library.extend(mtl::read(&folder.join(name.replace('\\', "/")), &mut parsed.mesh.notes));
            }
            // Names of materials may have spaces in them.
            Some("usemtl") => used.set(line.trim().trim_start_matches("usemtl").trim()),
            Some("f") => {
                corners.clear();
                for word in words {
                    corners.push(corner(word, parsed.points.len(), uv.coordinates.len(), k)?);
                }
                if corners.len() < 3 {
                    return Err(Fault::at_line(k, format!("a face has {} corners, expected 3 or more", corners.len())));
                }
                fan(&corners, |triangle| {
                    parsed.mesh.faces.push(triangle.map(|c| c.0));
                    used.add_face();
                    if let [(_, Some(a)), (_, Some(b)), (_, Some(c))] = triangle {
                        uv.faces.push([a, b, c]);
                    } else {
                        faces_without_uv += 1;
                    }
                });
            }
            Some(word) if word.starts_with('#') => parsed.read_comment(line.trim().trim_start_matches('#')),
            _ => {}
        }
    }
    let mesh = &mut parsed.mesh;
    if colours.len() == parsed.points.len() && !colours.is_empty() {
        mesh.colours = Some(colours);
    }
    if faces_without_uv == 0 && !uv.faces.is_empty() {
        mesh.uv = Some(uv);
    } else if !uv.faces.is_empty() {
        let faces = mesh.faces.len();
        mesh.notes.push(format!("texture coordinates left aside: {faces_without_uv} of {faces} faces have none"));
    }
    mesh.materials = (!used.library.is_empty()).then_some(used.materials);
    Ok(parsed)
}

/// The materials that faces have had so far.
#[derive(Default)]
struct UsedMaterials {
    library: HashMap<String, MeshMaterial>,
    numbers: HashMap<String, u32>,
    current: Option<u32>,
    materials: MeshMaterials,
}

impl UsedMaterials {
    /// The material of the faces that follow; white where no library has it.
    fn set(&mut self, name: &str) {
        let next = self.materials.materials.len() as u32;
        let number = *self.numbers.entry(name.to_owned()).or_insert(next);
        if number == next {
            self.materials.materials.push(self.library.get(name).cloned().unwrap_or_default());
        }
        self.current = Some(number);
    }

    fn add_face(&mut self) {
        if self.current.is_none() {
            self.set("");
        }
        self.materials.faces.extend(self.current);
    }
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
