//! The room of `peers/synth_rgbd.py` mapped and looked at on a GPU, beside the processor: wall time, because the work is
//! done elsewhere, with the processor on one thread. `--adapter NAME` picks one; without a real GPU a software one stands
//! in.

use std::time::Instant;

use clap::Parser;
use paintcopter_benches::room::RgbdFrame;
use tsdf_hash::gpu::{GpuMap, GpuOptions};
use tsdf_hash::ray_cast::RayCastSettings;
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{DenseMap, Error, Map, Settings};

/// Images of a full turn, as many as in the stream `loop`; every sixth is used.
const TURN: usize = 60;
const STRIDE: usize = 6;
/// What a block takes.
const BLOCK_BYTES: usize = 7168;

#[derive(Parser)]
struct Args {
    /// Part of the adapter's name.
    #[arg(long, default_value = "")]
    adapter: String,
    /// What cargo passes on.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Median of the wall time of the jobs, milliseconds.
fn median_ms<T>(jobs: impl Iterator<Item = T>, mut run: impl FnMut(T) -> Result<(), Error>) -> Result<f64, Error> {
    let mut times = Vec::new();
    for job in jobs {
        let start = Instant::now();
        run(job)?;
        times.push(1e3 * start.elapsed().as_secs_f64());
    }
    times.sort_unstable_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

fn main() -> Result<(), Error> {
    let args = Args::parse();
    let options = GpuOptions { adapter: args.adapter, software: true, ..GpuOptions::default() };
    let turn: Vec<RgbdFrame> = (0..TURN).map(|k| RgbdFrame::take(k, TURN)).collect();
    let frames: Vec<&RgbdFrame> = turn.iter().step_by(STRIDE).collect();
    for voxel_size in [0.02, 0.01, 0.005] {
        let settings = Settings { voxel_size, ..Settings::default() };
        let (mut map, mut gpu) = (Map::new(settings)?, GpuMap::new(settings, &options)?);
        let cast = RayCastSettings::default();
        let intrinsics = RgbdFrame::INTRINSICS;
        let fused = [
            median_ms(frames.iter(), |s| map.integrate(&s.view(), None, &s.world_from_camera).map(drop))?,
            median_ms(frames.iter(), |s| gpu.integrate(&s.view(), None, &s.world_from_camera).map(drop))?,
        ];
        let seen = [
            median_ms(frames.iter(), |s| map.ray_cast(&intrinsics, 640, 480, &s.world_from_camera, &cast).map(drop))?,
            median_ms(frames.iter(), |s| gpu.ray_cast(&intrinsics, 640, 480, &s.world_from_camera, &cast).map(drop))?,
        ];
        let equal = map.hash() == gpu.hash()?;
        println!("{:.0} mm on {}: {} blocks, equal: {equal}", 1e3 * voxel_size, gpu.adapter(), gpu.blocks());
        println!("  fusion   processor {:8.2} ms   device {:8.2} ms", fused[0], fused[1]);
        println!("  ray cast processor {:8.2} ms   device {:8.2} ms", seen[0], seen[1]);
    }
    bounded(&turn, &options)
}

/// Two turns on a device with memory for everything, and for a quarter of it; the rest is evicted to the processor's memory.
fn bounded(turn: &[RgbdFrame], options: &GpuOptions) -> Result<(), Error> {
    let settings = Settings { voxel_size: 0.01, ..Settings::default() };
    let mut free = GpuMap::new(settings, options)?;
    let fuse = |gpu: &mut GpuMap| -> Result<[f64; 2], Error> {
        let mut times = Vec::new();
        for shot in turn.iter().chain(turn) {
            let start = Instant::now();
            gpu.integrate(&shot.view(), None, &shot.world_from_camera)?;
            times.push(1e3 * start.elapsed().as_secs_f64());
        }
        let sum = times.iter().sum();
        Ok([sum, times.into_iter().fold(0.0, f64::max)])
    };
    let whole = fuse(&mut free)?;
    let memory = MemoryLimits { host_bytes: 1 << 30, ..MemoryLimits::default() };
    let mut quarter =
        GpuMap::new(Settings { max_bytes: free.blocks() * BLOCK_BYTES / 4, memory, ..settings }, options)?;
    let bounded = fuse(&mut quarter)?;
    let equal = free.hash()? == quarter.hash()?;
    println!("two turns at 10 mm: {:.0} ms, {:.1} at most for a frame", whole[0], whole[1]);
    println!(
        "  a quarter of the memory: {:.0} ms, {:.1} at most; {:.2}x; equal: {equal}",
        bounded[0],
        bounded[1],
        bounded[0] / whole[0]
    );
    Ok(())
}
