//! One frame integrated or deintegrated: whole or not at all.

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::VoxelBlock;
use crate::error::Error;
use crate::integration::integrator::{Frame, Operation, UpdateCount};
use crate::parallel::in_chunks;
use crate::storage::block_storage::BlockStorage;

/// What a frame did.
#[derive(Default)]
pub(crate) struct FrameChange {
    pub(crate) voxels: usize,
    pub(crate) blocks: usize,
    pub(crate) added: usize,
    pub(crate) removed: usize,
    /// Blocks that the frame touched and that are active.
    pub(crate) touched: Vec<BlockKey>,
    /// Evicted blocks that it changed where they are.
    in_host: Vec<BlockKey>,
}

/// A frame, and what is to be done with it.
#[derive(Clone, Copy)]
pub(crate) struct FrameJob<'a> {
    pub(crate) frame: &'a Frame<'a>,
    pub(crate) operation: Operation,
    /// When the frame was taken, seconds, and from where, in blocks.
    pub(crate) time: f64,
    pub(crate) camera: [f64; 3],
    pub(crate) threads: usize,
}

/// A block in work, out of its slot.
struct CheckedOut {
    key: BlockKey,
    slot: usize,
    block: Box<VoxelBlock>,
    count: UpdateCount,
}

/// The part of a frame in a block that was neither active nor uncompressed in host memory.
struct PartialBlock {
    key: BlockKey,
    block: Box<VoxelBlock>,
    voxels: usize,
}

/// A frame on its way into the storage.
struct FrameUpdate<'a> {
    storage: &'a mut BlockStorage,
    job: FrameJob<'a>,
    change: FrameChange,
}

/// Why a frame is not applied.
pub(crate) enum Refusal {
    /// These blocks have no room for it; there may be others.
    Full(Vec<BlockKey>),
    Error(Error),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl Refusal {
    /// Of a frame whose part in some blocks, one at least, does not fit the counters.
    pub(crate) fn of(operation: Operation, mut blocks: Vec<BlockKey>) -> Self {
        blocks.sort_unstable();
        match operation {
            Operation::Integrate => Self::Full(blocks),
            Operation::Deintegrate => Self::Error(Error::NotIntegrated { block: blocks[0].block() }),
        }
    }
}

/// Blocks that a frame passes over.
#[derive(Default)]
pub(crate) struct PassedOver {
    /// Sorted.
    blocks: Vec<BlockKey>,
    /// Whether those join that have no room for it; otherwise it is refused.
    grows: bool,
}

impl PassedOver {
    /// What a frame was passed over in before, and is again.
    pub(crate) fn new(blocks: &[[i32; 3]]) -> Self {
        let mut blocks: Vec<BlockKey> = blocks.iter().copied().filter_map(BlockKey::new).collect();
        blocks.sort_unstable();
        Self { blocks, grows: false }
    }

    /// None yet; those join that have no room.
    pub(crate) fn growing() -> Self {
        Self { grows: true, ..Self::default() }
    }

    /// In place of what was there.
    pub(crate) fn write(&self, blocks: &mut Vec<[i32; 3]>) {
        blocks.clear();
        blocks.extend(self.blocks.iter().map(|key| key.block()));
    }

