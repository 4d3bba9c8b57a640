//! Two copies of a block are its sum, whether there is room for it as it is or only compressed.

use super::EvictedBlocks;
use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{VOXELS, VoxelBlock};
use crate::storage::swap_file::SwapFile;

/// The same in all voxels, so that it takes few bytes when it is compressed.
fn even(distance: f32, weight: u16) -> Box<VoxelBlock> {
    let mut block = Box::new(VoxelBlock::ZERO);
    (0..VOXELS).for_each(|voxel| assert!(block.add_distance(voxel, distance, weight)));
    block
}

fn history(last_update: f64, frames: u32) -> BlockHistory {
    BlockHistory { last_update, frames, ..BlockHistory::default() }
}

/// Room for many blocks; and for none that is not compressed.
fn rooms() -> [usize; 2] {
    let none = EvictedBlocks::new(usize::MAX / 2, None);
    [1 << 24, none.bytes_with(8, 0) + 2000]
}

#[test]
fn an_older_copy_is_added_also_where_memory_is_full() {
    let key = BlockKey::new([3, -2, 5]).unwrap();
    for (room, compressed) in rooms().into_iter().zip([false, true]) {
        let mut evicted = EvictedBlocks::new(room, None);
        assert!(evicted.put(key, even(0.5, 2), history(7.0, 4)).is_ok());
        assert_eq!(evicted.uncompressed(key).is_none(), compressed);
        assert!(evicted.put(key, even(-0.25, 3), history(3.0, 2)).is_ok());
        let mut sum = VoxelBlock::ZERO;
        let kept = evicted.add_to(key, &mut sum).unwrap().unwrap();
        let [one, other] = [even(0.5, 2), even(-0.25, 3)].map(|block| block.sums(100).unwrap().0);
        for voxel in 0..VOXELS {
            assert_eq!(sum.sums(voxel), Some((one + other, 5, [0; 4])), "voxel {voxel} of {room} bytes");
        }
        assert_eq!((kept.last_update, kept.frames), (7.0, 6));
        assert_eq!(evicted.counts(), [1, 0, 0]);
        assert!(evicted.host_bytes() <= room);
    }
}

/// What is staged counts from its commit on; until then, and after an abort, the older copy is what there is.
#[test]
fn a_staged_copy_counts_when_it_is_certain() {
    let key = BlockKey::new([0, 1, -1]).unwrap();
    for room in rooms() {
        let mut evicted = EvictedBlocks::new(room, None);
        assert!(evicted.put(key, even(0.5, 2), history(1.0, 1)).is_ok());
        let weight = |evicted: &EvictedBlocks| {
            let mut sum = VoxelBlock::ZERO;
            evicted.add_to(key, &mut sum).unwrap().unwrap();
            sum.weight(0)
        };
        let bytes = evicted.host_bytes();
        evicted.stage(key, even(0.5, 3), history(2.0, 1)).unwrap();
        assert_eq!(weight(&evicted), 2);
        evicted.abort();
        assert_eq!((weight(&evicted), evicted.host_bytes()), (2, bytes));
        evicted.stage(key, even(0.5, 3), history(2.0, 1)).unwrap();
        evicted.commit();
        assert_eq!(weight(&evicted), 5);
        // In its place instead of beside it; nothing at all removes it.
        evicted.stage_instead(key, even(0.5, 7), history(3.0, 1)).unwrap();
        evicted.commit();
        assert_eq!(weight(&evicted), 7);
        evicted.stage_instead(key, Box::new(VoxelBlock::ZERO), history(4.0, 1)).unwrap();
        evicted.commit();
        assert!(evicted.is_empty() && evicted.counts() == [0; 3]);
    }
}

/// While uncompressed blocks fill the memory, the oldest are compressed and stay in it; the disk is for what then still finds no room.
#[test]
fn blocks_are_compressed_before_they_go_to_disk() {
    let path = std::env::temp_dir().join(format!("tsdf-hash-compressed-first-{}", std::process::id()));
    let room = 1 << 20;
    let mut evicted = EvictedBlocks::new(room, Some(SwapFile::create(&path, 1 << 20).unwrap()));
    let fit = room / size_of::<VoxelBlock>();
    let mut put = |k: usize| {
        let key = BlockKey::new([k as i32, 0, 0]).unwrap();
        assert!(evicted.put(key, even(0.5, 2), history(k as f64, 1)).is_ok());
        (evicted.counts(), evicted.uncompressed)
    };
    let (counts, uncompressed) = (0..fit + 10).map(&mut put).last().unwrap();
    assert_eq!(counts, [fit + 10, 0, 0], "a few more than fit uncompressed");
    assert!(uncompressed < fit);
}
