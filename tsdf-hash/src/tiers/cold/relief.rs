//! How room is made in the host tier: old blocks are packed, and packed ones go to disk.

use std::ops::Bound;

use super::loose::BATCH_BYTES;
use super::{Cold, Far, Label, Place};
use crate::block::Block;
use crate::error::Error;
use crate::key::Key;
use crate::tiers::coder::{MOST_BYTES, pack};
use crate::tiers::swap::Swap;

/// Working memory that counts as used: a block to unpack into, a packed block read and one written, and a list.
const WORK_BYTES: usize = size_of::<Block>() + 2 * MOST_BYTES + BATCH_BYTES;
/// Where there is a disk, packed blocks go there before loose blocks take less than this part of the tier (ours).
const LOOSE_SHARE: usize = 4;

impl Cold {
    /// Bytes in use when so many loose, packed and far blocks are added; without the bytes of those that are packed.
    pub(super) fn need(&self, [loose, host, far]: [usize; 3]) -> usize {
        let host = self.host.len() + self.pending[1] + host;
        let far = self.far.len() + self.pending[2] + far;
        let indices = index_bytes::<(Box<[u8]>, Label)>(host) + index_bytes::<Far>(far);
        self.loose.bytes_with(self.pending[0] + loose) + indices + self.packed + WORK_BYTES
    }

    /// Makes room for so many more; `false` if that cannot be, and all that could be has then been packed and spilt.
    pub(super) fn make_room(&mut self, added: [usize; 3]) -> Result<bool, Error> {
        while !self.fits(added, 0) {
            if !self.relieve()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether there is room for so many more, of which those that are packed take `bytes`.
    pub(super) fn fits(&self, added: [usize; 3], bytes: usize) -> bool {
        self.fits_for(added, bytes, 0)
    }

    /// The same in exchange for bytes that will be free then.
    fn fits_for(&self, [loose, host, far]: [usize; 3], bytes: usize, freed: usize) -> bool {
        // Two nodes of the far index are kept free, so that a block can always move there: what it takes there is no more
        // than what it frees here.
        let ahead = if self.swap.is_some() { 10 } else { 0 };
        self.exists() && self.need([loose, host, far + ahead]) + bytes <= self.max_bytes + freed
    }

    /// Frees some RAM; `false` if there is no way.
    fn relieve(&mut self) -> Result<bool, Error> {
        let few = self.swap.is_some() && self.loose.bytes_with(self.pending[0]) <= self.max_bytes / LOOSE_SHARE;
        Ok((few && self.spill()?) || self.pack_oldest() || self.pack_staged() || (!few && self.spill()?))
    }

    /// Packs the oldest loose block; `false` if there is none, or if that would free nothing.
    fn pack_oldest(&mut self) -> bool {
        let Some(key) = self.loose.oldest() else { return false };
        let Some((block, seen)) = self.loose.get(key).zip(self.loose.seen(key)) else { return false };
        let mut buffer = std::mem::take(&mut self.buffer);
        pack_into(&mut buffer, block);
        let label = Label::of(block, seen);
        let frees = self.fits_for([0, 1, 0], buffer.len(), size_of::<Block>());
        if frees {
            let bytes: Box<[u8]> = buffer.as_slice().into();
            self.loose.remove(key);
            self.packed += bytes.len();
            self.host.insert(key, (bytes, label));
        }
        self.buffer = buffer;
        frees
    }

    /// The same for a block that is staged.
    fn pack_staged(&mut self) -> bool {
        let loose = |(_, place): &(Key, Place)| matches!(place, Place::Loose(..));
        // The last one: those before it have been packed already.
        let Some(at) = self.staged.iter().rposition(loose) else { return false };
        let Place::Loose(block, seen) = &self.staged[at].1 else { return false };
        let mut buffer = std::mem::take(&mut self.buffer);
        pack_into(&mut buffer, block);
        let label = Label::of(block, *seen);
        let frees = self.fits_for([0, 1, 0], buffer.len(), size_of::<Block>());
        if frees {
            self.packed += buffer.len();
            self.staged[at].1 = Place::Packed(buffer.as_slice().into(), label);
            self.pending = [self.pending[0] - 1, self.pending[1] + 1, self.pending[2]];
        }
        self.buffer = buffer;
        frees
    }

    /// Moves a packed block from RAM to disk; `false` if there is none or no room.
    fn spill(&mut self) -> Result<bool, Error> {
        Ok(self.need([0, 0, 1]) <= self.max_bytes && (self.spill_next()? || self.spill_staged()?))
    }

    fn spill_next(&mut self) -> Result<bool, Error> {
        let after = self.host.range((Bound::Excluded(self.hand), Bound::Unbounded)).next();
        let Some((&key, (bytes, label))) = after.or_else(|| self.host.first_key_value()) else { return Ok(false) };
        let Some(far) = write(&mut self.swap, bytes, *label)? else { return Ok(false) };
        self.packed -= bytes.len();
        self.host.remove(&key);
        self.far.insert(key, far);
        self.hand = key;
        Ok(true)
    }

    /// The same for a block that is staged.
    fn spill_staged(&mut self) -> Result<bool, Error> {
        let in_ram = self.staged.iter_mut().rev().find_map(|(_, place)| match place {
            Place::Packed(bytes, label) => Some((bytes.len(), write(&mut self.swap, bytes, *label), place)),
            _ => None,
        });
        let Some((len, written, place)) = in_ram else { return Ok(false) };
        let Some(far) = written? else { return Ok(false) };
        *place = Place::Swap(far);
        self.packed -= len;
        self.pending = [self.pending[0], self.pending[1] - 1, self.pending[2] + 1];
        Ok(true)
    }
}

/// Packs a block into a buffer that is there for it.
pub(super) fn pack_into(buffer: &mut Vec<u8>, block: &Block) {
    buffer.clear();
    buffer.reserve_exact(MOST_BYTES);
    pack(block, buffer);
}

fn write(swap: &mut Option<Swap>, bytes: &[u8], label: Label) -> Result<Option<Far>, Error> {
    let Some(swap) = swap else { return Ok(None) };
    let at = swap.write(bytes).map_err(|source| Error::Io { what: "writing the swap file", source })?;
    Ok(at.map(|at| Far { at: u64::from(at), label, len: bytes.len() as u16, in_file: false }))
}

/// The most bytes that an index of this length takes. The nodes of the standard library's tree hold 11 entries and, but
/// for the root, never fewer than 5; a list or a table would have to stand beside its larger copy when it grows, and there
/// would be no room left to make room.
fn index_bytes<V>(len: usize) -> usize {
    let node = 11 * (size_of::<Key>() + size_of::<V>()) + 12 * size_of::<usize>() + 16;
    if len == 0 { 0 } else { (len / 5 + 2) * node }
}
