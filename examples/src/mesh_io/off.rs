//! OFF and COFF: counts, vertices, polygons; comments start with `#`.

use super::fault::{Fault, number};
use super::mesh::{Parsed, fan};

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.split('#').next().unwrap_or("").trim()))
        .filter(|(_, line)| !line.is_empty());
    let end = || Fault { place: "end of file".into(), what: "fewer lines than its header announces".into() };

    let (k, header) = lines.next().ok_or_else(end)?;
    let Some(counts) = header.strip_prefix("COFF").or_else(|| header.strip_prefix("OFF")) else {
        return Err(Fault::at_line(
            k,
            format!("expected OFF, found \"{}\"", header.chars().take(20).collect::<String>()),
        ));
    };
    let (k, counts) = if counts.trim().is_empty() { lines.next().ok_or_else(end)? } else { (k, counts.trim()) };
    let mut words = counts.split_whitespace();
    let vertices: usize = number(&mut words, k, "vertex count")?;
    let polygons: usize = number(&mut words, k, "face count")?;

    let mut parsed = Parsed::default();
    text.lines().filter_map(|line| line.split_once('#')).for_each(|(_, comment)| parsed.read_comment(comment.trim()));
    for _ in 0..vertices {
        let (k, line) = lines.next().ok_or_else(end)?;
        let mut words = line.split_whitespace();
        parsed.points.push([number(&mut words, k, "x")?, number(&mut words, k, "y")?, number(&mut words, k, "z")?]);
    }
    let mut corners: Vec<u32> = Vec::new();
    for _ in 0..polygons {
        let (k, line) = lines.next().ok_or_else(end)?;
        let mut words = line.split_whitespace();
        let count: usize = number(&mut words, k, "corner count")?;
        corners.clear();
        for _ in 0..count {
            let index: u32 = number(&mut words, k, "vertex index")?;
            if index as usize >= vertices {
                return Err(Fault::at_line(k, format!("vertex {index} does not exist ({vertices} vertices)")));
            }
            corners.push(index);
        }
        fan(&corners, |triangle| parsed.mesh.faces.push(triangle));
    }
    Ok(parsed)
}
