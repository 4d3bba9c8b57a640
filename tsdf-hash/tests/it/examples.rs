//! The examples do what they say, and the recipe of the README is the first of them.

use image::{ImageBuffer, Luma, Rgb};
use tsdf_hash::nalgebra::Point3;

use crate::scene::{Shot, room};

#[expect(dead_code, reason = "`main` takes its folder from the command line")]
#[path = "../../examples/slam.rs"]
mod slam;

#[expect(dead_code, reason = "what `main` prints is compared here")]
#[path = "../../examples/mapping.rs"]
mod mapping;

#[test]
fn the_recipe_is_the_example() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/slam.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust,no_run\n{program}```\n")), "README.md does not hold examples/slam.rs");
    let lines = example.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//"));
    assert!(lines.count() <= 40);
}

#[test]
fn a_frame_taken_out_leaves_no_trace_in_the_example() {
    let (map, before) = mapping::map_the_ball().unwrap();
    assert_eq!(map.hash(), before);
    let distance = map.distance(&Point3::new(0.0, 0.0, -0.45)).unwrap();
    assert!((distance - 0.05).abs() < 1e-3, "{distance}");
}

#[test]
fn the_slam_of_the_example_follows_a_folder_of_images() {
    let folder = scratch("slam-example");
    for kind in ["depth", "rgb"] {
        std::fs::create_dir_all(folder.join(kind)).unwrap();
    }
    let poses: Vec<_> = (0..10).map(|k| room::pose(k, 360)).collect();
    let mut intrinsics = None;
    for (k, pose) in poses.iter().enumerate() {
        let shot = Shot::take((320, 240), [262.5; 2], *pose, |o, d| Some(room::hit(o, d)));
        let shot = shot.painted(|p| room::colour(p, 0.0));
        let depth = shot.depth.iter().map(|z| (5000.0 * z).round() as u16).collect();
        let depth: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_vec(320, 240, depth).unwrap();
        depth.save(folder.join(format!("depth/{k:03}.png"))).unwrap();
        let rgb: ImageBuffer<Rgb<u8>, _> = ImageBuffer::from_vec(320, 240, shot.rgb.clone()).unwrap();
        rgb.save(folder.join(format!("rgb/{k:03}.png"))).unwrap();
        intrinsics = Some(shot.intrinsics);
    }
    let state = slam::slam(&folder, intrinsics.unwrap()).unwrap();
    assert_eq!(state.trajectory.len(), poses.len());
    for ((_, pose), truth) in state.trajectory.iter().zip(&poses) {
        let off = pose.inverse() * (poses[0].inverse() * truth);
        let (metres, radians) = (off.translation.vector.norm(), off.rotation.angle());
        assert!(metres < 5e-3 && radians < 5e-3, "{metres} m, {radians} rad");
    }
    for file in ["trajectory.txt", "mesh.ply"] {
        assert!(folder.join(file).metadata().unwrap().len() > 100);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

fn scratch(name: &str) -> std::path::PathBuf {
    std::env::temp_dir().join(format!("tsdf-hash-{name}-{}", std::process::id()))
}
