//! Looking into the room of `peers/synth_rgbd.py` after its 60 images have been fused: time, error and fill, with its
//! walls on planes of voxels and moved off them.

use nalgebra::{Isometry3, Vector3};
use paintcopter_benches::cpu::median_seconds;
use paintcopter_benches::room::RgbdFrame;
use tsdf_hash::ray_cast::{RayCastSettings, View};
use tsdf_hash::{Error, Map, Settings};

const TURN: usize = 60;

fn main() -> Result<(), Error> {
    let moved = Isometry3::new(Vector3::new(0.0037, -0.0021, 0.0013), Vector3::z() * 7_f64.to_radians());
    for (name, world) in [("on planes", Isometry3::identity()), ("moved", moved)] {
        for voxel_size in [0.02, 0.01] {
            room(name, &world, voxel_size)?;
        }
    }
    Ok(())
}

fn room(name: &str, world: &Isometry3<f64>, voxel_size: f64) -> Result<(), Error> {
    let frames: Vec<RgbdFrame> = (0..TURN).map(|k| RgbdFrame::take(k, TURN)).collect();
    let mut map = Map::new(Settings { voxel_size, ..Settings::default() })?;
    for frame in &frames {
        map.integrate(&frame.view(), None, &(world * frame.world_from_camera))?;
    }
    let settings = RayCastSettings::default();
    let mut view = View::new();
    let (mut sum, mut hits, mut seen) = (0.0, 0, 0);
    let mut far = [0; 4];
    for frame in &frames {
        map.ray_cast_into(&RgbdFrame::INTRINSICS, 640, 480, &(world * frame.world_from_camera), &settings, &mut view)?;
        for (z, exact) in view.depth.iter().zip(&frame.exact_depth()) {
            seen += 1;
            if *z > 0.0 {
                let e = (f64::from(*z) - exact).abs();
                sum += e;
                hits += 1;
                for (k, limit) in [0.002, 0.01, 0.05, 0.2].into_iter().enumerate() {
                    far[k] += usize::from(e > limit);
                }
            }
        }
    }
    let pose = world * frames[7].world_from_camera;
    let time = median_seconds(5, || map.ray_cast_into(&RgbdFrame::INTRINSICS, 640, 480, &pose, &settings, &mut view));
    println!(
        "{name}, {voxel_size} m: {:.1} ms, error {:.4} mm, fill {:.5}, beyond 2/10/50/200 mm {far:?} of {hits}, {} blocks",
        1e3 * time,
        1e3 * sum / f64::from(hits),
        f64::from(hits) / f64::from(seen),
        map.blocks()
    );
    Ok(())
}
