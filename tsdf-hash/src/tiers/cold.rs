//! Blocks that have left active memory: in RAM (the host tier), as they left while there is room and packed when it runs
//! short, the oldest first; then in the swap file or in the file a map was opened from. Never two copies of one block.

mod label;
mod loose;
mod relief;

use std::collections::BTreeMap;

pub(crate) use label::Label;
pub(crate) use loose::Loose;

use relief::pack_into;

use super::coder::unpack_add;
use super::swap::Swap;
use crate::block::Block;
use crate::error::Error;
use crate::file::{BlockFile, Entry};
use crate::key::Key;
use crate::store::Seen;

/// A new copy of a block, and where it lies.
enum Place {
    Loose(Box<Block>, Seen),
    Packed(Box<[u8]>, Label),
    Swap(Far),
    /// Nowhere: nothing is left of it.
    Gone,
}

/// A packed block outside the host tier.
#[derive(Clone, Copy)]
struct Far {
    at: u64,
    label: Label,
    len: u16,
    in_file: bool,
}

/// A block that was not taken in, and why.
type Refused = (Box<Block>, Error);

/// The cold tiers. All indices count as bytes of the host tier.
pub(crate) struct Cold {
    pub(crate) loose: Loose,
    host: BTreeMap<Key, (Box<[u8]>, Label)>,
    far: BTreeMap<Key, Far>,
    swap: Option<Swap>,
    file: Option<BlockFile>,
    /// Bytes of packed blocks in RAM, staged ones included.
    packed: usize,
    max_bytes: usize,
    /// The block that went to disk last: the next one in the order of the keys follows it.
    hand: Key,
    /// New copies, to replace the old ones when the frame is certain.
    staged: Vec<(Key, Place)>,
    /// How many of them are loose, packed in RAM, and on disk.
    pending: [usize; 3],
    /// The latest stamp of a block that was ever put here.
    latest: u64,
    buffer: Vec<u8>,
}

impl Cold {
    pub(crate) fn new(max_bytes: usize, swap: Option<Swap>) -> Self {
        Self {
            loose: Loose::new(),
            host: BTreeMap::new(),
            far: BTreeMap::new(),
            swap,
            file: None,
            packed: 0,
            max_bytes,
            hand: Key(0),
            staged: Vec::new(),
            pending: [0; 3],
            latest: 0,
            buffer: Vec::new(),
        }
    }

    /// Nothing but the blocks of a file.
    pub(crate) fn of_file(file: BlockFile, entries: &[Entry]) -> Self {
        let mut cold = Self::new(0, None);
        cold.take_in(file, entries);
        cold
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.loose.len() + self.host.len() + self.far.len() == 0
    }

    /// Whether there is any cold memory at all.
    pub(crate) fn exists(&self) -> bool {
        self.max_bytes > 0
    }

    pub(crate) fn host_bytes(&self) -> usize {
        if self.exists() { self.need([0; 3]) } else { 0 }
    }

    pub(crate) fn disk_bytes(&self) -> u64 {
        self.swap.as_ref().map_or(0, Swap::bytes)
    }

    /// Blocks in RAM, in the swap file and in the map's file.
    pub(crate) fn counts(&self) -> [usize; 3] {
        let swapped = self.swap.as_ref().map_or(0, Swap::used);
        [self.loose.len() + self.host.len(), swapped, self.far.len() - swapped]
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = Key> + '_ {
        self.loose.keys().iter().chain(self.host.keys()).chain(self.far.keys()).copied()
    }

    pub(crate) fn latest(&self) -> u64 {
        self.latest
    }

