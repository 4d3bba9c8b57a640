//! A map's file, opened and found in order.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::Error;
use crate::file::attachments::{read_mesh, read_metadata};
use crate::file::block_index::read_index;
use crate::file::checksum::Checksum;
use crate::file::header::{HEADER_BYTES, Header, Section};
use crate::file::settings_section::read_settings;
use crate::frame_clock::FrameClock;
use crate::mesh::triangle_mesh::Mesh;
use crate::settings::Settings;
use crate::storage::block_file::{BlockFile, StoredBlock};

/// What the file says; the blocks have not been read yet.
pub(crate) struct Contents {
    file: File,
    header: Header,
    pub(crate) settings: Settings,
    pub(crate) clock: FrameClock,
    pub(crate) blocks: Vec<StoredBlock>,
}

impl Contents {
    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let failed = |source| Error::Io { what: "opening the map's file", source };
        let mut file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        let mut header = Vec::with_capacity(HEADER_BYTES);
        (&mut file).take(HEADER_BYTES as u64).read_to_end(&mut header).map_err(failed)?;
        let header = Header::read(&header, length)?;
        let settings = read_section(&file, header.settings, "the settings")?;
        let (settings, clock) = read_settings(&settings, header.settings.at)?;
        let index = read_section(&file, header.index, "the index of the blocks")?;
        let blocks = read_index(&index, header.index, header.blocks)?;
        Ok(Self { file, header, settings, clock, blocks })
    }

    pub(crate) fn mesh(&self) -> Result<Option<Mesh>, Error> {
        let bytes = read_section(&self.file, self.header.mesh, "the mesh")?;
        if bytes.is_empty() { Ok(None) } else { read_mesh(&bytes, self.header.mesh.at).map(Some) }
    }

    pub(crate) fn metadata(&self) -> Result<BTreeMap<String, Vec<u8>>, Error> {
        let bytes = read_section(&self.file, self.header.metadata, "the metadata")?;
        read_metadata(&bytes, self.header.metadata.at)
    }

    pub(crate) fn into_blocks(self) -> (BlockFile, Vec<StoredBlock>) {
        (BlockFile::new(self.file), self.blocks)
    }
}

/// Reads a section and compares its checksum. Its length has been compared with that of the file.
fn read_section(mut file: &File, section: Section, what: &'static str) -> Result<Vec<u8>, Error> {
    let mut bytes = vec![0; section.length as usize];
    let read = file.seek(SeekFrom::Start(section.at)).and_then(|_| file.read_exact(&mut bytes));
    read.map_err(|source| Error::Io { what: "reading the map's file", source })?;
    let sound = Checksum::of(&bytes) == section.checksum;
    if sound { Ok(bytes) } else { Err(Error::CorruptFile { what, offset: section.at }) }
}
