//! The block codec of tsdf-hash beside `lz4_flex`: bytes per block and processor time, on the blocks of a real recording (every
//! second of 60 frames of 7-Scenes, found by `PAINTCOPTER_DATA`) or, without it, of the room of `peers/synth_rgbd.py`.
//! LZ4 gets the block as it lies in memory, and with its bytes sorted by significance, which suits it better.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use paintcopter_benches::cpu::median_seconds;
use paintcopter_benches::room::RgbdFrame;
use tsdf_hash::layer::{TsdfLayer, VoxelBlock, decode_block, encode_block};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Error, Intrinsics, Map, Settings};

const VOXELS: usize = 512;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let recorded = std::env::var_os("PAINTCOPTER_DATA").map(PathBuf::from);
    let kitchen = recorded.map(|root| root.join("rgbd/7scenes_redkitchen_000-199")).filter(|path| path.is_dir());
    let (name, map) = match kitchen {
        Some(dir) => ("7-Scenes, red kitchen", kitchen_map(&dir)?),
        None => ("the synthetic room", room_map()?),
    };
    let blocks = blocks(&map)?;
    println!("{} blocks of {name} at 1 cm, 7168 bytes each", blocks.len());
    let ours: Vec<Vec<u8>> = blocks.iter().map(encoded).collect();
    let plain: Vec<Vec<u8>> = blocks.iter().map(bytes).collect();
    let sorted: Vec<Vec<u8>> = plain.iter().map(|bytes| by_significance(bytes)).collect();
    let report = |name: &str, packed: &[Vec<u8>], pack: &mut dyn FnMut(), unpack: &mut dyn FnMut()| {
        let mean = packed.iter().map(Vec::len).sum::<usize>() as f64 / packed.len() as f64;
        let each = |job: &mut dyn FnMut()| 1e6 * median_seconds(3, job) / packed.len() as f64;
        let (pack, unpack) = (each(pack), each(unpack));
        println!("  {name:22} {mean:6.0} bytes ({:.3})   {pack:6.2} us in, {unpack:6.2} us out", mean / 7168.0);
    };
    let mut out = Vec::new();
    let mut pack = || {
        for block in &blocks {
            out.clear();
            encode_block(block, &mut out);
            std::hint::black_box(&out);
        }
    };
    let mut unpack = || {
        for bytes in &ours {
            std::hint::black_box(decode_block(bytes));
        }
    };
    report("tsdf-hash", &ours, &mut pack, &mut unpack);
    for (name, raw) in [("lz4_flex", &plain), ("lz4_flex, bytes sorted", &sorted)] {
        let packed: Vec<Vec<u8>> = raw.iter().map(|bytes| lz4_flex::block::compress(bytes)).collect();
        let mut pack = || raw.iter().for_each(|bytes| drop(std::hint::black_box(lz4_flex::block::compress(bytes))));
        let mut unpack =
            || packed.iter().for_each(|bytes| drop(std::hint::black_box(lz4_flex::block::decompress(bytes, 7168))));
        report(name, &packed, &mut pack, &mut unpack);
    }
    Ok(())
}

fn encoded(block: &VoxelBlock) -> Vec<u8> {
    let mut out = Vec::new();
    encode_block(block, &mut out);
    out
}

/// Distances, weights, colours, as they lie in memory.
fn bytes(block: &VoxelBlock) -> Vec<u8> {
    let sums: Vec<_> = (0..VOXELS).filter_map(|voxel| block.sums(voxel)).collect();
    let distances = sums.iter().flat_map(|sums| sums.0.to_le_bytes());
    let weights = sums.iter().flat_map(|sums| sums.1.to_le_bytes());
    let colours = sums.iter().flat_map(|sums| sums.2).flat_map(u16::to_le_bytes);
    distances.chain(weights).chain(colours).collect()
}

/// Planes of the first bytes, the second bytes and so on of all distances, weights, and of each colour channel.
fn by_significance(bytes: &[u8]) -> Vec<u8> {
    let (distances, rest) = bytes.split_at(4 * VOXELS);
    let (weights, colours) = rest.split_at(2 * VOXELS);
    let mut out = Vec::with_capacity(bytes.len());
    for (part, width) in [(distances, 4), (weights, 2), (colours, 8)] {
        for k in 0..width {
            out.extend(part.iter().skip(k).step_by(width));
        }
    }
    out
}

fn blocks(map: &Map) -> Result<Vec<VoxelBlock>, Error> {
    let keys = map.changes_since(None).changed;
    let reader = map.read_blocks(&mut keys.iter().copied())?;
    let mut scratch = VoxelBlock::ZERO;
    let mut all = Vec::with_capacity(keys.len());
    for key in keys {
        all.extend(reader.block(key, &mut scratch)?.cloned());
    }
    Ok(all)
}

fn room_map() -> Result<Map, Error> {
    let mut map = Map::new(Settings::default())?;
    for shot in (0..60).step_by(2).map(|k| RgbdFrame::take(k, 60).painted()) {
        map.integrate(&shot.view(), shot.colour().as_ref(), &shot.world_from_camera)?;
    }
    Ok(map)
}

fn kitchen_map(dir: &Path) -> Result<Map, Box<dyn std::error::Error>> {
    let intrinsics = Intrinsics { fx: 585.0, fy: 585.0, cx: 320.0, cy: 240.0 };
    let mut map = Map::new(Settings::default())?;
    for k in (0..60).step_by(2) {
        let path = |end: &str| dir.join(format!("frame-{k:06}.{end}"));
        let depth = image::open(path("depth.png"))?.into_luma16();
        let rgb = image::open(path("color.jpg"))?.into_rgb8();
        let text = std::fs::read_to_string(path("pose.txt"))?;
        let m = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
        let pose = Isometry3::from_parts(Translation3::new(m[3], m[7], m[11]), rotation);
        let data = DepthData::U16 { data: depth.as_raw(), scale: 1000.0 };
        let depth = DepthView { width: 640, height: 480, data, intrinsics };
        let colour = ColourView { width: 640, height: 480, data: ColourData::Rgb8(rgb.as_raw()), intrinsics };
        map.integrate(&depth, Some(&colour), &pose)?;
    }
    Ok(map)
}
