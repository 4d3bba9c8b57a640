//! A map as one file.
//!
//! ```text
//! head       magic, version, byte order, length of the file, place and checksum of every section, own checksum
//! settings   what the map was made with
//! blocks     packed, in the order of their keys
//! index      for each block: key, fingerprint, time, frames, peaks, length
//! mesh       if there is one
//! metadata   the caller's
//! ```
//!
//! All numbers are little-endian on every machine. Sections follow each other without a gap. Head, settings and index are
//! checked when the file is opened; a block is checked against its fingerprint when it is read, mesh and metadata when they
//! are asked for.

mod blocks;
mod checksum;
mod extras;
mod layout;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

pub(crate) use blocks::{BlockFile, Entry};
use checksum::Checksum;
use layout::{HEAD, Layout, Section};

use crate::block::Block;
use crate::error::Error;
use crate::map::Clock;
use crate::tiers::{Copies, Label, pack};
use crate::{Map, Mesh, Settings};

/// A file that holds a map, opened and found in order; the blocks have not been read yet.
pub struct MapFile {
    file: File,
    layout: Layout,
    settings: Settings,
    clock: Clock,
    entries: Vec<Entry>,
}

impl MapFile {
    /// Opens a file written by [`Map::save`].
    ///
    /// # Errors
    /// [`Error::NotAMap`], [`Error::OtherVersion`], [`Error::Truncated`], [`Error::BadFile`], [`Error::Io`].
    pub fn open(path: &Path) -> Result<Self, Error> {
        let failed = |source| Error::Io { what: "opening the map's file", source };
        let mut file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        let mut head = Vec::with_capacity(HEAD);
        (&mut file).take(HEAD as u64).read_to_end(&mut head).map_err(failed)?;
        let layout = Layout::read(&head, length)?;
        let settings = read_section(&file, layout.settings, "the settings")?;
        let (settings, last, stamped) = layout::read_settings(&settings, layout.settings.at)?;
        let index = read_section(&file, layout.index, "the index of the blocks")?;
        let entries = blocks::read_index(&index, layout.index, layout.blocks)?;
        Ok(Self { file, layout, settings, clock: Clock { last, stamped }, entries })
    }

    /// What the map was made with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.entries.len()
    }

    /// The mesh that was saved with the map.
    ///
    /// # Errors
    /// [`Error::BadFile`], [`Error::Io`].
    pub fn mesh(&self) -> Result<Option<Mesh>, Error> {
        let bytes = read_section(&self.file, self.layout.mesh, "the mesh")?;
        if bytes.is_empty() { Ok(None) } else { extras::read_mesh(&bytes, self.layout.mesh.at).map(Some) }
    }

    /// The metadata that were saved with the map.
    ///
    /// # Errors
    /// [`Error::BadFile`], [`Error::Io`].
    pub fn metadata(&self) -> Result<BTreeMap<String, Vec<u8>>, Error> {
        let bytes = read_section(&self.file, self.layout.metadata, "the metadata")?;
        extras::read_metadata(&bytes, self.layout.metadata.at)
    }

    /// The map, to be continued. `settings` may differ from [`settings`](Self::settings) in memory and threads. Without a
    /// host tier all blocks are read now; with one, the file stays open as a read-only tier, and a block is read when a
    /// frame touches it. The file is never written to.
    ///
    /// # Errors
    /// [`Error::OtherSettings`], [`Error::OutOfBudget`], [`Error::TiersFull`], those of [`Map::new`] and
    /// [`Map::with_swap`], and when all is read [`Error::Damaged`] and [`Error::Io`].
    pub fn into_map(self, settings: Settings, swap: Option<&Path>) -> Result<Map, Error> {
        let Settings { max_bytes, threads, tiers, .. } = settings;
        if settings != (Settings { max_bytes, threads, tiers, ..self.settings }) {
            return Err(Error::OtherSettings);
        }
        let mut map = match swap {
            Some(swap) => Map::with_swap(settings, swap)?,
            None => Map::new(settings)?,
        };
        map.clock = self.clock;
        map.copies.open(BlockFile::new(self.file), &self.entries)?;
        Ok(map)
    }
}

