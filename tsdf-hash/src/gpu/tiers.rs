//! The blocks on the device, the map on the processor behind them, and the moves between both (thesis Paper I, section 4.3).
//!
//! A block has one copy, here or there, and a frame updates it where it is: so a frame is never refused for blocks that it would have to
//! bring back first, and what comes back costs one upload after the frame, as many as are allowed.

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::VoxelBlock;
use crate::error::Error;
use crate::file::writer::{Blocks, Visit};
use crate::gpu::device::Device;
use crate::gpu::fuse::UpdateCount;
use crate::gpu::pool::Pool;
use crate::gpu::stream::{Stream, upload};
use crate::integration::integrator::Operation;
use crate::map::Map;
use crate::ray_cast::camera::Camera;
use crate::ray_cast::unpacked::in_view;
use crate::settings::Settings;
use crate::storage::block_storage::hash_blocks;
use crate::storage::frame_update::{FrameJob, Refusal, apply_frame};
use crate::storage::victims;
use crate::storage::view_reload::room_if_any;

/// Cap of the active memory of the map on the processor: what it works with.
const WORK_BYTES: usize = 1 << 20;

/// All blocks.
pub(super) struct Tiers {
    pub(super) device: Device,
    pub(super) pool: Pool,
    /// What the device has no room for, and the clocks of the whole map.
    pub(super) host: Map,
    stream: Stream,
}

/// Blocks that a frame touches and that are not on the device.
pub(super) struct Elsewhere {
    /// New ones, for which there is room on the device.
    pub(super) fresh: Vec<BlockKey>,
    /// Those that the processor has updated.
    pub(super) on_host: Vec<BlockKey>,
    /// How many are new, and how many have gone.
    pub(super) added: usize,
    pub(super) removed: usize,
}

impl Tiers {
    /// Moves the active blocks of a map to the device. After an error the map is as it was, but for evicted blocks.
    pub(super) fn new(map: Map, device: Device) -> Result<Self, Box<(Map, Error)>> {
        let opened = Pool::new(&device, map.settings().max_bytes).and_then(|pool| Ok((pool, Stream::new(&device)?)));
        let (pool, stream) = match opened {
            Ok(opened) => opened,
            Err(error) => return Err(Box::new((map, error))),
        };
        let mut tiers = Self { device, pool, host: map, stream };
        match tiers.take_over() {
            Ok(()) => Ok(tiers),
            Err(error) => Err(Box::new((tiers.host, error))),
        }
    }

    fn take_over(&mut self) -> Result<(), Error> {
        let storage = &mut self.host.storage;
        let excess = storage.active.len().saturating_sub(self.pool.room());
        if excess > 0 && !storage.evicted.is_enabled() {
            return Err(self.pool.out_of_budget());
        }
        storage.begin_call();
        storage.make_room(excess, [0.0; 3])?;
        let keys = storage.active.sorted_keys();
        self.pool.reserve(&self.device, keys.len())?;
        let mut sum = Box::new(VoxelBlock::ZERO);
        for &key in &keys {
            let history = storage.total(key, &mut sum)?;
            upload(&self.device, &mut self.pool, key, &sum, history)?;
        }
        for key in keys {
            storage.forget(key);
        }
        storage.active.resize(WORK_BYTES)
    }

    /// Moves all blocks from the device into the map behind it, whose active memory takes more than its cap where it must.
    pub(super) fn into_map(self) -> Result<Map, Error> {
        let Self { device, pool, mut host, stream } = self;
        host.storage.active.resize(host.settings.max_bytes)?;
        stream.download(&device, &pool, &pool.sorted_keys(), |key, block, history| {
            match host.storage.add_block(key, block, history) {
                Err(Error::OutOfBudget { .. } | Error::StorageFull { .. }) => {
                    host.settings.max_bytes = usize::MAX;
                    host.storage.active.resize(usize::MAX)?;
                    host.storage.add_block(key, block, history)
                }
                outcome => outcome,
            }
        })?;
        Ok(host)
    }

    /// A copy of all blocks in active memory.
    pub(super) fn copy(&self, settings: Settings) -> Result<Map, Error> {
        let mut map = Map::new(settings)?;
        map.clock = self.host.clock;
        self.visit(&mut |key, block, history| map.storage.add_block(key, block, history))?;
        Ok(map)
    }

    /// Calls `each` with those of the blocks that are on the device.
    pub(super) fn download(
        &self,
        keys: &[BlockKey],
        mut each: impl FnMut(BlockKey, &VoxelBlock) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.stream.download(&self.device, &self.pool, keys, |key, block, _| each(key, block))
    }

    /// The hash of the whole map.
    pub(super) fn hash(&self) -> Result<u64, Error> {
        let mut fingerprints: Vec<(BlockKey, u64)> = self.host.storage.fingerprints().collect();
        self.download(&self.pool.sorted_keys(), |key, block| {
            fingerprints.push((key, block.fingerprint()));
            Ok(())
        })?;
        fingerprints.sort_unstable();
        Ok(hash_blocks(fingerprints.into_iter()))
    }

