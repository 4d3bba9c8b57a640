//! Writes a map's file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::blocks::block_history::BlockHistory;
use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::VoxelBlock;
use crate::codec::encode;
use crate::error::Error;
use crate::file::attachments::{write_mesh, write_metadata};
use crate::file::block_index::write_entry;
use crate::file::checksum::Checksum;
use crate::file::header::{HEADER_BYTES, Header, Section};
use crate::file::settings_section::write_settings;
use crate::frame_clock::FrameClock;
use crate::mesh::triangle_mesh::Mesh;
use crate::settings::Settings;
use crate::storage::block_file::StoredBlock;
use crate::storage::summary::BlockSummary;

/// Is given blocks with their sums, one after the other.
pub(crate) type Visit<'a> = dyn FnMut(BlockKey, &VoxelBlock, BlockHistory) -> Result<(), Error> + 'a;

/// Whoever holds the blocks of a map.
pub(crate) trait Blocks {
    /// Shows all blocks, in the order of their keys, until a visit fails.
    fn visit(&self, visit: &mut Visit) -> Result<(), Error>;
}

/// Writes a map beside its file and moves it to its place.
pub(crate) fn save(
    path: &Path,
    settings: &Settings,
    clock: FrameClock,
    blocks: &dyn Blocks,
    mesh: Option<&Mesh>,
    metadata: &BTreeMap<String, Vec<u8>>,
) -> Result<(), Error> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let beside = path.with_file_name(name);
    let settings = write_settings(settings, clock);
    let written = write(&beside, &settings, blocks, mesh, metadata).and_then(|()| replace(&beside, path));
    if written.is_err() {
        // Best effort: the first error is the one to tell.
        let _ = std::fs::remove_file(&beside);
    }
    written
}

fn write(
    path: &Path,
    settings: &[u8],
    blocks: &dyn Blocks,
    mesh: Option<&Mesh>,
    metadata: &BTreeMap<String, Vec<u8>>,
) -> Result<(), Error> {
    let mut out = Output { file: BufWriter::new(File::create(path).map_err(failed)?), at: HEADER_BYTES as u64 };
    out.file.write_all(&[0; HEADER_BYTES]).map_err(failed)?;
    let settings = out.section(settings)?;
    let (blocks, index) = out.blocks(blocks)?;
    let index = out.section(&index)?;
    let mesh = out.section(&mesh.map(write_mesh).unwrap_or_default())?;
    let metadata = out.section(&write_metadata(metadata))?;
    let header = Header { settings, blocks, index, mesh, metadata };
    let mut file = out.file.into_inner().map_err(|error| failed(error.into_error()))?;
    file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(&header.write())).map_err(failed)?;
    file.sync_all().map_err(failed)
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

    /// Writes the blocks; returns their index, too.
    fn blocks(&mut self, blocks: &dyn Blocks) -> Result<(Section, Vec<u8>), Error> {
        let (start, mut checksum) = (self.at, Checksum::new());
        let (mut index, mut bytes) = (Vec::new(), Vec::new());
        blocks.visit(&mut |key, sum, history| {
            bytes.clear();
            encode(sum, &mut bytes);
            let (last_update, frames, summary) = (history.last_update, history.frames, BlockSummary::of(sum));
            let stored = StoredBlock { key, at: self.at, len: bytes.len() as u16, last_update, frames, summary };
            write_entry(&stored, &mut index);
            checksum.add(&bytes);
            self.file.write_all(&bytes).map_err(failed)?;
            self.at += bytes.len() as u64;
            Ok(())
        })?;
        Ok((Section { at: start, length: self.at - start, checksum: checksum.value() }, index))
    }
}