    /// Tries to apply a frame to its blocks, passing over more of them from try to try.
    pub(crate) fn apply<T>(
        &mut self,
        keys: &[BlockKey],
        mut attempt: impl FnMut(&[BlockKey]) -> Result<T, Refusal>,
    ) -> Result<T, Error> {
        loop {
            let rest: Vec<BlockKey>;
            let wanted = if self.blocks.is_empty() {
                keys
            } else {
                rest = keys.iter().copied().filter(|key| self.blocks.binary_search(key).is_err()).collect();
                &rest
            };
            match attempt(wanted) {
                Ok(done) => return Ok(done),
                Err(Refusal::Full(more)) if self.grows => {
                    self.blocks.extend(more);
                    self.blocks.sort_unstable();
                }
                Err(Refusal::Full(blocks)) => return Err(Error::Saturated { block: blocks[0].block() }),
                Err(Refusal::Error(error)) => return Err(error),
            }
        }
    }
}

/// Applies a frame to those of the blocks near it that have these keys, in a [call](BlockStorage::begin_call). After an error the sums
/// are as they were.
pub(crate) fn apply_frame(
    storage: &mut BlockStorage,
    job: FrameJob,
    keys: &[BlockKey],
) -> Result<FrameChange, Refusal> {
    let mut update = FrameUpdate { storage, job, change: FrameChange::default() };
    update.run(keys)?;
    Ok(update.change)
}

impl FrameUpdate<'_> {
    fn run(&mut self, keys: &[BlockKey]) -> Result<(), Refusal> {
        if self.job.operation == Operation::Deintegrate {
            // What is taken out must have been in: that can be seen on whole sums only.
            self.consolidate(keys)?;
        }
        let mut inactive = Vec::new();
        let mut present = Vec::with_capacity(keys.len());
        for &key in keys {
            let active = &mut self.storage.active;
            match active.slot(key).and_then(|slot| Some((slot, active.take(slot)?))) {
                Some((slot, block)) => present.push(CheckedOut { key, slot, block, count: UpdateCount::default() }),
                None => inactive.push(key),
            }
        }
        self.job.update(self.job.operation, &mut present);
        let overflow = present.iter().filter(|work| work.count.overflow).map(|work| work.key).collect();
        self.put_back(present);
        let outcome =
            self.none(overflow).and_then(|()| self.check_split_blocks()).and_then(|()| self.update_inactive(inactive));
        match outcome {
            Ok(partials) => {
                self.finish(partials);
                self.storage.active.clock.count_removed(self.change.removed);
                Ok(())
            }
            Err(error) => {
                self.storage.evicted.abort();
                self.undo();
                Err(error)
            }
        }
    }

    /// Refuses a frame that has no room in some blocks.
    fn none(&self, unfit: Vec<BlockKey>) -> Result<(), Refusal> {
        if unfit.is_empty() { Ok(()) } else { Err(Refusal::of(self.job.operation, unfit)) }
    }

    fn put_back(&mut self, present: Vec<CheckedOut>) {
        for work in present {
            self.storage.active.put(work.slot, work.block);
            if work.count.voxels > 0 {
                self.storage.active.mark_changed(work.slot, self.storage.call);
                self.change.touched.push(work.key);
                self.change.voxels += work.count.voxels;
            }
        }
    }

    /// Wrapping sums form a group: the opposite update restores every bit.
    fn undo(&mut self) {
        let active = &mut self.storage.active;
        let taken = self.change.touched.iter().filter_map(|&key| {
            let slot = active.slot(key)?;
            Some(CheckedOut { key, slot, block: active.take(slot)?, count: UpdateCount::default() })
        });
        let mut present: Vec<_> = taken.collect();
        self.job.update(self.job.operation.opposite(), &mut present);
        for work in present {
            self.storage.active.put(work.slot, work.block);
        }
    }

    /// An active copy may have room left where the sum with the others has none.
    fn check_split_blocks(&self) -> Result<(), Refusal> {
        let mut unfit = Vec::new();
        if self.job.operation == Operation::Integrate && !self.storage.all_active() {
            for &key in &self.change.touched {
                let fits = self.storage.active.get(key).map_or(Ok(true), |block| self.storage.fits(key, block))?;
                unfit.extend((!fits).then_some(key));
            }
        }
        self.none(unfit)
    }

    /// Brings together all copies of the blocks that have one in active memory, and merges the reloaded ones.
    fn consolidate(&mut self, keys: &[BlockKey]) -> Result<(), Error> {
        let storage = &mut *self.storage;
        if storage.all_active() {
            return Ok(());
        }
        for &key in keys {
            storage.merge_reloaded_block(key)?;
            if let Some((block, history)) = storage.active.get_mut(key)
                && let Some(older) = storage.evicted.add_to(key, block)?
            {
                *history = older.merged(*history);
                storage.evicted.remove(key);
            }
        }
        Ok(())
    }

