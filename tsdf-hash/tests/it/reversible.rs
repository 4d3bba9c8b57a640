//! Sums, not averages: any order, any number of threads, and back.

use nalgebra::Isometry3;
use tsdf_hash::{ColourData, ColourView, Map, Settings};

use crate::scene::{Shot, room};

fn settings(threads: usize) -> Settings {
    Settings { voxel_size: 0.03, threads, ..Settings::default() }
}

/// Colours that differ from pixel to pixel and from image to image.
fn colours(shot: &Shot, seed: usize) -> Vec<u8> {
    (0..3 * shot.width * shot.height).map(|k| (k * 31 + seed * 77 + k / 97) as u8).collect()
}

fn fused(shots: &[Shot], order: &[usize], threads: usize) -> Map {
    let mut map = Map::new(settings(threads)).unwrap();
    for &k in order {
        add(&mut map, &shots[k], k);
    }
    map
}

fn add(map: &mut Map, shot: &Shot, k: usize) {
    let rgb8 = colours(shot, k);
    let (width, height, intrinsics) = (shot.width, shot.height, shot.intrinsics);
    let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb8), intrinsics };
    map.integrate(&shot.view(), Some(&colour), &shot.world_from_camera).unwrap();
}

fn take_out(map: &mut Map, shot: &Shot, k: usize) {
    let rgb8 = colours(shot, k);
    let (width, height, intrinsics) = (shot.width, shot.height, shot.intrinsics);
    let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb8), intrinsics };
    map.deintegrate(&shot.view(), Some(&colour), &shot.world_from_camera).unwrap();
}

#[test]
fn order_and_threads_do_not_show() {
    let shots = room::tour(7, 4, &Isometry3::identity());
    let reference = fused(&shots, &[0, 1, 2, 3, 4, 5, 6], 1);
    let mesh = reference.mesh();
    assert!(mesh.faces.len() > 10_000);
    for (order, threads) in [([6, 5, 4, 3, 2, 1, 0], 1), ([3, 0, 6, 2, 5, 1, 4], 2), ([1, 4, 0, 5, 3, 6, 2], 3)] {
        let other = fused(&shots, &order, threads);
        assert_eq!(other.hash(), reference.hash(), "{order:?}, {threads} threads");
        assert_eq!(other.mesh(), mesh);
    }
    assert_ne!(fused(&shots, &[0, 1, 2, 3, 4, 5], 1).hash(), reference.hash());
    assert_ne!(fused(&shots, &[0, 1, 2, 3, 4, 5, 5], 1).hash(), reference.hash());
}

#[test]
fn what_is_taken_out_was_never_there() {
    // A quarter of what a camera sees is seen by the next one, too: most blocks are changed and not just removed.
    let shots = &room::tour(12, 4, &Isometry3::identity())[..6];
    let mut map = fused(shots, &[0, 1, 2, 3, 4, 5], 1);
    for k in [2, 0, 5] {
        take_out(&mut map, &shots[k], k);
    }
    let rest = fused(shots, &[1, 3, 4], 2);
    assert_eq!((map.hash(), map.blocks()), (rest.hash(), rest.blocks()));
    // A frame that moves to its corrected pose.
    take_out(&mut map, &shots[3], 3);
    add(&mut map, &shots[0], 0);
    assert_eq!(map.hash(), fused(shots, &[0, 1, 4], 1).hash());
    for k in [4, 1, 0] {
        take_out(&mut map, &shots[k], k);
    }
    let empty = Map::new(settings(1)).unwrap();
    assert_eq!((map.hash(), map.blocks()), (empty.hash(), 0));
    assert!(map.mesh().positions.is_empty());
}

#[test]
fn sixteen_bits_hold_the_same_colours() {
    // 257 c / 65535 is c / 255.
    let shot = &room::tour(8, 4, &Isometry3::identity())[1];
    let (width, height, intrinsics) = (shot.width, shot.height, shot.intrinsics);
    let rgb8 = colours(shot, 1);
    let rgb16: Vec<u16> = rgb8.iter().map(|&c| 257 * u16::from(c)).collect();
    let [eight, sixteen] = [ColourData::Rgb8(&rgb8), ColourData::Rgb16(&rgb16)].map(|data| {
        let mut map = Map::new(settings(1)).unwrap();
        let colour = ColourView { width, height, data, intrinsics };
        map.integrate(&shot.view(), Some(&colour), &shot.world_from_camera).unwrap();
        map.hash()
    });
    assert_eq!(eight, sixteen);
    let mut map = fused(std::slice::from_ref(shot), &[0], 1);
    assert_ne!(map.hash(), eight, "another picture");
    let short = ColourView { width, height, data: ColourData::Rgb16(&rgb16[1..]), intrinsics };
    assert!(map.integrate(&shot.view(), Some(&short), &shot.world_from_camera).is_err());
}

#[test]
fn images_of_another_size_colour_the_same_surface() {
    // A white image of twice the size, seen by a camera of twice the focal length.
    let shot = &room::tour(8, 4, &Isometry3::identity())[1];
    let (width, height) = (2 * shot.width, 2 * shot.height);
    let mut intrinsics = shot.intrinsics;
    intrinsics.fx *= 2.0;
    intrinsics.fy *= 2.0;
    intrinsics.cx = 2.0 * intrinsics.cx + 0.5;
    intrinsics.cy = 2.0 * intrinsics.cy + 0.5;
    // Left half red, right half green.
    let rgb8: Vec<u8> =
        (0..width * height).flat_map(|k| if k % width < width / 2 { [255, 0, 0] } else { [0, 255, 0] }).collect();
    let mut map = Map::new(settings(1)).unwrap();
    let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb8), intrinsics };
    map.integrate(&shot.view(), Some(&colour), &shot.world_from_camera).unwrap();
    let mesh = map.mesh();
    let (mut checked, camera_from_world) = (0, shot.world_from_camera.inverse());
    for (position, colour) in mesh.positions.iter().zip(&mesh.colours) {
        let p = camera_from_world * nalgebra::Point3::from(position.map(f64::from));
        // Two voxels away from the border, where the ends of an edge may see both.
        if p.x.abs() > 0.06 && *colour != [128; 3] {
            checked += 1;
            assert_eq!(*colour, if p.x < 0.0 { [255, 0, 0] } else { [0, 255, 0] });
        }
    }
    assert!(checked > 1000);
}
