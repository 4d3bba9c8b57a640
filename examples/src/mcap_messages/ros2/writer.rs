//! Writes a recording with the profile of ROS 2.

use std::collections::BTreeMap;
use std::path::Path;

use mcap::McapResult;
use mcap::records::{MessageHeader, Metadata};

use super::definition::{RosMessage, definition};
use crate::mcap_messages::cdr;
use crate::whole_file::WholeFile;

/// A file that is being written; channels come with their first message.
pub(crate) struct Ros2Writer {
    writer: mcap::Writer<WholeFile>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

impl Ros2Writer {
    pub(crate) fn create(path: &Path) -> McapResult<Self> {
        let options = mcap::WriteOptions::new().compression(None).profile("ros2").library("paintcopter");
        let writer = options.create(WholeFile::create(path)?)?;
        Ok(Self { writer, channels: BTreeMap::new(), sequence: 0 })
    }

    /// A message; `log_time` in nanoseconds.
    pub(crate) fn write<M: RosMessage>(&mut self, topic: &str, log_time: u64, message: &M) -> McapResult<()> {
        let data = cdr::encode(message).map_err(|error| std::io::Error::other(error.to_string()))?;
        self.write_encoded(topic, M::NAME, "ros2msg", &|| definition::<M>().into_bytes(), log_time, &data)
    }

    /// A message that is encoded already.
    pub(crate) fn write_encoded(
        &mut self,
        topic: &str,
        schema: &str,
        encoding: &str,
        definition: &dyn Fn() -> Vec<u8>,
        log_time: u64,
        data: &[u8],
    ) -> McapResult<()> {
        let channel_id = if let Some(known) = self.channels.get(topic) {
            *known
        } else {
            let schema = self.writer.add_schema(schema, encoding, &definition())?;
            // What rosbag2 plays with the default settings of a publisher.
            let quality = BTreeMap::from([("offered_qos_profiles".to_string(), String::new())]);
            let channel = self.writer.add_channel(schema, topic, "cdr", &quality)?;
            self.channels.insert(topic.to_owned(), channel);
            channel
        };
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, data)
    }

    /// Where the recording comes from.
    pub(crate) fn describe(&mut self, metadata: &Metadata) -> McapResult<()> {
        self.writer.write_metadata(metadata)
    }

    /// Writes the index; then the file has its name.
    pub(crate) fn finish(mut self) -> McapResult<()> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().commit()?)
    }
}