    /// The frame in blocks that are not active. As long as active memory has room, once what the frame does not touch is
    /// evicted, it gets copies of what is new in them: those are returned. For the rest, uncompressed blocks in host memory
    /// are changed where they are, and what is new elsewhere is staged among the evicted ones.
    fn update_inactive(&mut self, mut inactive: Vec<BlockKey>) -> Result<Vec<PartialBlock>, Refusal> {
        let mut kept = Vec::new();
        while self.job.operation == Operation::Integrate
            && !inactive.is_empty()
            && self.storage.active.room() + self.storage.evictable() > kept.len()
        {
            let some = self.batch_size(&kept).min(inactive.len());
            self.add_partials(&mut inactive[..some], &mut kept)?;
            inactive.drain(..some);
        }
        // To stage one block, another one may have to be compressed.
        loop {
            let (call, evicted) = (self.storage.call, &mut self.storage.evicted);
            let (uncompressed, mut others): (Vec<_>, Vec<_>) =
                inactive.into_iter().partition(|&key| evicted.mark_used(key, call));
            inactive = uncompressed;
            if others.is_empty() {
                break;
            }
            for some in others.chunks_mut(self.batch_size(&kept)) {
                self.add_partials(some, &mut kept)?;
            }
        }
        // Last, because it cannot be taken back.
        self.update_in_host(&inactive)?;
        Ok(kept)
    }

    /// How many partial sums may wait outside the tables: one blank block per thread, and one to check sums with, count too.
    fn batch_size(&self, kept: &[PartialBlock]) -> usize {
        let active = &self.storage.active;
        (active.room() + active.spare()).saturating_sub(kept.len() + 1 + self.threads_for_partials()).max(1)
    }

    fn threads_for_partials(&self) -> usize {
        self.job.threads.min(self.storage.active.spare() - 2)
    }

    /// Adds the parts of a frame in blocks that are neither active nor uncompressed, or takes them out.
    fn add_partials(&mut self, keys: &mut [BlockKey], kept: &mut Vec<PartialBlock>) -> Result<(), Refusal> {
        let partials = partials(self.job.frame, keys, self.threads_for_partials());
        if self.job.operation == Operation::Integrate {
            let mut unfit = Vec::new();
            for partial in &partials {
                unfit.extend((!self.storage.fits(partial.key, &partial.block)?).then_some(partial.key));
            }
            self.none(unfit)?;
        }
        let mut waiting = partials.len();
        let mut room = self.storage.active.room().saturating_sub(kept.len());
        let mut evictable = self.storage.evictable();
        for partial in partials {
            self.change.voxels += partial.voxels;
            self.change.blocks += 1;
            if self.job.operation == Operation::Deintegrate {
                self.change.removed += usize::from(self.deintegrate_evicted(&partial)?);
                continue;
            }
            self.change.added += usize::from(self.is_new(partial.key));
            if room == 0 && evictable > 0 {
                self.storage.make_room(waiting, self.job.camera)?;
                evictable = 0;
                room = self.storage.active.room().saturating_sub(kept.len());
            }
            waiting -= 1;
            if room > 0 {
                room -= 1;
                kept.push(partial);
            } else {
                let history = self.storage.new_history(self.job.time);
                let staged = self.storage.evicted.stage(partial.key, partial.block, history);
                staged.map_err(|error| self.storage.storage_error(error))?;
            }
        }
        Ok(())
    }

    /// Changes uncompressed blocks in host memory. After an error they are as they were.
    fn update_in_host(&mut self, keys: &[BlockKey]) -> Result<(), Refusal> {
        let taken = keys.iter().filter_map(|&key| {
            let block = self.storage.evicted.check_out(key)?;
            Some(CheckedOut { key, slot: 0, block, count: UpdateCount::default() })
        });
        let mut present: Vec<_> = taken.collect();
        self.job.update(self.job.operation, &mut present);
        let outcome = self.unfit(&present).map_err(Refusal::Error).and_then(|unfit| self.none(unfit));
        if outcome.is_err() {
            self.job.update(self.job.operation.opposite(), &mut present);
        }
        for work in present {
            self.storage.evicted.check_in(work.key, work.block);
            if work.count.voxels > 0 {
                self.change.in_host.push(work.key);
                self.change.voxels += work.count.voxels;
            }
        }
        outcome
    }