    pub(crate) fn sightings(&self) -> impl Iterator<Item = (Key, Seen)> + '_ {
        let host = self.host.iter().map(|(&key, (_, label))| (key, label.seen()));
        let far = self.far.iter().map(|(&key, far)| (key, far.label.seen()));
        self.loose.sightings().chain(host).chain(far)
    }

    pub(crate) fn contains(&self, key: Key) -> bool {
        self.loose.get(key).is_some() || self.host.contains_key(&key) || self.far.contains_key(&key)
    }

    fn label(&self, key: Key) -> Option<Label> {
        self.host.get(&key).map(|(_, label)| *label).or_else(|| self.far.get(&key).map(|far| far.label))
    }

    /// See [`Block::print`].
    pub(crate) fn print(&self, key: Key) -> Option<u64> {
        self.loose.get(key).map(Block::print).or_else(|| self.label(key).map(|label| label.print))
    }

    /// See [`Block::peaks`].
    pub(crate) fn peaks(&self, key: Key) -> Option<[u16; 2]> {
        self.loose.get(key).map(Block::peaks).or_else(|| self.label(key).map(|label| label.peaks))
    }

    /// Adds the copy of a block to `block`, if there is one. After an error `block` is as it was.
    pub(crate) fn add_to(&self, key: Key, block: &mut Block) -> Result<Option<Seen>, Error> {
        if let Some((copy, seen)) = self.loose.get(key).zip(self.loose.seen(key)) {
            block.add(copy);
            return Ok(Some(seen));
        }
        let damaged = || Error::Damaged { what: "a block outside memory", block: key.block() };
        if let Some((bytes, label)) = self.host.get(&key) {
            return unpack_add(bytes, block).map(|()| Some(label.seen())).ok_or_else(damaged);
        }
        let Some(far) = self.far.get(&key) else { return Ok(None) };
        let mut bytes = vec![0; usize::from(far.len)];
        match (far.in_file, &self.swap, &self.file) {
            (true, _, Some(file)) => file.read(far.at, &mut bytes)?,
            (false, Some(swap), _) => swap
                .read(far.at as u32, &mut bytes)
                .map_err(|source| Error::Io { what: "reading the swap file", source })?,
            _ => return Err(damaged()),
        }
        let mut copy = Box::new(Block::ZERO);
        unpack_add(&bytes, &mut copy)
            .filter(|()| Label::of(&copy, Seen::default()).same_block(far.label))
            .ok_or_else(damaged)?;
        block.add(&copy);
        Ok(Some(far.label.seen()))
    }

    /// Removes a copy, if there is one.
    pub(crate) fn remove(&mut self, key: Key) {
        if self.loose.remove(key) {
            return;
        }
        if let Some((bytes, _)) = self.host.remove(&key) {
            self.packed -= bytes.len();
        } else if let Some(far) = self.far.remove(&key)
            && !far.in_file
        {
            self.release(&Place::Swap(far));
        }
    }

    /// Adds a block to the copy that is here, or puts it here.
    ///
    /// # Errors
    /// When nothing has room for it, or the disk fails; nothing has changed then, and the block comes back.
    pub(crate) fn put(&mut self, key: Key, block: Box<Block>, seen: Seen) -> Result<(), Refused> {
        let place = self.merged(key, block, seen)?;
        self.install(key, place);
        Ok(())
    }

    /// The same, but only when [`commit`](Self::commit) is called.
    pub(crate) fn stage(&mut self, key: Key, block: Box<Block>, seen: Seen) -> Result<(), Error> {
        let place = self.merged(key, block, seen).map_err(|(_, error)| error)?;
        self.push(key, place);
        Ok(())
    }

    /// Stages a block in the place of the copy that is here.
    pub(crate) fn stage_instead(&mut self, key: Key, block: Box<Block>, seen: Seen) -> Result<(), Error> {
        let place = if block.is_empty() {
            Place::Gone
        } else if self.make_room([1, 0, 0])? {
            Place::Loose(block, seen)
        } else {
            self.packed(&block, seen)?
        };
        self.push(key, place);
        Ok(())
    }

    /// Nothing can fail here: what is staged has its room.
    pub(crate) fn commit(&mut self) {
        self.loose.reserve(self.pending[0]);
        self.pending = [0; 3];
        for (key, place) in std::mem::take(&mut self.staged) {
            self.install(key, place);
        }
    }

    pub(crate) fn abort(&mut self) {
        self.pending = [0; 3];
        for (_, place) in std::mem::take(&mut self.staged) {
            self.release(&place);
        }
    }

    /// Notes that a loose block has changed, and removes it if nothing is left of it: then `true`.
    pub(crate) fn note_change(&mut self, key: Key, seen: Seen) -> bool {
        self.latest = self.latest.max(seen.stamp);
        if self.loose.get(key).is_some_and(Block::is_empty) {
            return self.loose.remove(key);
        }
        self.loose.set_seen(key, seen);
        false
    }

    /// Makes a file's blocks part of the map. They are read when they are needed.
    pub(crate) fn open(&mut self, file: BlockFile, entries: &[Entry]) -> Result<(), Error> {
        if self.need([0, 0, entries.len()]) > self.max_bytes {
            return Err(self.full());
        }
        self.take_in(file, entries);
        Ok(())
    }

    fn take_in(&mut self, file: BlockFile, entries: &[Entry]) {
        self.file = Some(file);
        self.far.extend(entries.iter().map(|entry| {
            let Entry { key, at, len, label } = *entry;
            (key, Far { at, label, len, in_file: true })
        }));
    }

    fn full(&self) -> Error {
        Error::TiersFull { host_bytes: self.host_bytes(), disk_bytes: self.disk_bytes() }
    }

    /// The sum of a block and the copy that is here, loose if there is room.
    fn merged(&mut self, key: Key, mut block: Box<Block>, seen: Seen) -> Result<Place, Refused> {
        match self.make_room([1, 0, 0]) {
            Ok(true) => match self.add_to(key, &mut block) {
                Ok(old) => Ok(Place::Loose(block, old.map_or(seen, |old| old.with(seen)))),
                Err(error) => Err((block, error)),
            },
            Ok(false) => self.merged_and_packed(key, &block, seen).map_err(|error| (block, error)),
            Err(error) => Err((block, error)),
        }
    }

    fn merged_and_packed(&mut self, key: Key, block: &Block, seen: Seen) -> Result<Place, Error> {
        if !self.contains(key) {
            return self.packed(block, seen);
        }
        let mut sum = Box::new(block.clone());
        let old = self.add_to(key, &mut sum)?.unwrap_or_default();
        self.packed(&sum, old.with(seen))
    }

    /// A packed block, where there is no room for a loose one.
    fn packed(&mut self, block: &Block, seen: Seen) -> Result<Place, Error> {
        if !self.exists() {
            return Err(self.full());
        }
        pack_into(&mut self.buffer, block);
        if !self.fits([0, 1, 0], self.buffer.len()) {
            return Err(self.full());
        }
        self.packed += self.buffer.len();
        Ok(Place::Packed(self.buffer.as_slice().into(), Label::of(block, seen)))
    }

    fn push(&mut self, key: Key, place: Place) {
        match place {
            Place::Loose(..) => self.pending[0] += 1,
            Place::Packed(..) => self.pending[1] += 1,
            Place::Swap(_) => self.pending[2] += 1,
            Place::Gone => {}
        }
        self.staged.push((key, place));
    }

    fn install(&mut self, key: Key, place: Place) {
        self.remove(key);
        let stamp = match place {
            Place::Loose(block, seen) => {
                self.loose.insert(key, block, seen);
                seen.stamp
            }
            Place::Packed(bytes, label) => {
                self.host.insert(key, (bytes, label));
                label.stamp
            }
            Place::Swap(far) => {
                self.far.insert(key, far);
                far.label.stamp
            }
            Place::Gone => return,
        };
        self.latest = self.latest.max(stamp);
    }

    fn release(&mut self, place: &Place) {
        match place {
            Place::Packed(bytes, _) => self.packed -= bytes.len(),
            Place::Swap(far) => {
                if let Some(swap) = &mut self.swap {
                    swap.free(far.at as u32, usize::from(far.len));
                }
            }
            Place::Loose(..) | Place::Gone => {}
        }
    }
}