    /// Whether a frame may stay that has changed blocks on the device, and needs others; if so, these have got their part on the processor,
    /// or there is room for them.
    pub(super) fn admit(
        &mut self,
        job: FrameJob,
        changed: &[(BlockKey, UpdateCount)],
        needed: &[(BlockKey, UpdateCount)],
    ) -> Result<Elsewhere, Refusal> {
        let overflow: Vec<_> = changed.iter().filter(|work| work.1.overflow()).map(|work| work.0).collect();
        if !overflow.is_empty() {
            return Err(Refusal::of(job.operation, overflow));
        }
        self.touch(changed.iter().map(|work| work.0));
        let needed = needed.iter().map(|work| work.0);
        let (mut on_host, mut fresh): (Vec<_>, Vec<_>) = needed.partition(|&key| self.host.storage.contains(key));
        if let (Operation::Deintegrate, Some(&key)) = (job.operation, fresh.first()) {
            return Err(Refusal::of(job.operation, vec![key]));
        }
        let added = fresh.len();
        self.make_room(added, job.camera)?;
        if fresh.len() > self.pool.room() && !self.host.storage.evicted.is_enabled() {
            return Err(self.pool.out_of_budget().into());
        }
        on_host.extend(fresh.drain(self.pool.room().min(added)..));
        on_host.sort_unstable();
        self.pool.reserve(&self.device, fresh.len())?;
        let change = apply_frame(&mut self.host.storage, job, &on_host)?;
        Ok(Elsewhere { fresh, on_host, added, removed: change.removed })
    }

    /// Notes the frame in what it has changed on the device, and removes what nothing is left of: how many.
    pub(super) fn count(&mut self, job: FrameJob, changed: &[(BlockKey, UpdateCount)]) -> usize {
        let clock = &mut self.host.storage.active.clock;
        for (key, _) in changed {
            if let Some(history) = self.pool.history_mut(*key) {
                job.count(history);
                history.stamp = clock.tick();
            }
        }
        let gone = changed.iter().filter(|work| !work.1.observed());
        let removed = gone.map(|work| self.pool.remove(work.0)).count();
        clock.count_removed(removed);
        removed
    }

    /// Moves after a frame, as those of a map on the processor: what it touched there is reloaded, what has not been updated for long is
    /// evicted. How many were reloaded and evicted by age. A move that finds no room is left for later.
    pub(super) fn transfer(&mut self, on_host: &[BlockKey], job: FrameJob) -> [usize; 2] {
        let limits = self.host.settings().memory;
        let seen = &on_host[..on_host.len().min(limits.max_transfers)];
        let reloaded = self.reload(seen, job.camera).unwrap_or_default();
        let aged = victims::aged(self.pool.histories(), job.time, &limits);
        [reloaded, if self.host.storage.evicted.is_enabled() { self.evict(&aged).0 } else { 0 }]
    }

    /// Brings blocks in view to the device, the nearest first, as far as there is room once those out of view have left: how many.
    pub(super) fn reload_view(&mut self, camera: &Camera, from: [f64; 3]) -> Result<usize, Error> {
        let wanted = in_view(self.host.storage.sorted_keys().into_iter(), camera);
        if wanted.is_empty() {
            return Ok(0);
        }
        self.host.storage.begin_call();
        self.touch(in_view(self.pool.keys(), camera));
        self.reload(&wanted, from)
    }

    /// Notes that the current call needs blocks on the device.
    fn touch(&mut self, keys: impl IntoIterator<Item = BlockKey>) {
        let call = self.host.storage.call;
        for key in keys {
            if let Some(history) = self.pool.history_mut(key) {
                history.call = call;
            }
        }
    }

    /// Brings blocks to the device as far as there is room once others have left: how many.
    fn reload(&mut self, keys: &[BlockKey], camera: [f64; 3]) -> Result<usize, Error> {
        room_if_any(self.make_room(keys.len(), camera))?;
        let count = keys.len().min(self.pool.room());
        self.pool.reserve(&self.device, count)?;
        let mut sum = Box::new(VoxelBlock::ZERO);
        for &key in &keys[..count] {
            let history = self.host.storage.total(key, &mut sum)?;
            upload(&self.device, &mut self.pool, key, &sum, history)?;
            self.host.storage.forget(key);
        }
        Ok(count)
    }

    /// Evicts blocks that the current call has not touched until there is room for `count`, if there are enough of them.
    fn make_room(&mut self, count: usize, camera: [f64; 3]) -> Result<(), Error> {
        let lacking = count.saturating_sub(self.pool.room());
        if lacking == 0 || !self.host.storage.evicted.is_enabled() {
            return Ok(());
        }
        let untouched = victims::untouched(self.pool.histories(), self.host.storage.call, lacking, camera);
        self.evict(&untouched).1
    }

    /// Evicts blocks: how many, and why no more.
    fn evict(&mut self, keys: &[BlockKey]) -> (usize, Result<(), Error>) {
        let mut moved = 0;
        let evicted = &mut self.host.storage.evicted;
        let outcome = self.stream.download(&self.device, &self.pool, keys, |key, block, history| {
            evicted.put(key, Box::new(block.clone()), history).map_err(|(_, error)| error)?;
            moved += 1;
            Ok(())
        });
        for &key in &keys[..moved] {
            self.pool.remove(key);
        }
        (moved, outcome)
    }
}

impl Blocks for Tiers {
    /// Those of the device pass through the staging buffer; those on the processor go between.
    fn visit(&self, visit: &mut Visit) -> Result<(), Error> {
        let (storage, mut sum) = (&self.host.storage, Box::new(VoxelBlock::ZERO));
        let mut on_host = storage.sorted_keys().into_iter().peekable();
        let mut up_to = |end: Option<BlockKey>, visit: &mut Visit| {
            while let Some(key) = on_host.next_if(|key| end.is_none_or(|end| *key < end)) {
                let history = storage.total(key, &mut sum)?;
                visit(key, &sum, history)?;
            }
            Ok(())
        };
        self.stream.download(&self.device, &self.pool, &self.pool.sorted_keys(), |key, block, history| {
            up_to(Some(key), visit)?;
            visit(key, block, history)
        })?;
        up_to(None, visit)
    }
}