    /// Those of the blocks that cannot take what the frame has added to them, or have not got what it has taken out.
    fn unfit(&self, present: &[CheckedOut]) -> Result<Vec<BlockKey>, Error> {
        // Checked out it does not count twice: what it has to fit together with is reloaded.
        let alone = self.job.operation == Operation::Deintegrate || self.storage.reloaded.len() == 0;
        let mut unfit = Vec::new();
        for work in present {
            let fits = !work.count.overflow && (alone || self.storage.fits(work.key, &work.block)?);
            unfit.extend((!fits).then_some(work.key));
        }
        Ok(unfit)
    }

    fn is_new(&self, key: BlockKey) -> bool {
        !self.storage.evicted.contains(key) && self.storage.reloaded.get(key).is_none()
    }

    /// Takes a partial sum out of an evicted block; returns whether nothing is left of it.
    fn deintegrate_evicted(&mut self, partial: &PartialBlock) -> Result<bool, Refusal> {
        let mut sum = Box::new(VoxelBlock::ZERO);
        let history = self.storage.evicted.add_to(partial.key, &mut sum)?;
        let Some(mut history) = history.filter(|_| !sum.subtract(&partial.block)) else {
            return Err(Refusal::of(Operation::Deintegrate, vec![partial.key]));
        };
        history.deintegrated();
        history.stamp = self.storage.active.clock.tick();
        let gone = sum.is_empty();
        self.storage.evicted.stage_instead(partial.key, sum, history)?;
        Ok(gone)
    }

    /// Nothing can fail any more.
    fn finish(&mut self, partials: Vec<PartialBlock>) {
        let (job, change) = (self.job, &mut self.change);
        let storage = &mut *self.storage;
        storage.evicted.commit();
        change.blocks += change.touched.len();
        let mut emptied = Vec::new();
        for &key in &change.touched {
            let Some((block, history)) = storage.active.get_mut(key) else { continue };
            job.count(history);
            if job.operation == Operation::Deintegrate && block.is_empty() {
                emptied.push(key);
            }
        }
        change.removed += emptied.len();
        for key in emptied {
            storage.active.remove(key);
        }
        change.blocks += change.in_host.len();
        for &key in &change.in_host {
            let stamp = storage.active.clock.tick();
            let gone = storage.evicted.changed(key, |history| {
                job.count(history);
                history.stamp = stamp;
            });
            change.removed += usize::from(gone);
        }
        for partial in partials {
            self.change.touched.push(partial.key);
            let history = self.storage.new_history(self.job.time);
            self.storage.active.insert(partial.key, partial.block, history);
        }
    }
}

impl FrameJob<'_> {
    fn update(&self, operation: Operation, present: &mut [CheckedOut]) {
        in_chunks(present, self.threads, |chunk| {
            for work in chunk {
                work.count = self.frame.apply(operation, work.key, &mut work.block);
            }
        });
    }

    /// Notes the frame in the history of a block.
    pub(crate) fn count(&self, history: &mut BlockHistory) {
        match self.operation {
            Operation::Integrate => history.integrated(self.time),
            Operation::Deintegrate => history.deintegrated(),
        }
    }
}

/// What the frame adds to each of these blocks, for those it touches.
fn partials(frame: &Frame, keys: &mut [BlockKey], threads: usize) -> Vec<PartialBlock> {
    let parts = in_chunks(keys, threads, |keys| {
        let mut blank = Box::new(VoxelBlock::ZERO);
        let mut part = Vec::new();
        for &mut key in keys {
            let count = frame.apply(Operation::Integrate, key, &mut blank);
            if count.voxels > 0 {
                let block = std::mem::replace(&mut blank, Box::new(VoxelBlock::ZERO));
                part.push(PartialBlock { key, block, voxels: count.voxels });
            }
        }
        part
    });
    parts.into_iter().flatten().collect()
}
