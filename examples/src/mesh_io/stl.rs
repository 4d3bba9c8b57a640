//! STL, binary and text. The format has no vertices of its own: corners at the same place are one.

use std::collections::HashMap;

use super::fault::{Fault, number};
use super::mesh::Parsed;

/// Bytes before the triangles of a binary file: a title and their number.
const HEADER: usize = 84;
/// Bytes of a triangle: normal, corners, an attribute.
const TRIANGLE: usize = 50;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let count = bytes.get(80..HEADER).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]) as usize);
    let expected = count.and_then(|count| count.checked_mul(TRIANGLE)).and_then(|length| length.checked_add(HEADER));
    // Some binary files begin with the word of the text ones, and some have bytes behind their end.
    let text = bytes.trim_ascii_start().starts_with(b"solid");
    match expected {
        Some(length) if length == bytes.len() || !text && length <= bytes.len() => Ok(binary(bytes)),
        _ if text => of_text(&String::from_utf8_lossy(bytes)),
        Some(length) => {
            let what =
                format!("has {} bytes where its header announces {length}: copy or export it again", bytes.len());
            Err(Fault { place: "STL".into(), what })
        }
        None => Err(Fault { place: "STL".into(), what: "is shorter than a header: copy or export it again".into() }),
    }
}

/// Corners that become vertices.
#[derive(Default)]
struct Corners {
    parsed: Parsed,
    numbers: HashMap<[u64; 3], u32>,
    face: Vec<u32>,
}

impl Corners {
    fn add(&mut self, corner: [f64; 3]) {
        let points = &mut self.parsed.points;
        // Zero has two bit patterns.
        let vertex = *self.numbers.entry(corner.map(|c| (c + 0.0).to_bits())).or_insert_with(|| {
            points.push(corner);
            points.len() as u32 - 1
        });
        self.face.push(vertex);
        if let [a, b, c] = self.face[..] {
            self.parsed.mesh.faces.push([a, b, c]);
            self.face.clear();
        }
    }
}

fn binary(bytes: &[u8]) -> Parsed {
    let mut corners = Corners::default();
    corners.parsed.read_comment(&String::from_utf8_lossy(&bytes[..80]).replace('\0', " "));
    let count = u32::from_le_bytes([bytes[80], bytes[81], bytes[82], bytes[83]]) as usize;
    for triangle in bytes[HEADER..].chunks_exact(TRIANGLE).take(count) {
        for corner in triangle[12..48].chunks_exact(12) {
            let at = |k: usize| f32::from_le_bytes([corner[k], corner[k + 1], corner[k + 2], corner[k + 3]]);
            corners.add([at(0), at(4), at(8)].map(f64::from));
        }
    }
    corners.parsed
}

fn of_text(text: &str) -> Result<Parsed, Fault> {
    let mut corners = Corners::default();
    let mut last = 0;
    for (k, line) in text.lines().enumerate() {
        last = k + 1;
        let mut words = line.split_whitespace();
        match words.next() {
            Some("solid") => corners.parsed.read_comment(line),
            Some("vertex") => {
                let words = &mut words;
                corners.add([number(words, last, "x")?, number(words, last, "y")?, number(words, last, "z")?]);
            }
            Some("endloop") if !corners.face.is_empty() => {
                return Err(Fault::at_line(last, "a facet that has not three vertices: STL holds triangles only"));
            }
            _ => {}
        }
    }
    if corners.face.is_empty() { Ok(corners.parsed) } else { Err(Fault::at_line(last, "ends within a facet")) }
}
