//! Blocks that have left active memory: packed in RAM (the host tier), then in the swap file or in the file a map was
//! opened from. Never two copies of one block.

use std::collections::BTreeMap;
use std::ops::Bound;

use super::coder::{MOST_BYTES, pack, unpack_add};
use super::swap::Swap;
use crate::block::Block;
use crate::error::Error;
use crate::file::{BlockFile, Entry};
use crate::key::Key;
use crate::store::Seen;

/// What is known of a packed block without unpacking it.
#[derive(Clone, Copy, Default)]
pub(crate) struct Label {
    pub(crate) print: u64,
    /// Time of the last frame that updated it, seconds, and the number of frames that did.
    pub(crate) last: f64,
    pub(crate) frames: u32,
    pub(crate) peaks: [u16; 2],
    /// See [`Seen::stamp`].
    pub(crate) stamp: u64,
}

/// Where a packed block lies.
enum Place {
    Host(Box<[u8]>),
    Swap {
        at: u32,
        len: u16,
    },
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

/// A new copy of a block, to replace the old one when the frame is certain.
type Staged = (Key, Place, Label);

/// Working memory that counts as used: a packed block, and a block to unpack into.
const WORK_BYTES: usize = size_of::<Block>() + 2 * MOST_BYTES;

/// The cold tiers. Both indices count as bytes of the host tier.
pub(crate) struct Cold {
    host: BTreeMap<Key, (Box<[u8]>, Label)>,
    far: BTreeMap<Key, Far>,
    swap: Option<Swap>,
    file: Option<BlockFile>,
    /// Bytes of packed blocks in RAM, staged ones included.
    packed: usize,
    max_bytes: usize,
    /// The block that went to disk last: the next one in the order of the keys follows it.
    hand: Key,
    staged: Vec<Staged>,
    /// How many of them lie in RAM and on disk.
    pending: [usize; 2],
    /// The latest stamp of a block that was ever put here.
    latest: u64,
    buffer: Vec<u8>,
}

impl Cold {
    pub(crate) fn new(max_bytes: usize, swap: Option<Swap>) -> Self {
        Self {
            host: BTreeMap::new(),
            far: BTreeMap::new(),
            swap,
            file: None,
            packed: 0,
            max_bytes,
            hand: Key(0),
            staged: Vec::new(),
            pending: [0; 2],
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
        self.host.len() + self.far.len() == 0
    }

    /// Whether there is any cold memory at all.
    pub(crate) fn exists(&self) -> bool {
        self.max_bytes > 0
    }

    pub(crate) fn host_bytes(&self) -> usize {
        if self.exists() { self.need(0, 0) } else { 0 }
    }

    pub(crate) fn disk_bytes(&self) -> u64 {
        self.swap.as_ref().map_or(0, Swap::bytes)
    }

    /// Blocks packed in RAM, in the swap file and in the map's file.
    pub(crate) fn counts(&self) -> [usize; 3] {
        let swapped = self.swap.as_ref().map_or(0, Swap::used);
        [self.host.len(), swapped, self.far.len() - swapped]
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = Key> + '_ {
        self.host.keys().chain(self.far.keys()).copied()
    }

    pub(crate) fn latest(&self) -> u64 {
        self.latest
    }

    pub(crate) fn labels(&self) -> impl Iterator<Item = (Key, Label)> + '_ {
        let host = self.host.iter().map(|(&key, (_, label))| (key, *label));
        host.chain(self.far.iter().map(|(&key, far)| (key, far.label)))
    }

    pub(crate) fn label(&self, key: Key) -> Option<Label> {
        self.host.get(&key).map(|(_, label)| *label).or_else(|| self.far.get(&key).map(|far| far.label))
    }

