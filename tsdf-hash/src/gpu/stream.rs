//! Blocks between the device and the processor, through a staging buffer of fixed size.

use wgpu::{Buffer, BufferUsages};

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{VOXELS, VoxelBlock};
use crate::error::Error;
use crate::gpu::device::Device;
use crate::gpu::pool::{BLOCK_BYTES, Pool};

/// Blocks that move together: 3.5 MiB.
const BATCH: usize = 512;
const BLOCK_WORDS: usize = BLOCK_BYTES / 4;

/// The staging buffer.
pub(super) struct Stream {
    staging: Buffer,
}

impl Stream {
    pub(super) fn new(device: &Device) -> Result<Self, Error> {
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        Ok(Self { staging: device.buffer("blocks on their way", BATCH * BLOCK_BYTES, usage)? })
    }

    /// Calls `each` with the blocks of these keys, in their order, until it fails; keys without a block are passed over.
    pub(super) fn download(
        &self,
        device: &Device,
        pool: &Pool,
        keys: &[BlockKey],
        mut each: impl FnMut(BlockKey, &VoxelBlock, BlockHistory) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut block = Box::new(VoxelBlock::ZERO);
        for batch in keys.chunks(BATCH) {
            let found = |&key: &BlockKey| pool.get(key).zip(pool.history(key)).map(|found| (key, found));
            let places: Vec<_> = batch.iter().filter_map(found).collect();
            let mut commands = device.commands();
            for (k, (_, (place, _))) in places.iter().enumerate() {
                let (from, to) = (place.offset() as u64, (k * BLOCK_BYTES) as u64);
                commands.copy_buffer_to_buffer(&pool.pages[place.page], from, &self.staging, to, BLOCK_BYTES as u64);
            }
            device.run_and_read(commands, &self.staging, places.len() * BLOCK_BYTES, |words| {
                for ((key, (_, history)), words) in places.iter().zip(words.chunks_exact(BLOCK_WORDS)) {
                    unpack(words, &mut block);
                    each(*key, &block, *history)?;
                }
                Ok::<(), Error>(())
            })??;
        }
        Ok(())
    }
}

/// Stores a block under a key that is new and that the caller has reserved a slot for. The driver stages it. After an error it
/// is not there.
pub(super) fn upload(
    device: &Device,
    pool: &mut Pool,
    key: BlockKey,
    block: &VoxelBlock,
    history: BlockHistory,
) -> Result<(), Error> {
    let place = pool.insert(key, history);
    let written = device.write(&pool.pages[place.page], place.offset(), pack(block).into_iter());
    written.inspect_err(|_| pool.remove(key))
}

/// The words of a block as the programs see it: distances, weights two to a word, colours.
fn pack(block: &VoxelBlock) -> [u32; BLOCK_WORDS] {
    let mut words = [0; BLOCK_WORDS];
    let (distances, rest) = words.split_at_mut(VOXELS);
    let (weights, colours) = rest.split_at_mut(VOXELS / 2);
    for (word, distance) in distances.iter_mut().zip(block.distance) {
        *word = distance.cast_unsigned();
    }
    let pair = |pair: &[u16]| u32::from(pair[0]) | u32::from(pair[1]) << 16;
    for (word, weights) in weights.iter_mut().zip(block.weight.chunks_exact(2)) {
        *word = pair(weights);
    }
    for (word, sums) in colours.iter_mut().zip(block.colour.as_flattened().chunks_exact(2)) {
        *word = pair(sums);
    }
    words
}

fn unpack(words: &[[u8; 4]], block: &mut VoxelBlock) {
    let (distances, rest) = words.split_at(VOXELS);
    let (weights, colours) = rest.split_at(VOXELS / 2);
    for (distance, &word) in block.distance.iter_mut().zip(distances) {
        *distance = i32::from_ne_bytes(word);
    }
    let halves = |pair: &mut [u16], word: [u8; 4]| {
        let word = u32::from_ne_bytes(word);
        pair.copy_from_slice(&[word as u16, (word >> 16) as u16]);
    };
    for (pair, &word) in block.weight.chunks_exact_mut(2).zip(weights) {
        halves(pair, word);
    }
    for (pair, &word) in block.colour.as_flattened_mut().chunks_exact_mut(2).zip(colours) {
        halves(pair, word);
    }
}
