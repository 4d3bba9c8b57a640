//! Changes of a single voxel: frames change whole neighbourhoods, and would hide what is not followed.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{ONE, VOXELS, VoxelBlock};
use crate::map::Map;
use crate::mesh::incremental::IncrementalMesher;
use crate::settings::Settings;

#[test]
fn a_change_of_one_voxel_reaches_every_cell_around_it() {
    let mut map = Map::new(Settings::default()).unwrap();
    // Two thirds of a voxel away: what is farther from a neighbour on the other side is no surface.
    let near = ONE / 6;
    let free = VoxelBlock { distance: [near; VOXELS], weight: [1; VOXELS], ..VoxelBlock::ZERO };
    // 4 x 4 x 4 blocks on either side of the origin.
    for n in 0..64 {
        let key = BlockKey::new([n % 4 - 2, n / 4 % 4 - 2, n / 16 - 2]).unwrap();
        map.storage.active.insert(key, Box::new(free.clone()), BlockHistory::default());
    }
    let mut mesher = IncrementalMesher::new();
    mesher.update(&map).unwrap();
    assert!(mesher.mesh().faces.is_empty());
    // One solid voxel, at each corner of a block in turn: eight cells in up to eight blocks, an octahedron.
    for corner in 0..8_usize {
        let voxel = [7, 7 * 8, 7 * 64].iter().enumerate().map(|(k, v)| if corner >> k & 1 == 1 { *v } else { 0 });
        let voxel = voxel.sum::<usize>();
        for (distance, faces) in [(-near, 8), (-ONE, 0), (near, 0)] {
            map.storage.active.get_mut(BlockKey::new([0; 3]).unwrap()).unwrap().0.distance[voxel] = distance;
            assert_eq!(mesher.update(&map).unwrap().changed, 1);
            assert_eq!(mesher.mesh().faces.len(), faces, "corner {corner}");
            assert_eq!(mesher.mesh(), map.mesh());
            // Half a voxel from the centre of the solid one, along the axes.
            let centre = [0, 1, 2].map(|k| if corner >> k & 1 == 1 { 0.075 } else { 0.005 });
            for position in &mesher.mesh().positions {
                let offset = nalgebra::Vector3::from(position.map(f64::from)) - nalgebra::Vector3::from(centre);
                assert!((offset.norm() - 0.005).abs() < 1e-6, "corner {corner}: {position:?}");
            }
        }
    }
}
