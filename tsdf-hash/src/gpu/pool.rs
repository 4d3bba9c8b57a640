//! Blocks in the device's memory: pages of slots, and on the processor the table that finds them.

use wgpu::{Buffer, BufferUsages};

use crate::blocks::active_blocks::MAX_BLOCKS;
use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::hash_table::HashTable;
use crate::blocks::voxel_block::VoxelBlock;
use crate::error::Error;
use crate::gpu::device::Device;

pub(super) const BLOCK_BYTES: usize = size_of::<VoxelBlock>();
/// More pages would not fit one program beside its other buffers.
pub(super) const MAX_PAGES: usize = 4;
/// Storage buffers of a program beside the pages.
pub(super) const OTHER_BINDINGS: usize = 2;
/// Bytes on the processor for each slot: its key, its history, and its place in the list of free ones.
const SLOT_BYTES: usize = size_of::<BlockKey>() + size_of::<BlockHistory>() + size_of::<u32>();
const VACANT: BlockKey = BlockKey(u64::MAX);

/// The memory of a block.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) page: usize,
    pub(super) slot: u32,
}

impl Place {
    /// Offset in the page, bytes.
    pub(super) fn offset(self) -> usize {
        self.slot as usize * BLOCK_BYTES
    }
}

/// The blocks on the device. Everything on the processor is allocated at once, pages one by one when they are needed.
pub(super) struct Pool {
    pub(super) pages: Vec<Buffer>,
    page_blocks: usize,
    capacity: usize,
    max_bytes: usize,
    table: HashTable,
    /// The key in each slot used so far.
    keys: Vec<BlockKey>,
    /// The history of the block in each slot.
    histories: Vec<BlockHistory>,
    free: Vec<u32>,
}

impl Pool {
    pub(super) fn new(device: &Device, max_bytes: usize) -> Result<Self, Error> {
        // The table's growth makes the need jump, so the bound is searched for: it is monotone.
        let (mut capacity, mut fails) = (0, MAX_BLOCKS.min(max_bytes / BLOCK_BYTES) + 1);
        while capacity + 1 < fails {
            let middle = usize::midpoint(capacity, fails);
            if host_bytes(middle) + middle * BLOCK_BYTES <= max_bytes { capacity = middle } else { fails = middle }
        }
        let most = MAX_PAGES.min(device.bindings - OTHER_BINDINGS);
        let page_blocks = (capacity / most).min(device.binding_bytes / BLOCK_BYTES);
        if page_blocks == 0 {
            let requirement = "large enough for four blocks: 65536 bytes do";
            return Err(Error::InvalidSetting { name: "max_bytes", value: max_bytes as f64, requirement });
        }
        let capacity = most * page_blocks;
        let mut table = HashTable::new();
        table.reserve(capacity);
        let (keys, histories) = (Vec::with_capacity(capacity), Vec::with_capacity(capacity));
        let free = Vec::with_capacity(capacity);
        let mut pool = Self { pages: Vec::new(), page_blocks, capacity, max_bytes, table, keys, histories, free };
        pool.reserve(device, 1)?;
        Ok(pool)
    }

    pub(super) fn len(&self) -> usize {
        self.keys.len() - self.free.len()
    }

    /// Blocks that can be added.
    pub(super) fn room(&self) -> usize {
        self.capacity - self.len()
    }

    pub(super) fn bytes(&self) -> usize {
        host_bytes(self.capacity) + self.pages.len() * self.page_blocks * BLOCK_BYTES
    }

    pub(super) fn out_of_budget(&self) -> Error {
        Error::OutOfBudget { used: self.bytes(), max_bytes: self.max_bytes }
    }

    pub(super) fn get(&self, key: BlockKey) -> Option<Place> {
        self.table.get(key).map(|slot| self.place(slot))
    }

    fn place(&self, slot: usize) -> Place {
        Place { page: slot / self.page_blocks, slot: (slot % self.page_blocks) as u32 }
    }

    /// Makes sure that there are pages for `added` more blocks; the caller has seen that there is [`room`](Self::room).
    pub(super) fn reserve(&mut self, device: &Device, added: usize) -> Result<(), Error> {
        let slots = self.keys.len() + added.saturating_sub(self.free.len());
        while self.pages.len() * self.page_blocks < slots {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            self.pages.push(device.buffer("blocks", self.page_blocks * BLOCK_BYTES, usage)?);
        }
        Ok(())
    }

    /// Gives a new key a slot, whose memory holds anything; the caller has [reserved](Self::reserve) it.
    pub(super) fn insert(&mut self, key: BlockKey, history: BlockHistory) -> Place {
        let slot = self.free.pop().unwrap_or(self.keys.len() as u32);
        self.keys.resize(self.keys.len().max(slot as usize + 1), VACANT);
        self.keys[slot as usize] = key;
        self.histories.resize(self.keys.len(), BlockHistory::default());
        self.histories[slot as usize] = history;
        self.table.set(key, slot);
        self.place(slot as usize)
    }

    pub(super) fn remove(&mut self, key: BlockKey) {
        if let Some(slot) = self.table.get(key) {
            self.table.remove(key);
            self.keys[slot] = VACANT;
            self.free.push(slot as u32);
        }
    }

    pub(super) fn history(&self, key: BlockKey) -> Option<BlockHistory> {
        self.table.get(key).map(|slot| self.histories[slot])
    }

    pub(super) fn history_mut(&mut self, key: BlockKey) -> Option<&mut BlockHistory> {
        self.table.get(key).map(|slot| &mut self.histories[slot])
    }

    /// Keys and histories, in the order of their slots.
    pub(super) fn histories(&self) -> impl Iterator<Item = (BlockKey, BlockHistory)> {
        let all = self.keys.iter().copied().zip(self.histories.iter().copied());
        all.filter(|&(key, _)| key != VACANT)
    }

    /// All keys, in the order of their slots.
    pub(super) fn keys(&self) -> impl Iterator<Item = BlockKey> {
        self.histories().map(|(key, _)| key)
    }

    /// All keys, ascending.
    pub(super) fn sorted_keys(&self) -> Vec<BlockKey> {
        let mut keys: Vec<BlockKey> = self.keys().collect();
        keys.sort_unstable();
        keys
    }
}

/// Bytes on the processor for this many blocks.
fn host_bytes(blocks: usize) -> usize {
    HashTable::bytes_for(blocks) + blocks * SLOT_BYTES
}
