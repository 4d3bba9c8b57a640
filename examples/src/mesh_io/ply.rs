//! PLY: positions, colours and faces by `ply-rs-bw`; writing in binary little endian.

use std::io::{self, Write};
use std::path::Path;

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use super::fault::Fault;
use super::mesh::{TriangleMesh, fan};

pub(super) fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut io::Cursor::new(bytes))
        .map_err(|e| Fault { place: "PLY".into(), what: e.to_string() })?;
    let fault = |k: usize, element: &str, what: &str| Fault { place: format!("{element} {k}"), what: what.into() };
    let mut mesh = TriangleMesh::default();
    let mut colours = Vec::new();
    for (k, vertex) in ply.payload.get("vertex").into_iter().flatten().enumerate() {
        let read = |name: &str| vertex.get(name).and_then(scalar);
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(read) else {
            return Err(fault(k, "vertex", "x, y and z must be numbers"));
        };
        mesh.positions.push([x as f32, y as f32, z as f32]);
        if let [Some(r), Some(g), Some(b)] = ["red", "green", "blue"].map(|name| vertex.get(name).and_then(unit)) {
            colours.push([r, g, b]);
        }
    }
    for (k, face) in ply.payload.get("face").into_iter().flatten().enumerate() {
        let indices = ["vertex_indices", "vertex_index"].iter().find_map(|name| face.get(*name)).and_then(index_list);
        let corners = indices.ok_or_else(|| fault(k, "face", "no list of vertex indices"))?;
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= mesh.positions.len()) {
            let what = format!("vertex {bad} does not exist ({} vertices)", mesh.positions.len());
            return Err(fault(k, "face", &what));
        }
        fan(&corners, |triangle| mesh.faces.push(triangle));
    }
    if colours.len() == mesh.positions.len() && !colours.is_empty() {
        mesh.colours = Some(colours);
    }
    Ok(mesh)
}

fn scalar(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        Property::Float(v) => v.into(),
        Property::Double(v) => v,
        _ => return None,
    })
}

/// A colour channel in `[0, 1]`: integers are scaled by their type's maximum.
fn unit(property: &Property) -> Option<f32> {
    Some(match *property {
        Property::UChar(v) => f32::from(v) / 255.0,
        Property::UShort(v) => f32::from(v) / 65535.0,
        Property::Float(v) => v,
        Property::Double(v) => v as f32,
        _ => return None,
    })
}

fn index_list(property: &Property) -> Option<Vec<u32>> {
    match property {
        Property::ListUChar(v) => Some(v.iter().map(|&i| i.into()).collect()),
        Property::ListUShort(v) => Some(v.iter().map(|&i| i.into()).collect()),
        Property::ListUInt(v) => Some(v.clone()),
        Property::ListChar(v) => v.iter().map(|&i| u32::try_from(i).ok()).collect(),
        Property::ListShort(v) => v.iter().map(|&i| u32::try_from(i).ok()).collect(),
        Property::ListInt(v) => v.iter().map(|&i| u32::try_from(i).ok()).collect(),
        _ => None,
    }
}

/// Writes a binary little-endian PLY with one sRGB colour per vertex.
pub fn write_ply(path: &Path, positions: &[[f32; 3]], faces: &[[u32; 3]], colours: &[[u8; 3]]) -> io::Result<()> {
    let mut out = io::BufWriter::new(std::fs::File::create(path)?);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        positions.len(),
        faces.len()
    )?;
    for (position, colour) in positions.iter().zip(colours) {
        for coordinate in position {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        out.write_all(colour)?;
    }
    for face in faces {
        out.write_all(&[3])?;
        for index in face {
            out.write_all(&index.to_le_bytes())?;
        }
    }
    out.flush()
}
