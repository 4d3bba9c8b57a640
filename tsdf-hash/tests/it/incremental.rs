//! A mesh that follows its map is the mesh of the map.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use tsdf_hash::mesh::{IncrementalMesher, Mesh, PatchKey, write_obj};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Map, Settings};

use crate::eviction::{FREE, add, take_out};
use crate::scene::room;
use crate::topology::assert_manifold;

#[test]
fn frames_put_in_and_taken_out() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    let (mut map, mut mesher) = (Map::new(FREE).unwrap(), IncrementalMesher::new());
    for shot in &shots {
        let frame = add(&mut map, shot).unwrap();
        let report = mesher.update(&map).unwrap();
        assert_eq!((report.changed, report.removed), (frame.blocks, 0));
        // Seven lower neighbours at most, and most of them changed themselves.
        assert!(report.rebuilt >= report.changed && report.rebuilt < 2 * report.changed, "{report:?}");
        assert_eq!(mesher.mesh(), map.mesh());
    }
    assert_manifold(&mesher.mesh());
    assert_eq!(mesher.update(&map).unwrap().rebuilt, 0);
    let removed: usize = shots
        .iter()
        .map(|shot| {
            let frame = take_out(&mut map, shot).unwrap();
            let report = mesher.update(&map).unwrap();
            assert_eq!(mesher.mesh(), map.mesh());
            assert_eq!(report.removed, frame.blocks_removed);
            report.removed
        })
        .sum();
    assert!(removed > 1000 && map.blocks() == 0);
    assert_eq!(mesher.mesh(), Mesh::default());
}

/// A viewer that draws again what is said to have changed has the whole surface: frames in and out, another map, nothing.
#[test]
fn changed_patches_are_all_that_has_changed() {
    fn triangles<'a>(meshes: impl IntoIterator<Item = &'a Mesh>) -> Vec<[[u32; 3]; 3]> {
        let corners = |mesh: &Mesh, face: &[u32; 3]| face.map(|v| mesh.positions[v as usize].map(f32::to_bits));
        let mut all: Vec<_> =
            meshes.into_iter().flat_map(|mesh| mesh.faces.iter().map(move |face| corners(mesh, face))).collect();
        all.sort_unstable();
        all
    }
    fn draw(viewer: &mut BTreeMap<PatchKey, Mesh>, mesher: &mut IncrementalMesher) -> usize {
        let changed = mesher.take_changed_patches();
        for &key in &changed {
            viewer.insert(key, mesher.patch(key));
        }
        assert_eq!(triangles(viewer.values()), triangles([&mesher.mesh()]));
        changed.len()
    }
    let shots = room::tour(12, 3, &Isometry3::identity());
    let (mut map, mut mesher, mut viewer) = (Map::new(FREE).unwrap(), IncrementalMesher::new(), BTreeMap::new());
    for shot in &shots {
        add(&mut map, shot).unwrap();
        mesher.update(&map).unwrap();
        let drawn = draw(&mut viewer, &mut mesher);
        assert!(drawn > 0);
    }
    assert!(draw(&mut viewer, &mut mesher) == 0);
    let all = mesher.patches();
    assert!(all.len() > 20 && all.iter().all(|key| viewer.contains_key(key)));
    take_out(&mut map, &shots[0]).unwrap();
    mesher.update(&map).unwrap();
    assert!(draw(&mut viewer, &mut mesher) < all.len());
    let mut other = Map::new(FREE).unwrap();
    add(&mut other, &shots[6]).unwrap();
    mesher.update(&other).unwrap();
    draw(&mut viewer, &mut mesher);
}

/// Blocks are evicted after half a second of frames and reloaded, and some frames go to evicted memory at once.
#[test]
fn evicted_blocks_keep_their_mesh() {
    let shots = room::tour(16, 4, &Isometry3::identity());
    // All there is room for a frame, a third of one with blocks that are merged late, and updates not after every frame.
    for (max_bytes, merge_timeout, every) in [(6 << 20, 0.0, 1), (1 << 20, 0.1, 1), (2 << 20, 0.0, 5)] {
        let memory =
            MemoryLimits { host_bytes: 64 << 20, max_age: 0.15, max_transfers: 200, merge_timeout, ..FREE.memory };
        let mut capped = Map::new(Settings { max_bytes, memory, ..FREE }).unwrap();
        let mut free = Map::new(FREE).unwrap();
        let mut mesher = IncrementalMesher::new();
        let order: Vec<usize> = (0..16).chain([0, 1, 2, 9, 4]).collect();
        for (step, &k) in order.iter().enumerate() {
            add(&mut capped, &shots[k]).unwrap();
            add(&mut free, &shots[k]).unwrap();
            if step % every == 0 {
                mesher.update(&capped).unwrap();
                assert_eq!(mesher.mesh(), free.mesh(), "{max_bytes} bytes, after frame {step}");
            }
        }
        let memory = capped.memory();
        assert!(memory.host_blocks > memory.active_blocks, "{memory:?}");
        for (step, &k) in order[..14].iter().enumerate() {
            take_out(&mut capped, &shots[k]).unwrap();
            take_out(&mut free, &shots[k]).unwrap();
            if step % every == 0 {
                mesher.update(&capped).unwrap();
                assert_eq!(mesher.mesh(), free.mesh(), "{max_bytes} bytes, without frame {step}");
            }
        }
        assert_manifold(&mesher.mesh());
        // What is left in active memory is less than the whole.
        assert!(capped.mesh().faces.len() < mesher.mesh().faces.len());
    }
}

#[test]
fn another_map_starts_anew() {
    let shots = room::tour(12, 8, &Isometry3::identity());
    let [mut first, mut second] = [0, 1].map(|_| Map::new(FREE).unwrap());
    let mut mesher = IncrementalMesher::new();
    add(&mut first, &shots[0]).unwrap();
    mesher.update(&first).unwrap();
    add(&mut second, &shots[6]).unwrap();
    add(&mut second, &shots[7]).unwrap();
    for map in [&second, &first, &second] {
        assert_eq!(mesher.update(map).unwrap().changed, map.blocks());
        assert_eq!(mesher.mesh(), map.mesh());
    }
}

#[test]
fn obj_reads_back_to_the_same_bits() {
    let mut map = Map::new(FREE).unwrap();
    add(&mut map, &room::tour(12, 8, &Isometry3::identity())[3]).unwrap();
    let mesh = map.mesh();
    let mut file = Vec::new();
    write_obj(&mesh, &mut file).unwrap();
    let mut back = Mesh::default();
    for line in std::str::from_utf8(&file).unwrap().lines() {
        let (kind, rest) = line.split_once(' ').unwrap();
        let three = |from: usize| {
            let mut values = rest.split(' ').skip(from).map(|v| v.parse::<f32>().unwrap());
            [0; 3].map(|_| values.next().unwrap())
        };
        match kind {
            "v" => {
                back.positions.push(three(0));
                back.colours.push(three(3).map(|c| (255.0 * c).round() as u8));
            }
            "vn" => back.normals.push(three(0)),
            "f" => {
                let corners: Vec<u32> = rest
                    .split(' ')
                    .map(|corner| {
                        let (position, normal) = corner.split_once("//").unwrap();
                        assert_eq!(position, normal);
                        position.parse::<u32>().unwrap() - 1
                    })
                    .collect();
                back.faces.push(corners.try_into().unwrap());
            }
            _ => panic!("{line}"),
        }
    }
    assert!(mesh.faces.len() > 1000);
    assert_eq!(back, mesh);
}