    /// Adds the copy of a block to `block`, if there is one. After an error `block` is as it was.
    pub(crate) fn add_to(&self, key: Key, block: &mut Block) -> Result<Option<Label>, Error> {
        let damaged = || Error::Damaged { what: "a block outside memory", block: key.block() };
        if let Some((bytes, label)) = self.host.get(&key) {
            return unpack_add(bytes, block).map(|()| Some(*label)).ok_or_else(damaged);
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
        Ok(Some(far.label))
    }

    /// Removes a copy, if there is one.
    pub(crate) fn remove(&mut self, key: Key) {
        if let Some((bytes, _)) = self.host.remove(&key) {
            self.packed -= bytes.len();
        } else if let Some(far) = self.far.remove(&key)
            && !far.in_file
        {
            self.release(&Place::Swap { at: far.at as u32, len: far.len });
        }
    }

    /// Adds a block to the copy that is here, or puts it here.
    ///
    /// # Errors
    /// When nothing has room for it, or the disk fails; nothing has changed then.
    pub(crate) fn put(&mut self, key: Key, block: &Block, seen: Seen) -> Result<(), Error> {
        let (place, label) = self.merged(key, block, seen)?;
        self.install((key, place, label));
        Ok(())
    }

    /// The same, but only when [`commit`](Self::commit) is called.
    pub(crate) fn stage(&mut self, key: Key, block: &Block, seen: Seen) -> Result<(), Error> {
        let (place, label) = self.merged(key, block, seen)?;
        self.push(key, place, label);
        Ok(())
    }

    /// Stages a block in the place of the copy that is here.
    pub(crate) fn stage_instead(&mut self, key: Key, block: &Block, seen: Seen) -> Result<(), Error> {
        let place = if block.is_empty() { Place::Gone } else { self.place(block)? };
        self.push(key, place, Label::of(block, seen));
        Ok(())
    }

    pub(crate) fn commit(&mut self) {
        self.pending = [0; 2];
        for staged in std::mem::take(&mut self.staged) {
            self.install(staged);
        }
    }

    pub(crate) fn abort(&mut self) {
        self.pending = [0; 2];
        for (_, place, _) in std::mem::take(&mut self.staged) {
            self.release(&place);
        }
    }

    /// Makes a file's blocks part of the map. They are read when they are needed.
    pub(crate) fn open(&mut self, file: BlockFile, entries: &[Entry]) -> Result<(), Error> {
        if self.need(0, entries.len()) > self.max_bytes {
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

    fn merged(&mut self, key: Key, block: &Block, seen: Seen) -> Result<(Place, Label), Error> {
        if self.label(key).is_none() {
            return Ok((self.place(block)?, Label::of(block, seen)));
        }
        let mut sum = Box::new(block.clone());
        let old = self.add_to(key, &mut sum)?.unwrap_or_default();
        Ok((self.place(&sum)?, Label::of(&sum, old.seen().with(seen))))
    }

    /// Packs a block into RAM, or onto the disk if that is full.
    fn place(&mut self, block: &Block) -> Result<Place, Error> {
        if !self.exists() {
            return Err(self.full());
        }
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.clear();
        buffer.reserve_exact(MOST_BYTES);
        pack(block, &mut buffer);
        let place = self.place_bytes(&buffer);
        self.buffer = buffer;
        place
    }

    fn place_bytes(&mut self, bytes: &[u8]) -> Result<Place, Error> {
        // Two nodes of the other index are kept free, so that a block can always move there: what it takes there is no more
        // than what it frees here.
        let ahead = if self.swap.is_some() { 10 } else { 0 };
        while self.need(1, ahead) + bytes.len() > self.max_bytes {
            if self.need(0, 1) > self.max_bytes || !(self.spill()? || self.spill_staged()?) {
                return Err(self.full());
            }
        }
        self.packed += bytes.len();
        Ok(Place::Host(bytes.into()))
    }

    /// Bytes in use when so many are added to the blocks in RAM and to the others.
    fn need(&self, host: usize, far: usize) -> usize {
        let host = self.host.len() + self.pending[0] + host;
        let far = self.far.len() + self.pending[1] + far;
        index_bytes::<(Box<[u8]>, Label)>(host) + index_bytes::<Far>(far) + self.packed + WORK_BYTES
    }

    /// Moves one packed block from RAM to disk; `false` if there is none or no room.
    fn spill(&mut self) -> Result<bool, Error> {
        let after = self.host.range((Bound::Excluded(self.hand), Bound::Unbounded)).next();
        let Some((&key, (bytes, label))) = after.or_else(|| self.host.first_key_value()) else { return Ok(false) };
        let Some(at) = write(&mut self.swap, bytes)? else { return Ok(false) };
        let far = Far { at: u64::from(at), label: *label, len: bytes.len() as u16, in_file: false };
        self.packed -= bytes.len();
        self.host.remove(&key);
        self.far.insert(key, far);
        self.hand = key;
        Ok(true)
    }

    /// The same for a block that is staged.
    fn spill_staged(&mut self) -> Result<bool, Error> {
        let in_ram = self.staged.iter_mut().find_map(|(_, place, _)| match place {
            Place::Host(bytes) => Some((bytes.len(), write(&mut self.swap, bytes), place)),
            _ => None,
        });
        let Some((len, written, place)) = in_ram else { return Ok(false) };
        let Some(at) = written? else { return Ok(false) };
        *place = Place::Swap { at, len: len as u16 };
        self.packed -= len;
        self.pending = [self.pending[0] - 1, self.pending[1] + 1];
        Ok(true)
    }

    fn push(&mut self, key: Key, place: Place, label: Label) {
        match place {
            Place::Host(_) => self.pending[0] += 1,
            Place::Swap { .. } => self.pending[1] += 1,
            Place::Gone => {}
        }
        self.staged.push((key, place, label));
    }

    fn install(&mut self, (key, place, label): Staged) {
        self.remove(key);
        self.latest = self.latest.max(label.stamp);
        let far = match place {
            Place::Host(bytes) => {
                self.host.insert(key, (bytes, label));
                return;
            }
            Place::Swap { at, len } => Far { at: u64::from(at), label, len, in_file: false },
            Place::Gone => return,
        };
        self.far.insert(key, far);
    }

    fn release(&mut self, place: &Place) {
        match place {
            Place::Host(bytes) => self.packed -= bytes.len(),
            Place::Swap { at, len } => {
                if let Some(swap) = &mut self.swap {
                    swap.free(*at, usize::from(*len));
                }
            }
            Place::Gone => {}
        }
    }
}

fn write(swap: &mut Option<Swap>, bytes: &[u8]) -> Result<Option<u32>, Error> {
    let Some(swap) = swap else { return Ok(None) };
    swap.write(bytes).map_err(|source| Error::Io { what: "writing the swap file", source })
}

/// The most bytes that an index of this length takes. The nodes of the standard library's tree hold 11 entries and, but
/// for the root, never fewer than 5; a list or a table would have to stand beside its larger copy when it grows, and there
/// would be no room left to make room.
fn index_bytes<V>(len: usize) -> usize {
    let node = 11 * (size_of::<Key>() + size_of::<V>()) + 12 * size_of::<usize>() + 16;
    if len == 0 { 0 } else { (len / 5 + 2) * node }
}

impl Label {
    pub(crate) fn of(block: &Block, seen: Seen) -> Self {
        Self { print: block.print(), last: seen.last, frames: seen.frames, peaks: block.peaks(), stamp: seen.stamp }
    }

    /// Whether these can be labels of the same block.
    fn same_block(self, other: Self) -> bool {
        self.print == other.print && self.peaks == other.peaks
    }

    /// As a copy that no call has touched.
    pub(crate) fn seen(self) -> Seen {
        Seen { last: self.last, frames: self.frames, call: 0, stamp: self.stamp }
    }
}
