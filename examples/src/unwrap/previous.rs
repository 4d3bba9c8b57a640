//! The layout of an atlas as a file, exact to the bit, so that a later run can keep what did not change.

use std::path::Path;

use uv_param::atlas::{AtlasLayout, Placement};

use super::error::UnwrapError;

use crate::whole_file;

/// Name of the file in the folder of the results.
pub(super) const NAME: &str = "atlas.layout";
/// How it begins; everything behind it is little-endian, 8 bytes each.
const MAGIC: &[u8; 8] = b"PCATLAS1";
/// Numbers of a face: nine of its corners, its chart, six of its corners in the plane.
const PER_FACE: u64 = 16;
/// Numbers of a chart: size, page, turn, shift.
const PER_CHART: u64 = 7;

pub(super) fn write(layout: &AtlasLayout, folder: &Path) -> Result<(), UnwrapError> {
    let mut bytes = MAGIC.to_vec();
    let mut put = |bits: u64| bytes.extend_from_slice(&bits.to_le_bytes());
    for count in [layout.corners.len(), layout.sizes.len(), layout.pages.len()] {
        put(count as u64);
    }
    put(layout.texel_m.to_bits());
    for ((corners, &chart), uv) in layout.corners.iter().zip(&layout.chart).zip(&layout.corner_uv) {
        corners.as_flattened().iter().copied().map(f64::to_bits).for_each(&mut put);
        put(chart.into());
        uv.as_flattened().iter().copied().map(f64::to_bits).for_each(&mut put);
    }
    for (size, placement) in layout.sizes.iter().zip(&layout.placements) {
        size.map(f64::to_bits).into_iter().for_each(&mut put);
        put(placement.page as u64);
        placement.turn.iter().chain(&placement.shift).copied().map(f64::to_bits).for_each(&mut put);
    }
    layout.pages.as_flattened().iter().map(|&side| side as u64).for_each(&mut put);
    let path = folder.join(NAME);
    whole_file::write(&path, bytes).map_err(|e| UnwrapError::unwritable(&path, &e))
}

pub(super) fn read(folder: &Path) -> Result<AtlasLayout, UnwrapError> {
    let path = folder.join(NAME);
    let wrong = |why: &dyn std::fmt::Display| UnwrapError::unreadable(&path, why);
    let bytes =
        std::fs::read(&path).map_err(|e| wrong(&format!("{e}; --previous takes the --out of an earlier run")))?;
    parse(&bytes).ok_or_else(|| wrong(&"it is not what `unwrap` writes, or is damaged: lay the mesh out anew"))
}

fn parse(bytes: &[u8]) -> Option<AtlasLayout> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (words, []) = rest.as_chunks::<8>() else { return None };
    let mut numbers = words.iter().map(|word| u64::from_le_bytes(*word));
    let [faces, charts, pages] = [numbers.next()?, numbers.next()?, numbers.next()?];
    let texel_m = f64::from_bits(numbers.next()?);
    let parts = [faces.checked_mul(PER_FACE)?, charts.checked_mul(PER_CHART)?, pages.checked_mul(2)?, 4];
    // Nothing is claimed for counts that the file does not hold.
    if parts.iter().try_fold(0, |sum: u64, part| sum.checked_add(*part))? != words.len() as u64 {
        return None;
    }
    let mut layout = AtlasLayout {
        corners: Vec::with_capacity(faces as usize),
        chart: Vec::with_capacity(faces as usize),
        corner_uv: Vec::with_capacity(faces as usize),
        sizes: Vec::with_capacity(charts as usize),
        placements: Vec::with_capacity(charts as usize),
        pages: Vec::with_capacity(pages as usize),
        texel_m,
    };
    let mut finite = || numbers.next().map(f64::from_bits).filter(|x| x.is_finite());
    // `finite` reads whole numbers too: those that are counts are small, and small bits are finite.
    for _ in 0..faces {
        let mut point = || Some([finite()?, finite()?, finite()?]);
        layout.corners.push([point()?, point()?, point()?]);
        layout.chart.push(u32::try_from(finite()?.to_bits()).ok()?);
        let mut uv = || Some([finite()?, finite()?]);
        layout.corner_uv.push([uv()?, uv()?, uv()?]);
    }
    for _ in 0..charts {
        layout.sizes.push([finite()?, finite()?]);
        let page = usize::try_from(finite()?.to_bits()).ok()?;
        layout.placements.push(Placement { page, turn: [finite()?, finite()?], shift: [finite()?, finite()?] });
    }
    for _ in 0..pages {
        let mut side = || usize::try_from(finite()?.to_bits()).ok();
        layout.pages.push([side()?, side()?]);
    }
    Some(layout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_layouts_are_refused() {
        let word = |x: u64| x.to_le_bytes().to_vec();
        let file = |words: &[u64]| [MAGIC.to_vec(), words.iter().copied().flat_map(word).collect()].concat();
        let texel = 0.0125_f64.to_bits();
        assert_eq!(parse(&file(&[0, 0, 1, texel, 30, 40])).map(|l| l.pages), Some(vec![[30, 40]]));
        assert_eq!(parse(&file(&[0, 0, 1, texel, 30])), None);
        assert_eq!(parse(&file(&[u64::MAX, 1, 1, texel])), None);
        assert_eq!(parse(&file(&[1 << 60, 0, 0, texel])), None);
        assert_eq!(parse(&file(&[0, 0, 1, texel, 30, f64::NAN.to_bits()])), None);
        assert_eq!(parse(&[file(&[0, 0, 0, texel]), vec![1]].concat()), None);
        assert_eq!(parse(b"PCATLAS0"), None);
    }
}
