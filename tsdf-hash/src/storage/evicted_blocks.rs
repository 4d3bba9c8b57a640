//! Blocks that have left active memory: in RAM as they left while there is room, compressed when it runs short, the oldest
//! first; then in the swap file. Those of an opened map file stay there until they change. Never two copies of one block.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::total_order::TotalOrder;
use crate::blocks::voxel_block::VoxelBlock;
use crate::codec::{MAX_BYTES, decode_add, encode};
use crate::error::Error;
use crate::storage::block_file::{BlockFile, StoredBlock};
use crate::storage::evicted_block::{EvictedBlock, FileRange, Location};
use crate::storage::sorted_pages::SortedPages;
use crate::storage::summary::BlockSummary;
use crate::storage::swap_file::SwapFile;

/// How many blocks are looked out at once to be compressed.
const BATCH: usize = 64;
/// Working memory that counts as used: a block to decode into, a compressed block read and one written, and the list of the
/// oldest.
const WORK_BYTES: usize = size_of::<VoxelBlock>() + 2 * MAX_BYTES + BATCH * size_of::<Age>();
/// Where there is a disk, compressed blocks go there before uncompressed ones take less than this part of the RAM.
const UNCOMPRESSED_SHARE: usize = 4;

/// What is compressed first: blocks that the current call has not touched, then by time.
type Age = (bool, TotalOrder, BlockKey);

/// A block that was not taken in, and why.
type Refused = (Box<VoxelBlock>, Error);

/// All evicted blocks. What they take in RAM, their index included, is capped.
pub(crate) struct EvictedBlocks {
    index: SortedPages<EvictedBlock>,
    swap: Option<SwapFile>,
    /// The map file that was opened.
    file: Option<BlockFile>,
    max_bytes: usize,
    /// How many are uncompressed and compressed in RAM, and the bytes of the latter; those that are staged included.
    uncompressed: usize,
    compressed: usize,
    compressed_bytes: usize,
    /// The block that went to disk last: the next one in the order of the keys follows it.
    spill_cursor: BlockKey,
    /// New copies, or that nothing is left, to replace the old ones when the frame is certain.
    staged: Vec<(BlockKey, Option<EvictedBlock>)>,
    /// The latest stamp of a block that was ever put here.
    latest_stamp: u64,
    /// The oldest uncompressed blocks when they were last looked for, the very oldest last.
    oldest: Vec<Age>,
    /// Number of the current call: what it is about to touch is compressed last.
    call: u32,
    buffer: Vec<u8>,
}

impl EvictedBlocks {
    pub(crate) fn new(max_bytes: usize, swap: Option<SwapFile>) -> Self {
        Self {
            index: SortedPages::new(),
            swap,
            file: None,
            max_bytes,
            uncompressed: 0,
            compressed: 0,
            compressed_bytes: 0,
            spill_cursor: BlockKey(0),
            staged: Vec::new(),
            latest_stamp: 0,
            oldest: Vec::new(),
            call: 0,
            buffer: Vec::new(),
        }
    }

    /// Nothing but the blocks of a map file.
    pub(crate) fn of_file(file: BlockFile, blocks: &[StoredBlock]) -> Self {
        let mut evicted = Self::new(0, None);
        evicted.add_file(file, blocks);
        evicted
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.index.len() == 0
    }

    /// Whether blocks can be evicted at all.
    pub(crate) fn is_enabled(&self) -> bool {
        self.max_bytes > 0
    }

    pub(crate) fn host_bytes(&self) -> usize {
        if self.is_enabled() { self.bytes_with(0, 0) } else { 0 }
    }

    pub(crate) fn disk_bytes(&self) -> u64 {
        self.swap.as_ref().map_or(0, SwapFile::bytes)
    }

    /// Blocks in RAM, in the swap file and in the map file.
    pub(crate) fn counts(&self) -> [usize; 3] {
        let (in_ram, swapped) = (self.uncompressed + self.compressed, self.swap.as_ref().map_or(0, SwapFile::blocks));
        [in_ram, swapped, self.index.len() - in_ram - swapped]
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = BlockKey> + '_ {
        self.index.iter().map(|(key, _)| key)
    }

    pub(crate) fn latest_stamp(&self) -> u64 {
        self.latest_stamp
    }

