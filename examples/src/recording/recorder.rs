//! An MCAP file as it is written.

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::Encode;

use super::origin::{Attachment, Origin};
use crate::whole_file::WholeFile;

/// What is wrong with writing a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file could not be created.
    #[error("{path}: cannot be written ({source}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Encoding or writing a message failed.
    #[error("the recording could not be written: {0}")]
    Encoding(String),
}

/// Writes messages with Foxglove's schemas, time stamps in seconds.
pub(crate) struct Recorder {
    writer: mcap::Writer<WholeFile>,
    sequence: u32,
}

impl Recorder {
    pub(crate) fn create(path: &Path) -> Result<Self, RecordingError> {
        Self::new(path, WholeFile::create(path))
    }

    /// For what cannot be made again: as much of it as [`Recorder::flush`] has seen stays, whatever happens.
    #[cfg(feature = "vr")]
    pub(crate) fn create_kept(path: &Path) -> Result<Self, RecordingError> {
        Self::new(path, WholeFile::create_kept(path))
    }

    fn new(path: &Path, file: std::io::Result<WholeFile>) -> Result<Self, RecordingError> {
        let file = file.map_err(|source| RecordingError::Unwritable { path: path.display().to_string(), source })?;
        let options = mcap::WriteOptions::new().compression(None).library("paintcopter");
        Ok(Self { writer: options.create(file).map_err(failed)?, sequence: 0 })
    }

    /// Writes the index; then the file has its name.
    pub(crate) fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map_err(failed)?;
        self.writer.into_inner().commit().map_err(failed)
    }

    /// Metadata and attachments.
    pub(crate) fn describe(&mut self, origin: &Origin) -> Result<(), RecordingError> {
        self.writer.write_metadata(&origin.metadata()).map_err(failed)?;
        for Attachment { name, media_type, data } in &origin.attachments {
            // Without times: the same mission gives the same bytes.
            let (name, media_type) = ((*name).into(), (*media_type).into());
            let file = mcap::Attachment { log_time: 0, create_time: 0, name, media_type, data: data.into() };
            self.writer.attach(&file).map_err(failed)?;
        }
        Ok(())
    }

    /// What was written so far can be read, even if nothing more comes.
    #[cfg(feature = "vr")]
    pub(crate) fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(failed)
    }

    pub(crate) fn channel<T: Encode>(&mut self, topic: &str) -> Result<u16, RecordingError> {
        let schema = match T::get_schema() {
            Some(s) => self.writer.add_schema(&s.name, &s.encoding, &s.data).map_err(failed)?,
            None => 0,
        };
        self.writer.add_channel(schema, topic, &T::get_message_encoding(), &BTreeMap::new()).map_err(failed)
    }

    /// A channel of JSON messages of our own, with the schema that describes them.
    #[cfg(feature = "vr")]
    pub(crate) fn json_channel(&mut self, topic: &str, name: &str, schema: &str) -> Result<u16, RecordingError> {
        let schema = self.writer.add_schema(name, "jsonschema", schema.as_bytes()).map_err(failed)?;
        self.writer.add_channel(schema, topic, "json", &BTreeMap::new()).map_err(failed)
    }

    #[cfg(feature = "vr")]
    pub(crate) fn write_json(
        &mut self,
        channel_id: u16,
        time: f64,
        message: &impl serde::Serialize,
    ) -> Result<(), RecordingError> {
        self.write_bytes(channel_id, nanoseconds(time), &serde_json::to_vec(message).map_err(failed)?)
    }

    pub(crate) fn write<T: Encode>(&mut self, channel_id: u16, time: f64, message: &T) -> Result<(), RecordingError> {
        let mut data = Vec::with_capacity(message.encoded_len().unwrap_or(256));
        message.encode(&mut data).map_err(failed)?;
        self.write_bytes(channel_id, nanoseconds(time), &data)
    }

    /// A message that is encoded already, `log_time` in nanoseconds.
    pub(crate) fn write_bytes(&mut self, channel_id: u16, log_time: u64, data: &[u8]) -> Result<(), RecordingError> {
        self.sequence += 1;
        let header =
            mcap::records::MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, data).map_err(failed)
    }
}

fn nanoseconds(time: f64) -> u64 {
    (time.max(0.0) * 1e9).round() as u64
}

fn failed(error: impl std::fmt::Display) -> RecordingError {
    RecordingError::Encoding(error.to_string())
}
