//! The header of a map's file: what it is, and where its sections lie.

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::file::checksum::Checksum;

pub(crate) const MAGIC: [u8; 8] = *b"TSDFHASH";
pub(crate) const VERSION: u32 = 3;
/// Written as all numbers are, the lowest byte first.
const BYTE_ORDER: u32 = 0x0102_0304;
/// Bytes of the header.
pub(crate) const HEADER_BYTES: usize = 24 + 24 * SECTIONS + 8;
pub(crate) const SECTIONS: usize = 5;
/// In the order of the sections.
pub(crate) const NAMES: [&str; SECTIONS] =
    ["the settings", "the blocks", "the index of the blocks", "the mesh", "the metadata"];

/// A stretch of the file.
#[derive(Clone, Copy, Default)]
pub(crate) struct Section {
    pub(crate) at: u64,
    pub(crate) length: u64,
    pub(crate) checksum: u64,
}

/// One after the other, from the end of the header to the end of the file: no byte lies outside.
#[derive(Clone, Copy, Default)]
pub(crate) struct Header {
    pub(crate) settings: Section,
    pub(crate) blocks: Section,
    pub(crate) index: Section,
    pub(crate) mesh: Section,
    pub(crate) metadata: Section,
}

impl Header {
    fn sections(&self) -> [Section; SECTIONS] {
        [self.settings, self.blocks, self.index, self.mesh, self.metadata]
    }

    pub(crate) fn write(&self) -> Vec<u8> {
        let sections = self.sections();
        let end = sections.last().map_or(0, |last| last.at + last.length);
        let mut out = Vec::with_capacity(HEADER_BYTES);
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        out.extend_from_slice(&BYTE_ORDER.to_le_bytes());
        out.extend_from_slice(&end.to_le_bytes());
        for section in sections {
            for number in [section.at, section.length, section.checksum] {
                out.extend_from_slice(&number.to_le_bytes());
            }
        }
        out.extend_from_slice(&Checksum::of(&out).to_le_bytes());
        out
    }

    /// Reads the header of a file of `found` bytes.
    pub(crate) fn read(header: &[u8], found: u64) -> Result<Self, Error> {
        if header.get(..8).is_none_or(|magic| magic != MAGIC) {
            return Err(Error::NotAMapFile { what: "it does not begin with TSDFHASH", offset: 0 });
        }
        let truncated = |expected| Error::Truncated { expected, found };
        if header.len() < HEADER_BYTES {
            return Err(truncated(HEADER_BYTES as u64));
        }
        let [version, byte_order] =
            [8, 12].map(|at| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]));
        if byte_order == BYTE_ORDER.swap_bytes() {
            return Err(Error::NotAMapFile { what: "its byte order is not little-endian", offset: 12 });
        }
        if version != VERSION {
            return Err(Error::UnsupportedVersion { found: version, known: VERSION });
        }
        let mut numbers = ByteReader::new(&header[16..HEADER_BYTES], 16, "the header");
        let end = numbers.u64()?;
        let mut sections = [Section::default(); SECTIONS];
        for section in &mut sections {
            *section = Section { at: numbers.u64()?, length: numbers.u64()?, checksum: numbers.u64()? };
        }
        if byte_order != BYTE_ORDER || Checksum::of(&header[..HEADER_BYTES - 8]) != numbers.u64()? {
            return Err(Error::CorruptFile { what: "the header", offset: 0 });
        }
        let mut at = HEADER_BYTES as u64;
        for (section, what) in sections.iter().zip(NAMES) {
            if section.at != at {
                return Err(Error::CorruptFile { what, offset: section.at });
            }
            at = at.checked_add(section.length).ok_or(Error::CorruptFile { what, offset: section.at })?;
        }
        if at != end {
            return Err(Error::CorruptFile { what: "the header", offset: 16 });
        }
        if found < end {
            return Err(truncated(end));
        }
        if found > end {
            return Err(Error::CorruptFile { what: "the end of the file", offset: end });
        }
        let [settings, blocks, index, mesh, metadata] = sections;
        Ok(Self { settings, blocks, index, mesh, metadata })
    }
}
