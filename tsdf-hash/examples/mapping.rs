//! Depth images with known poses become a map: its mesh, distances for a planner, and a frame taken out again, to the bit.

use std::error::Error;

use tsdf_hash::mesh::write_ply;
use tsdf_hash::nalgebra::{Isometry3, Point3, Vector3};
use tsdf_hash::{DepthData, DepthView, Intrinsics, Map, Settings};

const INTRINSICS: Intrinsics = Intrinsics { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5 };

/// What a camera sees of a ball of 40 cm about the origin, before a wall at z = 1; metres.
fn ball(world_from_camera: &Isometry3<f64>) -> Vec<f32> {
    let origin = world_from_camera.translation.vector;
    let pixel = |k: usize| {
        let ray = [(k % 160) as f64 - INTRINSICS.cx, (k / 160) as f64 - INTRINSICS.cy].map(|c| c / INTRINSICS.fx);
        let ray = world_from_camera.rotation * Vector3::new(ray[0], ray[1], 1.0);
        let (a, b) = (ray.norm_squared(), origin.dot(&ray));
        let root = b * b - a * (origin.norm_squared() - 0.16);
        if root > 0.0 { ((-b - root.sqrt()) / a) as f32 } else { ((1.0 - origin.z) / ray.z) as f32 }
    };
    (0..160 * 120).map(pixel).collect()
}

/// The map of a camera that passes the ball, and its hash before the last frame was fused and taken out again.
pub(crate) fn map_the_ball() -> Result<(Map, u64), Box<dyn Error>> {
    let mut map = Map::new(Settings { voxel_size: 0.02, ..Settings::default() })?;
    let mut before = 0;
    for k in -5..=5 {
        let pose = Isometry3::translation(0.1 * f64::from(k), 0.0, -1.2);
        let pixels = ball(&pose);
        let data = DepthData::F32 { data: &pixels };
        let depth = DepthView { width: 160, height: 120, data, intrinsics: INTRINSICS };
        before = map.hash();
        map.integrate(&depth, None, &pose)?;
        if k == 5 {
            map.deintegrate(&depth, None, &pose)?;
        }
    }
    Ok((map, before))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (map, before) = map_the_ball()?;
    println!("the last frame has left {}", if map.hash() == before { "no trace" } else { "a trace" });
    println!("{:?} m from the ball", map.distance(&Point3::new(0.0, 0.0, -0.45)));
    let (mesh, path) = (map.mesh(), std::env::temp_dir().join("ball.ply"));
    write_ply(&mesh, std::fs::File::create(&path)?)?;
    println!("{} triangles: {}", mesh.faces.len(), path.display());
    Ok(())
}
