//! Looking into the room of `peers/synth_rgbd.py` after its 60 images have been fused: time, error and fill.

use paintcopter_benches::cpu::median_seconds;
use paintcopter_benches::room::Shot;
use tsdf_hash::{CastSettings, Error, Map, Settings, View};

const TURN: usize = 60;

fn main() -> Result<(), Error> {
    let shots: Vec<Shot> = (0..TURN).map(|k| Shot::take(k, TURN)).collect();
    for voxel_size in [0.02, 0.01] {
        let mut map = Map::new(Settings { voxel_size, ..Settings::default() })?;
        for shot in &shots {
            map.integrate(&shot.view(), None, &shot.world_from_camera)?;
        }
        let settings = CastSettings::default();
        let mut view = View::new();
        let (mut sum, mut hits, mut seen) = (0.0, 0, 0);
        let mut far = [0; 4];
        for shot in &shots {
            map.ray_cast_into(&Shot::INTRINSICS, 640, 480, &shot.world_from_camera, &settings, &mut view)?;
            let truth = shot.exact_depth();
            for (z, exact) in view.depth.iter().zip(&truth) {
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
        println!(
            "{voxel_size}: error {:.4} mm, fill {:.5}, beyond 2/10/50/200 mm {far:?} of {hits}, {} blocks",
            1e3 * sum / f64::from(hits),
            f64::from(hits) / f64::from(seen),
            map.blocks()
        );
        let shot = &shots[7];
        let t = median_seconds(5, || {
            map.ray_cast_into(&Shot::INTRINSICS, 640, 480, &shot.world_from_camera, &settings, &mut view)
        });
        println!("cast {:.2} ms", 1e3 * t);
    }
    Ok(())
}
