//! Mapping the room of `peers/synth_rgbd.py`: fusion of coloured 640 x 480 images at voxels of 0.5, 1 and 2 cm on one thread,
//! the mesh, and distance queries.

use criterion::Throughput;
use nalgebra::Point3;
use paintcopter_benches::room::RgbdFrame;
use paintcopter_benches::{Rng, criterion};
use tsdf_hash::{Error, Map, Settings};

/// Images of a full turn, as many as in the stream `loop`; every sixth is used.
const TURN: usize = 60;
const STRIDE: usize = 6;
/// Points whose distance is asked.
const POINTS: usize = 100_000;

fn map(frames: &[RgbdFrame], settings: Settings) -> Result<Map, Error> {
    let mut map = Map::new(settings)?;
    for frame in frames {
        map.integrate(&frame.view(), frame.colour().as_ref(), &frame.world_from_camera)?;
    }
    Ok(map)
}

fn main() -> Result<(), Error> {
    let frames: Vec<RgbdFrame> = (0..TURN).step_by(STRIDE).map(|k| RgbdFrame::take(k, TURN).painted()).collect();
    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("tsdf-hash");
    for voxel_size in [0.02, 0.01, 0.005] {
        let settings = Settings { voxel_size, threads: 1, max_bytes: 2 << 30, ..Settings::default() };
        let mut fused = map(&frames, settings)?;
        let name = format!("at {} cm", 100.0 * voxel_size);
        group.throughput(Throughput::Elements(frames.len() as u64));
        group
            .bench_function(format!("fusion of {} images {name}", frames.len()), |b| b.iter(|| map(&frames, settings)));
        group.throughput(Throughput::Elements(2));
        let frame = &frames[0];
        group.bench_function(format!("one image out and in again {name}"), |b| {
            b.iter(|| {
                fused.deintegrate(&frame.view(), frame.colour().as_ref(), &frame.world_from_camera)?;
                fused.integrate(&frame.view(), frame.colour().as_ref(), &frame.world_from_camera)
            });
        });
        let faces = fused.mesh().faces.len();
        group.throughput(Throughput::Elements(faces as u64));
        group.bench_function(format!("mesh {name}"), |b| b.iter(|| fused.mesh()));
        // Near the floor, where the map knows distances.
        let mut rng = Rng::new(6);
        let points: Vec<Point3<f64>> = (0..POINTS)
            .map(|_| Point3::new(rng.between(-3.0, 3.0), rng.between(-2.0, 2.0), rng.between(-0.02, 0.02)))
            .collect();
        group.throughput(Throughput::Elements(POINTS as u64));
        group.bench_function(format!("distance {name}"), |b| {
            b.iter(|| points.iter().filter_map(|p| fused.distance(p)).sum::<f64>());
        });
    }
    group.finish();
    criterion.final_summary();
    Ok(())
}
