//! What is derived from the blocks of a layer, block by block, and has to be derived again where the layer changes: shared by
//! the mesh and the distance field.

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;
use crate::blocks::sign_bits::SignBits;
use crate::changes::MapVersion;
use crate::layer::TsdfLayer;

/// Dirty blocks that are read together: with their neighbours some 1000 blocks of 7 KiB at a time.
const BATCH: usize = 512;

/// What an update of a mesh or a distance field did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UpdateReport {
    /// Blocks that have changed since the last call.
    pub changed: usize,
    /// Blocks that are no longer in the map.
    pub removed: usize,
    /// Blocks that were derived again: those that have changed and their lower neighbours.
    pub rebuilt: usize,
}

/// What is kept of a block.
#[derive(Default)]
pub(crate) struct Derived<T> {
    /// Of the block's voxels.
    pub(crate) signs: SignBits,
    pub(crate) data: T,
    /// Whether the block has changed since its signs were read.
    pub(crate) unread: bool,
    /// Whether it waits to be derived again.
    dirty: bool,
}

/// What has happened to the layer since the last time.
pub(crate) struct Followed {
    pub(crate) version: MapVersion,
    pub(crate) is_new_map: bool,
    /// Blocks of the map that was followed before, if this is another one.
    pub(crate) left_behind: Vec<BlockKey>,
    pub(crate) removed: Vec<BlockKey>,
    pub(crate) changed: usize,
}

/// One for each block of the layer.
pub(crate) struct DerivedBlocks<T> {
    pub(crate) blocks: BlockTable<Derived<T>>,
    /// The blocks that a block is derived from: itself and those above it.
    sources: &'static [[i32; 3]],
    version: Option<MapVersion>,
    /// Blocks to be derived again; they stay here when reading a block fails.
    dirty: Vec<BlockKey>,
}

impl<T: Default> DerivedBlocks<T> {
    pub(crate) fn new(sources: &'static [[i32; 3]]) -> Self {
        Self { blocks: BlockTable::new(), sources, version: None, dirty: Vec::new() }
    }

    /// Marks what depends on blocks that have changed or gone. [`commit`](Self::commit) follows when all is derived.
    pub(crate) fn follow<L: TsdfLayer + ?Sized>(&mut self, layer: &L) -> Followed {
        let changes = layer.changes_since(self.version);
        let mut left_behind = Vec::new();
        if changes.is_new_map {
            left_behind.extend_from_slice(self.blocks.keys());
            self.blocks = BlockTable::new();
            self.dirty.clear();
        }
        let mut removed = Vec::new();
        if changes.any_removed {
            removed.extend(self.blocks.keys().iter().copied().filter(|key| !layer.contains_block(key.block())));
            for &key in &removed {
                self.blocks.remove(key);
            }
            for &key in &removed {
                self.mark(key);
            }
        }
        let changed = changes.changed.len();
        self.mark_changed(changes.changed.into_iter().filter_map(BlockKey::new));
        Followed { version: changes.version, is_new_map: changes.is_new_map, left_behind, removed, changed }
    }

    pub(crate) fn commit(&mut self, version: MapVersion) {
        self.version = Some(version);
    }

    /// Marks what depends on the changed blocks.
    pub(crate) fn mark_changed(&mut self, changed: impl Iterator<Item = BlockKey>) {
        for key in changed {
            match self.blocks.get_mut(key) {
                Some(derived) => derived.unread = true,
                None => self.blocks.insert(key, Derived { unread: true, ..Derived::default() }),
            }
            self.mark(key);
        }
    }

    /// Marks what is derived from a block.
    fn mark(&mut self, key: BlockKey) {
        for step in self.sources {
            let Some(key) = key.neighbour(step.map(|c| -c)) else { continue };
            if let Some(derived) = self.blocks.get_mut(key)
                && !derived.dirty
            {
                derived.dirty = true;
                self.dirty.push(key);
            }
        }
    }

    /// Sorts the dirty blocks: they are taken from the end, so that what lies above a block has been read before it.
    pub(crate) fn sort_dirty(&mut self) {
        self.dirty.sort_unstable();
    }

    /// How many dirty blocks are left when the next batch is done; `None` if there are none.
    pub(crate) fn next_batch(&self) -> Option<usize> {
        (!self.dirty.is_empty()).then(|| self.dirty.len().saturating_sub(BATCH))
    }

    /// What the dirty blocks from number `first` on are derived from.
    pub(crate) fn wanted(&self, first: usize) -> impl Iterator<Item = [i32; 3]> + '_ {
        let around = |key: &BlockKey| {
            let key = *key;
            self.sources.iter().filter_map(move |&step| key.neighbour(step)).map(BlockKey::block)
        };
        self.dirty[first..].iter().flat_map(around)
    }

    /// The next dirty block, if more than `left` are.
    pub(crate) fn next_dirty(&self, left: usize) -> Option<BlockKey> {
        self.dirty[left..].last().copied()
    }

    /// The dirty block that is next has been derived.
    pub(crate) fn done(&mut self) {
        let derived = self.dirty.pop().and_then(|key| self.blocks.get_mut(key));
        if let Some(derived) = derived {
            derived.dirty = false;
        }
    }
}
