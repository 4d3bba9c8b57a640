//! A map's file, to look into before the map is made.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::Error;
use crate::file::contents::Contents;
use crate::map::Map;
use crate::mesh::triangle_mesh::Mesh;
use crate::settings::Settings;

/// A file that holds a map, opened and found in order; the blocks have not been read yet.
pub struct MapFile(Contents);

impl MapFile {
    /// Opens a file written by [`Map::save`].
    ///
    /// # Errors
    /// [`Error::NotAMapFile`], [`Error::UnsupportedVersion`], [`Error::Truncated`], [`Error::CorruptFile`], [`Error::Io`].
    pub fn open(path: &Path) -> Result<Self, Error> {
        Contents::read(path).map(Self)
    }

    /// What the map was made with.
    pub fn settings(&self) -> &Settings {
        &self.0.settings
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.0.blocks.len()
    }

    /// The mesh that was saved with the map.
    ///
    /// # Errors
    /// [`Error::CorruptFile`], [`Error::Io`].
    pub fn mesh(&self) -> Result<Option<Mesh>, Error> {
        self.0.mesh()
    }

    /// The metadata that were saved with the map.
    ///
    /// # Errors
    /// [`Error::CorruptFile`], [`Error::Io`].
    pub fn metadata(&self) -> Result<BTreeMap<String, Vec<u8>>, Error> {
        self.0.metadata()
    }

    /// The map, to be continued. `settings` may differ from [`settings`](Self::settings) in memory and threads. Where blocks
    /// cannot be evicted all of them are read now; otherwise the file stays open, and a block is read when a frame touches
    /// it. The file is never written to.
    ///
    /// # Errors
    /// [`Error::IncompatibleSettings`], [`Error::OutOfBudget`], [`Error::StorageFull`], those of [`Map::new`] and
    /// [`Map::with_swap`], and when all is read [`Error::CorruptBlock`] and [`Error::Io`].
    pub fn into_map(self, settings: Settings, swap: Option<&Path>) -> Result<Map, Error> {
        Map::from_contents(self.0, settings, swap)
    }
}
