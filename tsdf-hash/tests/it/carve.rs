//! Space that is seen to be free.

use nalgebra::{Point3, Vector3};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Map, Settings};

use crate::scene::{Shot, look_at};

const BALL: f64 = 0.15;

/// A wall at `x = 2` from some metres away, with a ball hovering half a metre in front of it in the first shots.
fn shots(with: usize, without: usize) -> Vec<Shot> {
    (0..with + without)
        .map(|k| {
            let pose = look_at(Point3::new(0.0, 0.1 * (k % 5) as f64, 0.0), Point3::new(2.0, 0.0, 0.0));
            Shot::take((120, 90), [100.0; 2], pose, |o, d| {
                let wall = (2.0 - o.x) / d.x;
                let from = o - Point3::new(1.5, 0.0, 0.0);
                let (a, b, c) = (d.norm_squared(), from.dot(d), from.norm_squared() - BALL * BALL);
                let ball = Some(b * b - a * c).filter(|root| *root > 0.0).map(|root| (-b - root.sqrt()) / a);
                Some(ball.filter(|_| k < with).unwrap_or(wall))
            })
        })
        .collect()
}

fn fused(settings: Settings, shots: &[Shot]) -> Map {
    let mut map = Map::new(settings).unwrap();
    for shot in shots {
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    map
}

/// Vertices within two voxels of the ball.
fn of_the_ball(map: &Map) -> usize {
    let off = |p: &[f32; 3]| (Vector3::from(p.map(f64::from)) - Vector3::new(1.5, 0.0, 0.0)).norm() - BALL;
    map.mesh().positions.iter().filter(|p| off(p).abs() < 0.04).count()
}

#[test]
fn what_has_gone_is_carved_out() {
    let plain = Settings { voxel_size: 0.02, ..Settings::default() };
    let carving = Settings { carve: 0.8, ..plain };
    // A distance in front of the ball is `μ` at most, a distance behind it `-μ`: twice as many views without it are enough.
    let [there, gone] = [shots(5, 0), shots(5, 10)];
    assert!(of_the_ball(&fused(plain, &there)) > 100 && of_the_ball(&fused(carving, &there)) > 100);
    let kept = fused(plain, &gone);
    assert!(of_the_ball(&kept) > 100, "nothing looked there again");
    let carved = fused(carving, &gone);
    assert_eq!(of_the_ball(&carved), 0);
    // Free space is known as such: half a metre in front of the wall, where the other map knows nothing.
    let free = Point3::new(1.5, 0.0, 0.0);
    assert!((carved.distance(&free).unwrap() - carving.truncation()).abs() < 0.02 && kept.distance(&free).is_none());
    // The wall is where it was.
    let wall = Point3::new(1.99, 0.31, 0.2);
    assert!(
        (carved.distance(&wall).unwrap() - 0.01).abs() < 1e-3 && (kept.distance(&wall).unwrap() - 0.01).abs() < 1e-3
    );
}

#[test]
fn carving_depends_on_no_order_and_leaves_nothing_behind() {
    let settings = Settings { voxel_size: 0.03, carve: 10.0, ..Settings::default() };
    let shots = shots(3, 4);
    let mut map = fused(settings, &shots);
    let turned: Vec<_> = shots.iter().rev().cloned().collect();
    let memory = MemoryLimits { host_bytes: 4 << 20, ..MemoryLimits::default() };
    let capped = fused(Settings { max_bytes: 1 << 20, threads: 2, memory, ..settings }, &turned);
    assert!(capped.memory().host_blocks > 0);
    assert_eq!((map.hash(), map.blocks()), (capped.hash(), capped.blocks()));
    for shot in &shots {
        map.deintegrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    assert_eq!((map.hash(), map.blocks()), (Map::new(settings).unwrap().hash(), 0));
}
