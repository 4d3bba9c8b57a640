//! PLY by `ply-rs-bw`: positions, colours and faces in all encodings; writing in binary little endian.

use std::io;
use std::path::Path;

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{
    Addable, DefaultElement, ElementDef, Encoding, Header, Property, PropertyAccess, PropertyDef, PropertyType,
    ScalarType,
};
use ply_rs_bw::writer::Writer;

use super::fault::Fault;
use super::mesh::{Parsed, fan};
use crate::whole_file::WholeFile;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    check_counts(bytes)?;
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut io::Cursor::new(bytes))
        .map_err(|e| Fault { place: "PLY".into(), what: e.to_string() })?;
    let fault = |k: usize, element: &str, what: &str| Fault { place: format!("{element} {k}"), what: what.into() };
    let mut parsed = Parsed::default();
    ply.header.comments.iter().for_each(|comment| parsed.read_comment(comment.trim()));
    let mut colours = Vec::new();
    for (k, vertex) in ply.payload.get("vertex").into_iter().flatten().enumerate() {
        let read = |name: &str| vertex.get(name).and_then(double);
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(read) else {
            return Err(fault(k, "vertex", "x, y and z must be numbers"));
        };
        parsed.points.push([x, y, z]);
        if let [Some(r), Some(g), Some(b)] = ["red", "green", "blue"].map(|name| vertex.get(name).and_then(unit)) {
            colours.push([r, g, b]);
        }
    }
    for (k, face) in ply.payload.get("face").into_iter().flatten().enumerate() {
        let indices = ["vertex_indices", "vertex_index"].iter().find_map(|name| face.get(*name));
        let corners =
            indices.and_then(Property::to_u32_list).ok_or_else(|| fault(k, "face", "no list of vertex indices"))?;
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= parsed.points.len()) {
            let what = format!("vertex {bad} does not exist ({} vertices)", parsed.points.len());
            return Err(fault(k, "face", &what));
        }
        fan(&corners, |triangle| parsed.mesh.faces.push(triangle));
    }
    if colours.len() == parsed.points.len() && !colours.is_empty() {
        parsed.mesh.colours = Some(colours);
    }
    Ok(parsed)
}

/// Refuses a header that promises more elements than the file has room for: elements without properties would be made until the memory
/// is full.
fn check_counts(bytes: &[u8]) -> Result<(), Fault> {
    let header = Parser::<DefaultElement>::new()
        .read_ply_header(&mut io::Cursor::new(bytes))
        .map_err(|e| Fault { place: "PLY header".into(), what: e.to_string() })?;
    for (name, element) in &header.elements {
        let binary = |(_, property): (&String, &PropertyDef)| match &property.data_type {
            PropertyType::Scalar(scalar) => size(scalar),
            // An empty list is its length.
            PropertyType::List(length, _) => size(length),
        };
        let least: usize = match header.encoding {
            Encoding::Ascii => 1,
            _ => element.properties.iter().map(binary).sum::<usize>().max(1),
        };
        if element.count.saturating_mul(least) > bytes.len() {
            let what = format!("{} {name} elements do not fit into {} bytes", element.count, bytes.len());
            return Err(Fault { place: "PLY header".into(), what });
        }
    }
    Ok(())
}

/// Bytes of a number.
fn size(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// A number in double precision: surveyed coordinates need it.
fn double(property: &Property) -> Option<f64> {
    match *property {
        Property::Double(v) => Some(v),
        Property::Int(v) => Some(f64::from(v)),
        Property::UInt(v) => Some(f64::from(v)),
        _ => property.to_f32_lossy().map(f64::from),
    }
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

/// A mesh to write, metres; one normal, if there are any, and one sRGB colour per vertex.
pub struct PlyMesh<'a> {
    /// Vertices.
    pub positions: &'a [[f32; 3]],
    /// Unit normals of the vertices.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Colours of the vertices.
    pub colours: &'a [[u8; 3]],
    /// Vertex indices, three per triangle.
    pub faces: &'a [[u32; 3]],
}

/// Names of a vertex's numbers and colour channels, in the order of the file.
const COORDINATES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// A vertex while it is written.
#[derive(Default)]
struct Vertex {
    coordinates: [f32; 6],
    colour: [u8; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        COORDINATES.iter().position(|n| *n == name).map(|k| self.coordinates[k])
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        CHANNELS.iter().position(|n| *n == name).map(|k| self.colour[k])
    }
}

/// A face while it is written.
#[derive(Default)]
struct Face([i32; 3]);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn get_list_int(&self, _: &str) -> Option<&[i32]> {
        Some(&self.0)
    }
}

