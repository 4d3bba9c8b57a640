//! The index of the blocks in a map's file.

use crate::blocks::block_key::BlockKey;
use crate::codec::MAX_BYTES;
use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::file::header::Section;
use crate::storage::block_file::StoredBlock;
use crate::storage::summary::BlockSummary;

/// Bytes of an entry of the index.
const ENTRY: usize = 34;

pub(crate) fn write_entry(stored: &StoredBlock, out: &mut Vec<u8>) {
    let BlockSummary { fingerprint, max_counts } = stored.summary;
    out.extend_from_slice(&stored.key.0.to_le_bytes());
    out.extend_from_slice(&fingerprint.to_le_bytes());
    out.extend_from_slice(&stored.last_update.to_le_bytes());
    out.extend_from_slice(&stored.frames.to_le_bytes());
    for number in [max_counts[0], max_counts[1], stored.len] {
        out.extend_from_slice(&number.to_le_bytes());
    }
}

/// Reads the index: ascending keys, of blocks that fill their section one after the other.
pub(crate) fn read_index(bytes: &[u8], section: Section, blocks: Section) -> Result<Vec<StoredBlock>, Error> {
    let mut numbers = ByteReader::new(bytes, section.at, "the index of the blocks");
    let mut entries: Vec<StoredBlock> = Vec::with_capacity(bytes.len() / ENTRY);
    let mut at = blocks.at;
    for _ in 0..bytes.len() / ENTRY {
        let key = BlockKey(numbers.u64()?);
        let (fingerprint, last_update, frames) = (numbers.u64()?, numbers.f64()?, numbers.u32()?);
        let (max_counts, len) = ([numbers.u16()?, numbers.u16()?], numbers.u16()?);
        let ascending = entries.last().is_none_or(|before| before.key < key);
        let known = BlockKey::new(key.block()) == Some(key) && usize::from(len) <= MAX_BYTES;
        if !(ascending && known && last_update.is_finite()) {
            return Err(numbers.bad());
        }
        let summary = BlockSummary { fingerprint, max_counts };
        entries.push(StoredBlock { key, at, len, last_update, frames, summary });
        at += u64::from(len);
    }
    numbers.end()?;
    if at == blocks.at + blocks.length { Ok(entries) } else { Err(numbers.bad()) }
}