    pub(crate) fn histories(&self) -> impl Iterator<Item = (BlockKey, BlockHistory)> + '_ {
        self.index.iter().map(|(key, evicted)| (key, evicted.history))
    }

    pub(crate) fn contains(&self, key: BlockKey) -> bool {
        self.index.get(key).is_some()
    }

    /// What is known of a block, uncompressed or not.
    pub(crate) fn summary(&self, key: BlockKey) -> Option<BlockSummary> {
        self.index.get(key)?.summary()
    }

    /// A block that needs no decoding.
    pub(crate) fn uncompressed(&self, key: BlockKey) -> Option<&VoxelBlock> {
        self.index.get(key)?.block()
    }

    /// Adds a block to `sum`, if it is here. After an error `sum` is as it was.
    pub(crate) fn add_to(&self, key: BlockKey, sum: &mut VoxelBlock) -> Result<Option<BlockHistory>, Error> {
        let Some(EvictedBlock { history, location }) = self.index.get(key) else { return Ok(None) };
        let corrupt = || Error::CorruptBlock { what: "a block outside memory", block: key.block() };
        match location {
            Location::Uncompressed(block) => drop(sum.add(block)),
            Location::CheckedOut => return Ok(None),
            Location::Compressed(bytes, _) => decode_add(bytes, sum).ok_or_else(corrupt)?,
            Location::InFile(range, summary) => {
                let mut bytes = vec![0; usize::from(range.len)];
                match (range.in_swap, &self.swap, &self.file) {
                    (false, _, Some(file)) => file.read(range.at, &mut bytes)?,
                    (true, Some(swap), _) => swap
                        .read(range.at as u32, &mut bytes)
                        .map_err(|source| Error::Io { what: "reading the swap file", source })?,
                    _ => return Err(corrupt()),
                }
                let mut block = Box::new(VoxelBlock::ZERO);
                decode_add(&bytes, &mut block).filter(|()| BlockSummary::of(&block) == *summary).ok_or_else(corrupt)?;
                sum.add(&block);
            }
        }
        Ok(Some(*history))
    }

    /// Removes a block, if it is here; whether it was.
    pub(crate) fn remove(&mut self, key: BlockKey) -> bool {
        let removed = self.index.remove(key);
        removed.map(|evicted| self.release(&evicted)).is_some()
    }

    /// Adds a block to the copy that is here, or puts it here.
    ///
    /// # Errors
    /// When nothing has room for it, or the disk fails; nothing has changed then, and the block comes back.
    pub(crate) fn put(&mut self, key: BlockKey, block: Box<VoxelBlock>, history: BlockHistory) -> Result<(), Refused> {
        let evicted = self.merged(key, block, history)?;
        self.install(key, Some(evicted));
        Ok(())
    }

    /// The same, but only when [`commit`](Self::commit) is called.
    pub(crate) fn stage(&mut self, key: BlockKey, block: Box<VoxelBlock>, history: BlockHistory) -> Result<(), Error> {
        let evicted = self.merged(key, block, history).map_err(|(_, error)| error)?;
        self.staged.push((key, Some(evicted)));
        Ok(())
    }

    /// Stages a block in the place of the copy that is here.
    pub(crate) fn stage_instead(
        &mut self,
        key: BlockKey,
        block: Box<VoxelBlock>,
        history: BlockHistory,
    ) -> Result<(), Error> {
        let evicted = if block.is_empty() {
            None
        } else if self.make_room()? {
            self.uncompressed += 1;
            Some(EvictedBlock::uncompressed(block, history))
        } else {
            Some(self.compress(&block, history)?)
        };
        self.staged.push((key, evicted));
        Ok(())
    }

    /// Nothing can fail here: what is staged has its room.
    pub(crate) fn commit(&mut self) {
        for (key, evicted) in std::mem::take(&mut self.staged) {
            self.install(key, evicted);
        }
    }

    pub(crate) fn abort(&mut self) {
        for (_, evicted) in std::mem::take(&mut self.staged) {
            if let Some(evicted) = &evicted {
                self.release(evicted);
            }
        }
    }

    /// Whether a block is uncompressed in RAM; it is then noted that the current call is about to touch it.
    pub(crate) fn mark_used(&mut self, key: BlockKey, call: u32) -> bool {
        self.call = call;
        let evicted = self.index.get_mut(key).filter(|evicted| evicted.is_uncompressed());
        evicted.map(|evicted| evicted.history.call = call).is_some()
    }

    /// Takes out an uncompressed block to be worked on; [`check_in`](Self::check_in) returns it.
    pub(crate) fn check_out(&mut self, key: BlockKey) -> Option<Box<VoxelBlock>> {
        let evicted = self.index.get_mut(key).filter(|evicted| evicted.block().is_some())?;
        match std::mem::replace(&mut evicted.location, Location::CheckedOut) {
            Location::Uncompressed(block) => Some(block),
            _ => None,
        }
    }

    pub(crate) fn check_in(&mut self, key: BlockKey, block: Box<VoxelBlock>) {
        if let Some(evicted) = self.index.get_mut(key) {
            evicted.location = Location::Uncompressed(block);
        }
    }

    /// Notes by `update` that an uncompressed block has changed, and removes it if nothing is left of it: then `true`.
    pub(crate) fn changed(&mut self, key: BlockKey, update: impl FnOnce(&mut BlockHistory)) -> bool {
        let Some(evicted) = self.index.get_mut(key) else { return false };
        update(&mut evicted.history);
        self.latest_stamp = self.latest_stamp.max(evicted.history.stamp);
        let gone = evicted.block().is_some_and(VoxelBlock::is_empty);
        gone && self.remove(key)
    }

    /// Makes the blocks of a map file part of the map. They are read when they are needed.
    pub(crate) fn open(&mut self, file: BlockFile, blocks: &[StoredBlock]) -> Result<(), Error> {
        if self.bytes_with(blocks.len(), 0) > self.max_bytes {
            return Err(self.full());
        }
        self.add_file(file, blocks);
        Ok(())
    }

    fn add_file(&mut self, file: BlockFile, blocks: &[StoredBlock]) {
        self.file = Some(file);
        for &StoredBlock { key, at, len, last_update, frames, summary } in blocks {
            let history = BlockHistory { last_update, frames, call: 0, stamp: 0 };
            let location = Location::InFile(FileRange { at, len, in_swap: false }, summary);
            self.index.insert(key, EvictedBlock { history, location });
        }
    }

    fn full(&self) -> Error {
        Error::StorageFull { host_bytes: self.host_bytes(), disk_bytes: self.disk_bytes() }
    }

    /// The sum of a block and the copy that is here, uncompressed if there is room.
    fn merged(
        &mut self,
        key: BlockKey,
        mut block: Box<VoxelBlock>,
        history: BlockHistory,
    ) -> Result<EvictedBlock, Refused> {
        match self.make_room() {
            Ok(true) => match self.add_to(key, &mut block) {
                Ok(old) => {
                    self.uncompressed += 1;
                    Ok(EvictedBlock::uncompressed(block, old.map_or(history, |old| old.merged(history))))
                }
                Err(error) => Err((block, error)),
            },
            Ok(false) => self.merged_and_compressed(key, &block, history).map_err(|error| (block, error)),
            Err(error) => Err((block, error)),
        }
    }

    fn merged_and_compressed(
        &mut self,
        key: BlockKey,
        block: &VoxelBlock,
        history: BlockHistory,
    ) -> Result<EvictedBlock, Error> {
        if !self.contains(key) {
            return self.compress(block, history);
        }
        let mut sum = Box::new(block.clone());
        let old = self.add_to(key, &mut sum)?.unwrap_or_default();
        self.compress(&sum, old.merged(history))
    }

    /// A compressed block, where there is no room for an uncompressed one.
    fn compress(&mut self, block: &VoxelBlock, history: BlockHistory) -> Result<EvictedBlock, Error> {
        if !self.is_enabled() {
            return Err(self.full());
        }
        self.encode(block);
        if self.bytes_with(1, 0) + self.buffer.len() > self.max_bytes {
            return Err(self.full());
        }
        self.compressed += 1;
        self.compressed_bytes += self.buffer.len();
        let location = Location::Compressed(self.buffer.as_slice().into(), BlockSummary::of(block));
        Ok(EvictedBlock { history, location })
    }

    fn encode(&mut self, block: &VoxelBlock) {
        self.buffer.clear();
        self.buffer.reserve_exact(MAX_BYTES);
        encode(block, &mut self.buffer);
    }

    /// The counters have seen what comes here.
    fn install(&mut self, key: BlockKey, evicted: Option<EvictedBlock>) {
        self.remove(key);
        if let Some(evicted) = evicted {
            self.latest_stamp = self.latest_stamp.max(evicted.history.stamp);
            self.index.insert(key, evicted);
        }
    }

    /// Forgets what a block has used.
    fn release(&mut self, evicted: &EvictedBlock) {
        match &evicted.location {
            Location::Uncompressed(_) | Location::CheckedOut => self.uncompressed -= 1,
            Location::Compressed(bytes, _) => {
                self.compressed -= 1;
                self.compressed_bytes -= bytes.len();
            }
            Location::InFile(range, _) => {
                if let Some(swap) = self.swap.as_mut().filter(|_| range.in_swap) {
                    swap.release(range.at as u32, usize::from(range.len));
                }
            }
        }
    }

    /// Bytes of RAM when so many more are indexed, and so many of them uncompressed; without the compressed bytes to come.
    fn bytes_with(&self, indexed: usize, uncompressed: usize) -> usize {
        let index = self.index.bytes_with(self.staged.len() + indexed);
        let blocks = (self.uncompressed + uncompressed) * size_of::<VoxelBlock>();
        index + blocks + self.compressed_bytes + WORK_BYTES
    }

    /// Makes room for one more uncompressed block; `false` if that cannot be: then all that could be was compressed and
    /// spilled.
    fn make_room(&mut self) -> Result<bool, Error> {
        while !self.is_enabled() || self.bytes_with(1, 1) > self.max_bytes {
            if !self.is_enabled() || !self.free_memory()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Frees some RAM; `false` if there is no way.
    fn free_memory(&mut self) -> Result<bool, Error> {
        let few = self.uncompressed * size_of::<VoxelBlock>() <= self.max_bytes / UNCOMPRESSED_SHARE;
        let spill_first = self.swap.is_some() && few;
        Ok((spill_first && self.spill()?) || self.compress_oldest() || (!spill_first && self.spill()?))
    }

    /// Compresses the oldest uncompressed block, a staged one last; `false` if there is none, or if that would free nothing.
    fn compress_oldest(&mut self) -> bool {
        let mut buffer = std::mem::take(&mut self.buffer);
        let oldest = self.next_oldest();
        let evicted = match oldest {
            Some(key) => self.index.get_mut(key),
            // The last one: those before it have been compressed already.
            None => {
                self.staged.iter_mut().rev().find_map(|(_, staged)| staged.as_mut().filter(|e| e.is_uncompressed()))
            }
        };
        let mut freed = false;
        if let Some(evicted) = evicted
            && let Some(block) = evicted.block()
        {
            buffer.clear();
            buffer.reserve_exact(MAX_BYTES);
            encode(block, &mut buffer);
            freed = buffer.len() < size_of::<VoxelBlock>();
            if freed {
                let summary = BlockSummary::of(block);
                evicted.location = Location::Compressed(buffer.as_slice().into(), summary);
                self.uncompressed -= 1;
                self.compressed += 1;
                self.compressed_bytes += buffer.len();
            }
        }
        self.buffer = buffer;
        freed
    }

    /// The block that no frame has updated for longest, by its age when it was last looked at.
    fn next_oldest(&mut self) -> Option<BlockKey> {
        loop {
            while let Some(age) = self.oldest.pop() {
                if self.index.get(age.2).is_some_and(|evicted| self.age(age.2, evicted) == Some(age)) {
                    return Some(age.2);
                }
            }
            let mut all: Vec<Age> = self.index.iter().filter_map(|(key, evicted)| self.age(key, evicted)).collect();
            if all.is_empty() {
                return None;
            }
            if all.len() > BATCH {
                all.select_nth_unstable(BATCH);
                all.truncate(BATCH);
            }
            all.sort_unstable();
            self.oldest.reserve_exact(BATCH);
            self.oldest.extend(all.into_iter().rev());
        }
    }

    /// Of a block that can be compressed.
    fn age(&self, key: BlockKey, evicted: &EvictedBlock) -> Option<Age> {
        let BlockHistory { call, last_update, .. } = evicted.history;
        evicted.block().map(|_| (call == self.call, TotalOrder(last_update), key))
    }

    /// Moves a compressed block from RAM to disk, a staged one last; `false` if there is none or no room.
    fn spill(&mut self) -> Result<bool, Error> {
        let Some(swap) = self.swap.as_mut().filter(|_| self.compressed > 0) else { return Ok(false) };
        let next = self.index.next_after(self.spill_cursor, EvictedBlock::is_compressed).map(|(key, _)| key);
        let evicted = match next {
            Some(key) => self.index.get_mut(key),
            None => self.staged.iter_mut().rev().find_map(|(_, staged)| staged.as_mut().filter(|e| e.is_compressed())),
        };
        let Some(EvictedBlock { location, .. }) = evicted else { return Ok(false) };
        let Location::Compressed(bytes, summary) = &*location else { return Ok(false) };
        let written = swap.write(bytes).map_err(|source| Error::Io { what: "writing the swap file", source })?;
        let Some(at) = written else { return Ok(false) };
        let len = bytes.len();
        *location = Location::InFile(FileRange { at: u64::from(at), len: len as u16, in_swap: true }, *summary);
        self.compressed -= 1;
        self.compressed_bytes -= len;
        self.spill_cursor = next.unwrap_or(self.spill_cursor);
        Ok(true)
    }
}

#[cfg(test)]
mod tests;