/// Writes a binary little-endian PLY.
pub fn write_ply(path: &Path, mesh: &PlyMesh) -> io::Result<()> {
    let mut out = WholeFile::create(path)?;
    let element = |name: &str, count: usize, properties: &[(&str, PropertyType)]| {
        let mut element = ElementDef { count, ..ElementDef::new(name.into()) };
        for (name, kind) in properties {
            element.properties.add(PropertyDef::new((*name).into(), kind.clone()));
        }
        element
    };
    let coordinates = &COORDINATES[..if mesh.normals.is_some() { 6 } else { 3 }];
    let coordinates = coordinates.iter().map(|name| (*name, PropertyType::Scalar(ScalarType::Float)));
    let channels = CHANNELS.map(|name| (name, PropertyType::Scalar(ScalarType::UChar)));
    let properties: Vec<_> = coordinates.chain(channels).collect();
    let vertex = element("vertex", mesh.positions.len(), &properties);
    let indices = ("vertex_indices", PropertyType::List(ScalarType::UChar, ScalarType::Int));
    let face = element("face", mesh.faces.len(), &[indices]);
    let mut header = Header { encoding: Encoding::BinaryLittleEndian, ..Header::new() };
    header.comments.push("units: m".into());
    header.elements.add(vertex.clone());
    header.elements.add(face.clone());

    let writer = Writer::<Vertex>::new();
    writer.write_header(&mut out, &header)?;
    for (k, ([x, y, z], colour)) in mesh.positions.iter().zip(mesh.colours).enumerate() {
        let [nx, ny, nz] = mesh.normals.and_then(|normals| normals.get(k)).copied().unwrap_or_default();
        let element = Vertex { coordinates: [*x, *y, *z, nx, ny, nz], colour: *colour };
        writer.write_little_endian_element(&mut out, &element, &vertex)?;
    }
    let writer = Writer::<Face>::new();
    for corners in mesh.faces {
        let index = |i: u32| i32::try_from(i).map_err(io::Error::other);
        let [a, b, c] = *corners;
        writer.write_little_endian_element(&mut out, &Face([index(a)?, index(b)?, index(c)?]), &face)?;
    }
    out.commit()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

    const HEADER: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                          element face 1\nproperty list uchar int vertex_indices\nend_header\n";

    fn files() -> [Vec<u8>; 2] {
        let ascii = format!("ply\nformat ascii 1.0\n{HEADER}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").into_bytes();
        let mut binary = format!("ply\nformat binary_little_endian 1.0\n{HEADER}").into_bytes();
        binary.extend([0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()));
        binary.push(3);
        binary.extend([0_i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
        [ascii, binary]
    }

    #[test]
    fn counts_that_cannot_be_are_refused() {
        for file in files() {
            assert!(parse(&file).is_ok());
            let text = String::from_utf8_lossy(&file).into_owned();
            for count in ["4000000000", "18446744073709551615"] {
                let claimed = text.replace("element vertex 3", &format!("element vertex {count}"));
                assert!(parse(claimed.as_bytes()).is_err());
            }
            let empty = format!("ply\n{}\nelement vertex 4000000000\nend_header\n", text.lines().nth(1).unwrap());
            let what = parse(empty.as_bytes()).err().unwrap().what;
            assert!(what.contains("4000000000 vertex elements do not fit"), "{what}");
        }
    }

    /// `MUTATIONS` is how many (20000).
    #[test]
    fn mutated_files_never_panic() {
        let count: u64 = std::env::var("MUTATIONS").map_or(20_000, |text| text.parse().unwrap());
        let mut generator = SplitMix64::seed_from_u64(11);
        let mut random = move |below: usize| (generator.next_u64() % below.max(1) as u64) as usize;
        let (originals, mut read) = (files(), 0);
        for k in 0..count {
            let mut bytes = originals[k as usize % 2].clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                match random(5) {
                    0 => bytes[at] = random(256) as u8,
                    1 => bytes[at] ^= 1 << random(8),
                    // Counts: some more digits.
                    2 => drop(bytes.splice(at..at, *b"99999999")),
                    3 => drop(bytes.drain(at..(at + 1 + random(16)).min(bytes.len()))),
                    _ => bytes.truncate(at.max(1)),
                }
                if bytes.is_empty() {
                    break;
                }
            }
            read += u64::from(parse(&bytes).is_ok());
        }
        eprintln!("{read} of {count} are read");
        assert!(read > 0 && read < count, "{read} of {count}");
    }
}
