//! The settings in a map's file.

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::file::header::NAMES;
use crate::frame_clock::FrameClock;
use crate::settings::{MemoryLimits, NoiseModel, Settings};

/// The settings, and the time of the last frame.
pub(crate) fn write_settings(settings: &Settings, clock: FrameClock) -> Vec<u8> {
    let Settings { voxel_size, truncation_voxels, carve, min_depth, max_depth, max_bytes, threads, memory, noise } =
        *settings;
    let mut out = Vec::new();
    for number in
        [voxel_size, truncation_voxels, carve, min_depth, max_depth, noise.base, noise.quadratic, noise.nearest]
    {
        out.extend_from_slice(&number.to_le_bytes());
    }
    for count in
        [max_bytes as u64, threads as u64, memory.host_bytes as u64, memory.disk_bytes, memory.max_transfers as u64]
    {
        out.extend_from_slice(&count.to_le_bytes());
    }
    for number in
        [memory.max_age, memory.merge_timeout, clock.last.unwrap_or(f64::NAN), if clock.stamped { 1.0 } else { 0.0 }]
    {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out
}

pub(crate) fn read_settings(bytes: &[u8], offset: u64) -> Result<(Settings, FrameClock), Error> {
    let mut numbers = ByteReader::new(bytes, offset, NAMES[0]);
    let n = &mut numbers;
    let [voxel_size, truncation_voxels, carve] = [n.f64()?, n.f64()?, n.f64()?];
    let [min_depth, max_depth] = [n.f64()?, n.f64()?];
    let noise = NoiseModel { base: n.f64()?, quadratic: n.f64()?, nearest: n.f64()? };
    // A cap beyond this machine's words is no cap.
    let mut count = || n.u64().map(|count| usize::try_from(count).unwrap_or(usize::MAX));
    let (max_bytes, threads, host_bytes) = (count()?, count()?, count()?);
    let (disk_bytes, max_transfers) = (n.u64()?, usize::try_from(n.u64()?).unwrap_or(usize::MAX));
    let memory = MemoryLimits { host_bytes, disk_bytes, max_transfers, max_age: n.f64()?, merge_timeout: n.f64()? };
    let (last, stamped) = (n.f64()?, n.f64()? == 1.0);
    numbers.end()?;
    let settings =
        Settings { voxel_size, truncation_voxels, carve, min_depth, max_depth, max_bytes, threads, memory, noise };
    settings.check()?;
    Ok((settings, FrameClock { last: (!last.is_nan()).then_some(last), stamped }))
}
