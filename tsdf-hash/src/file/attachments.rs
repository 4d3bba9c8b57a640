//! What a file holds besides the map: its mesh, and the caller's metadata.

use std::collections::BTreeMap;

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::mesh::triangle_mesh::Mesh;

/// Bytes per vertex (position, normal, colour) and per face.
const VERTEX: u64 = 27;
const FACE: u64 = 12;

pub(crate) fn write_mesh(mesh: &Mesh) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend_from_slice(&(mesh.positions.len() as u64).to_le_bytes());
    out.extend_from_slice(&(mesh.faces.len() as u64).to_le_bytes());
    for number in mesh.positions.iter().chain(&mesh.normals).flatten() {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(mesh.colours.as_flattened());
    for index in mesh.faces.iter().flatten() {
        out.extend_from_slice(&index.to_le_bytes());
    }
    out
}

pub(crate) fn read_mesh(bytes: &[u8], offset: u64) -> Result<Mesh, Error> {
    let mut numbers = ByteReader::new(bytes, offset, "the mesh");
    let (vertices, faces) = (numbers.u64()?, numbers.u64()?);
    // Before anything of that size is asked for.
    let length = vertices.checked_mul(VERTEX).zip(faces.checked_mul(FACE)).and_then(|(v, f)| v.checked_add(f));
    if length != Some(bytes.len() as u64 - 16) {
        return Err(numbers.bad());
    }
    let [vertices, faces] = [vertices as usize, faces as usize];
    let mut mesh = Mesh::default();
    for list in [&mut mesh.positions, &mut mesh.normals] {
        list.extend(
            numbers.take(12 * vertices)?.as_chunks::<12>().0.iter().map(|bytes| three(bytes).map(f32::from_bits)),
        );
    }
    mesh.colours.extend_from_slice(numbers.take(3 * vertices)?.as_chunks::<3>().0);
    mesh.faces.extend(numbers.take(12 * faces)?.as_chunks::<12>().0.iter().map(three));
    if mesh.faces.iter().flatten().any(|&vertex| vertex as usize >= vertices) {
        return Err(numbers.bad());
    }
    Ok(mesh)
}

fn three(bytes: &[u8; 12]) -> [u32; 3] {
    [0, 4, 8].map(|k| u32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]))
}

pub(crate) fn write_metadata(metadata: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let mut out = Vec::new();
    for (key, value) in metadata {
        for bytes in [key.as_bytes(), value] {
            out.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
            out.extend_from_slice(bytes);
        }
    }
    out
}

pub(crate) fn read_metadata(bytes: &[u8], offset: u64) -> Result<BTreeMap<String, Vec<u8>>, Error> {
    let mut numbers = ByteReader::new(bytes, offset, "the metadata");
    let mut metadata = BTreeMap::new();
    while numbers.end().is_err() {
        let mut next = || {
            let length = numbers.u64()?;
            let length = usize::try_from(length).map_err(|_| numbers.bad())?;
            numbers.take(length)
        };
        let (key, value) = (next()?, next()?);
        let key = std::str::from_utf8(key).map_err(|_| numbers.bad())?;
        metadata.insert(key.into(), value.to_vec());
    }
    Ok(metadata)
}
