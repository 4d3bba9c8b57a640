//! The head of a map's file: what it is, and where its sections lie.

use super::checksum::Checksum;
use crate::error::Error;
use crate::settings::{NoiseModel, Settings, Tiers};

pub(crate) const MAGIC: [u8; 8] = *b"TSDFHASH";
pub(crate) const VERSION: u32 = 2;
/// Written as all numbers are, the lowest byte first.
const MARK: u32 = 0x0102_0304;
/// Bytes of the head.
pub(crate) const HEAD: usize = 24 + 24 * SECTIONS + 8;
pub(crate) const SECTIONS: usize = 5;
/// In the order of the sections.
const NAMES: [&str; SECTIONS] = ["the settings", "the blocks", "the index of the blocks", "the mesh", "the metadata"];

/// A stretch of the file.
#[derive(Clone, Copy, Default)]
pub(crate) struct Section {
    pub(crate) at: u64,
    pub(crate) length: u64,
    pub(crate) checksum: u64,
}

/// One after the other, from the end of the head to the end of the file: no byte lies outside.
#[derive(Clone, Copy, Default)]
pub(crate) struct Layout {
    pub(crate) settings: Section,
    pub(crate) blocks: Section,
    pub(crate) index: Section,
    pub(crate) mesh: Section,
    pub(crate) metadata: Section,
}

impl Layout {
    fn sections(&self) -> [Section; SECTIONS] {
        [self.settings, self.blocks, self.index, self.mesh, self.metadata]
    }

    pub(crate) fn write(&self) -> Vec<u8> {
        let sections = self.sections();
        let end = sections.last().map_or(0, |last| last.at + last.length);
        let mut out = Vec::with_capacity(HEAD);
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        out.extend_from_slice(&MARK.to_le_bytes());
        out.extend_from_slice(&end.to_le_bytes());
        for section in sections {
            for number in [section.at, section.length, section.checksum] {
                out.extend_from_slice(&number.to_le_bytes());
            }
        }
        out.extend_from_slice(&Checksum::of(&out).to_le_bytes());
        out
    }

    /// Reads the head of a file of `found` bytes.
    pub(crate) fn read(head: &[u8], found: u64) -> Result<Self, Error> {
        if head.get(..8).is_none_or(|magic| magic != MAGIC) {
            return Err(Error::NotAMap { what: "it does not begin with TSDFHASH", offset: 0 });
        }
        let truncated = |expected| Error::Truncated { expected, found };
        if head.len() < HEAD {
            return Err(truncated(HEAD as u64));
        }
        let [version, mark] =
            [8, 12].map(|at| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]));
        if mark == MARK.swap_bytes() {
            return Err(Error::NotAMap { what: "its byte order is not little-endian", offset: 12 });
        }
        if version != VERSION {
            return Err(Error::OtherVersion { found: version, known: VERSION });
        }
        let mut numbers = Numbers::new(&head[16..HEAD], 16, "the head");
        let end = numbers.u64()?;
        let mut sections = [Section::default(); SECTIONS];
        for section in &mut sections {
            *section = Section { at: numbers.u64()?, length: numbers.u64()?, checksum: numbers.u64()? };
        }
        if mark != MARK || Checksum::of(&head[..HEAD - 8]) != numbers.u64()? {
            return Err(Error::BadFile { what: "the head", offset: 0 });
        }
        let mut at = HEAD as u64;
        for (section, what) in sections.iter().zip(NAMES) {
            if section.at != at {
                return Err(Error::BadFile { what, offset: section.at });
            }
            at = at.checked_add(section.length).ok_or(Error::BadFile { what, offset: section.at })?;
        }
        if at != end {
            return Err(Error::BadFile { what: "the head", offset: 16 });
        }
        if found < end {
            return Err(truncated(end));
        }
        if found > end {
            return Err(Error::BadFile { what: "the end of the file", offset: end });
        }
        let [settings, blocks, index, mesh, metadata] = sections;
        Ok(Self { settings, blocks, index, mesh, metadata })
    }
}

/// Numbers from bytes; an error names what was read and where.
pub(crate) struct Numbers<'a> {
    bytes: &'a [u8],
    offset: u64,
    what: &'static str,
}

impl<'a> Numbers<'a> {
    pub(crate) fn new(bytes: &'a [u8], offset: u64, what: &'static str) -> Self {
        Self { bytes, offset, what }
    }

    pub(crate) fn bad(&self) -> Error {
        Error::BadFile { what: self.what, offset: self.offset }
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let taken = self.bytes.split_off(..count).ok_or_else(|| self.bad())?;
        self.offset += count as u64;
        Ok(taken)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        self.take(N)?.try_into().map_err(|_| self.bad())
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Error> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Error> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(crate) fn u16(&mut self) -> Result<u16, Error> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(crate) fn f64(&mut self) -> Result<f64, Error> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// Nothing may be left over.
    pub(crate) fn end(&self) -> Result<(), Error> {
        if self.bytes.is_empty() { Ok(()) } else { Err(self.bad()) }
    }
}

/// The settings, and the time of the last frame.
pub(crate) fn write_settings(settings: &Settings, last: Option<f64>, stamped: bool) -> Vec<u8> {
    let Settings { voxel_size, truncation_voxels, carve, min_depth, max_depth, max_bytes, threads, tiers, noise } =
        *settings;
    let mut out = Vec::new();
    for number in
        [voxel_size, truncation_voxels, carve, min_depth, max_depth, noise.base, noise.quadratic, noise.nearest]
    {
        out.extend_from_slice(&number.to_le_bytes());
    }
    for count in [max_bytes as u64, threads as u64, tiers.host_bytes as u64, tiers.disk_bytes, tiers.transfers as u64] {
        out.extend_from_slice(&count.to_le_bytes());
    }
    for number in [tiers.age, tiers.hold, last.unwrap_or(f64::NAN), if stamped { 1.0 } else { 0.0 }] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out
}

pub(crate) fn read_settings(bytes: &[u8], offset: u64) -> Result<(Settings, Option<f64>, bool), Error> {
    let mut numbers = Numbers::new(bytes, offset, NAMES[0]);
    let n = &mut numbers;
    let [voxel_size, truncation_voxels, carve] = [n.f64()?, n.f64()?, n.f64()?];
    let [min_depth, max_depth] = [n.f64()?, n.f64()?];
    let noise = NoiseModel { base: n.f64()?, quadratic: n.f64()?, nearest: n.f64()? };
    // A cap beyond this machine's words is no cap.
    let mut count = || n.u64().map(|count| usize::try_from(count).unwrap_or(usize::MAX));
    let (max_bytes, threads, host_bytes) = (count()?, count()?, count()?);
    let (disk_bytes, transfers) = (n.u64()?, usize::try_from(n.u64()?).unwrap_or(usize::MAX));
    let tiers = Tiers { host_bytes, disk_bytes, transfers, age: n.f64()?, hold: n.f64()? };
    let (last, stamped) = (n.f64()?, n.f64()? == 1.0);
    numbers.end()?;
    let settings =
        Settings { voxel_size, truncation_voxels, carve, min_depth, max_depth, max_bytes, threads, tiers, noise };
    settings.check()?;
    Ok((settings, (!last.is_nan()).then_some(last), stamped))
}