impl Map {
    /// Opens a file written by [`save`](Self::save) with the settings it was saved with; [`MapFile`] does it with others.
    ///
    /// # Errors
    /// As [`MapFile::open`] and [`MapFile::into_map`].
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = MapFile::open(path)?;
        let settings = file.settings;
        file.into_map(settings, None)
    }

    /// Writes the whole map, all tiers, to a file; with a mesh, if there is one, and with any metadata.
    ///
    /// It is written beside and moved to its place when it is complete and on disk: after a crash there is the old file or
    /// the new one.
    ///
    /// # Errors
    /// [`Error::Io`], and [`Error::Damaged`] when a block cannot be read.
    pub fn save(&self, path: &Path, mesh: Option<&Mesh>, metadata: &BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}.part", std::process::id()));
        let beside = path.with_file_name(name);
        let written = self.write(&beside, mesh, metadata).and_then(|()| replace(&beside, path));
        if written.is_err() {
            // Best effort: the first error is the one to tell.
            let _ = std::fs::remove_file(&beside);
        }
        written
    }

    fn write(&self, path: &Path, mesh: Option<&Mesh>, metadata: &BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        let mut out = Output { file: BufWriter::new(File::create(path).map_err(failed)?), at: HEAD as u64 };
        out.file.write_all(&[0; HEAD]).map_err(failed)?;
        let settings = out.section(&layout::write_settings(&self.settings, self.clock.last, self.clock.stamped))?;
        let (blocks, index) = out.blocks(&self.copies)?;
        let index = out.section(&index)?;
        let mesh = out.section(&mesh.map(extras::write_mesh).unwrap_or_default())?;
        let metadata = out.section(&extras::write_metadata(metadata))?;
        let layout = Layout { settings, blocks, index, mesh, metadata };
        let mut file = out.file.into_inner().map_err(|error| failed(error.into_error()))?;
        file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(&layout.write())).map_err(failed)?;
        file.sync_all().map_err(failed)
    }
}

fn failed(source: std::io::Error) -> Error {
    Error::Io { what: "writing the map's file", source }
}

/// Moves a complete file to its place, and makes the move last where folders can be synchronised.
fn replace(from: &Path, to: &Path) -> Result<(), Error> {
    std::fs::rename(from, to).map_err(failed)?;
    let folder = to.parent().filter(|folder| !folder.as_os_str().is_empty()).map_or(PathBuf::from("."), PathBuf::from);
    if cfg!(unix) { File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed) } else { Ok(()) }
}

/// Reads a section and compares its checksum. Its length has been compared with that of the file.
fn read_section(mut file: &File, section: Section, what: &'static str) -> Result<Vec<u8>, Error> {
    let mut bytes = vec![0; section.length as usize];
    let read = file.seek(SeekFrom::Start(section.at)).and_then(|_| file.read_exact(&mut bytes));
    read.map_err(|source| Error::Io { what: "reading the map's file", source })?;
    let sound = Checksum::of(&bytes) == section.checksum;
    if sound { Ok(bytes) } else { Err(Error::BadFile { what, offset: section.at }) }
}

struct Output {
    file: BufWriter<File>,
    at: u64,
}

impl Output {
    fn section(&mut self, bytes: &[u8]) -> Result<Section, Error> {
        self.file.write_all(bytes).map_err(failed)?;
        let section = Section { at: self.at, length: bytes.len() as u64, checksum: Checksum::of(bytes) };
        self.at += section.length;
        Ok(section)
    }

    /// Writes the sums of all copies; returns their index, too.
    fn blocks(&mut self, copies: &Copies) -> Result<(Section, Vec<u8>), Error> {
        let (start, mut checksum) = (self.at, Checksum::default());
        let (mut index, mut bytes, mut sum) = (Vec::new(), Vec::new(), Box::new(Block::ZERO));
        for key in copies.sorted_keys() {
            let seen = copies.total(key, &mut sum)?;
            bytes.clear();
            pack(&sum, &mut bytes);
            Entry { key, at: self.at, len: bytes.len() as u16, label: Label::of(&sum, seen) }.write(&mut index);
            checksum.add(&bytes);
            self.file.write_all(&bytes).map_err(failed)?;
            self.at += bytes.len() as u64;
        }
        Ok((Section { at: start, length: self.at - start, checksum: checksum.value() }, index))
    }
}
