//! A map as one file.
//!
//! ```text
//! header     magic, version, byte order, length of the file, place and checksum of every section, own checksum
//! settings   what the map was made with
//! blocks     compressed, in the order of their keys
//! index      for each block: key, fingerprint, time, frames, largest counts, length
//! mesh       if there is one
//! metadata   the caller's
//! ```
//!
//! All numbers are little-endian on every machine. Sections follow each other without a gap. Header, settings and index are
//! checked when the file is opened; a block is checked against its fingerprint when it is read, mesh and metadata when they
//! are asked for.

mod attachments;
mod block_index;
pub(crate) mod byte_reader;
mod checksum;
pub(crate) mod contents;
mod header;
pub(crate) mod map_file;
mod settings_section;
pub(crate) mod writer;
