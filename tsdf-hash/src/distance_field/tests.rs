//! Changes of a single voxel: frames change whole neighbourhoods, and would hide what is not followed.

use nalgebra::Point3;

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{ONE, VOXELS, VoxelBlock};
use crate::distance_field::field::DistanceField;
use crate::distance_field::settings::DistanceSettings;
use crate::map::Map;
use crate::settings::Settings;

/// 4 x 4 x 4 blocks of free space on either side of the origin.
fn free_space() -> (Map, DistanceField) {
    let mut map = Map::new(Settings::default()).unwrap();
    let free = VoxelBlock { distance: [ONE; VOXELS], weight: [1; VOXELS], ..VoxelBlock::ZERO };
    for n in 0..64 {
        let key = BlockKey::new([n % 4 - 2, n / 4 % 4 - 2, n / 16 - 2]).unwrap();
        map.storage.active.insert(key, Box::new(free.clone()), BlockHistory::default());
    }
    let mut field = DistanceField::new(&DistanceSettings { max_distance: 0.2 }).unwrap();
    field.update(&map).unwrap();
    assert_eq!(field.sites().count(), 0);
    (map, field)
}

/// The voxel in a corner of the block at the origin, and its coordinates.
fn corner(n: usize) -> (usize, [f64; 3]) {
    let at = [0, 1, 2].map(|k| 7 * (n >> k & 1));
    (at[0] + 8 * (at[1] + 8 * at[2]), at.map(|c| c as f64))
}

#[test]
fn one_solid_voxel_has_six_sites_half_a_voxel_away() {
    let (mut map, mut field) = free_space();
    for n in 0..8 {
        let (voxel, at) = corner(n);
        for (distance, sites) in [(-ONE, 6), (ONE, 0)] {
            map.storage.active.get_mut(BlockKey::new([0; 3]).unwrap()).unwrap().0.distance[voxel] = distance;
            assert_eq!(field.update(&map).unwrap().changed, 1);
            assert_eq!(field.sites().count(), sites, "corner {n}");
        }
        // A third solid: the zero lies at three quarters of the way from the free voxels.
        map.storage.active.get_mut(BlockKey::new([0; 3]).unwrap()).unwrap().0.distance[voxel] = -ONE / 3;
        field.update(&map).unwrap();
        for step in 0..6 {
            let mut point = Point3::from(at.map(|c| (c + 0.5) * 0.01));
            point[step / 2] += if step % 2 == 0 { 0.0025 } else { -0.0025 };
            assert!(field.distance(&point).unwrap() < 1e-6, "corner {n}, side {step}");
            point[step / 2] += if step % 2 == 0 { 0.1 } else { -0.1 };
            assert!((field.distance(&point).unwrap() - 0.1).abs() < 1e-6, "corner {n}, side {step}");
        }
        map.storage.active.get_mut(BlockKey::new([0; 3]).unwrap()).unwrap().0.distance[voxel] = ONE;
        field.update(&map).unwrap();
    }
}

#[test]
fn a_block_that_is_gone_takes_the_edges_into_it_along() {
    for n in 0..8 {
        let (mut map, mut field) = free_space();
        let key = BlockKey::new([0; 3]).unwrap();
        map.storage.active.get_mut(key).unwrap().0.distance[corner(n).0] = -ONE;
        field.update(&map).unwrap();
        assert_eq!(field.sites().count(), 6);
        assert!(map.storage.active.remove(key).is_some());
        map.storage.active.clock.count_removed(1);
        assert_eq!(field.update(&map).unwrap().removed, 1);
        assert_eq!(field.sites().count(), 0, "corner {n}");
        assert_eq!(field.distance(&Point3::origin()), None);
    }
}
