//! The messages of a file, record by record.
//!
//! As the iterator of the `mcap` crate, but texts that claim to be longer than their record are refused first: its parser claims memory
//! for all of them, up to 4 GiB.

use std::borrow::Cow;
use std::io::{self, Read};

use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::decompressor::Decompressor;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult, Message, parse_record};

pub(super) struct Messages<R> {
    source: R,
    reader: LinearReader,
    channels: ChannelAccumulator<'static>,
    /// The summary repeats schemas and channels: what comes after the data is read to the end, and not looked at.
    past_data: bool,
    done: bool,
}

impl<R: Read> Messages<R> {
    pub(super) fn new(source: R, options: LinearReaderOptions) -> Self {
        let reader = LinearReader::new_with_options(options.with_emit_chunks(false));
        Self { source, reader, channels: ChannelAccumulator::default(), past_data: false, done: false }
    }

    pub(super) fn add_decompressor(&mut self, decompressor: impl Decompressor + 'static) -> McapResult<()> {
        self.reader.add_decompressor(decompressor)
    }

    fn next_message(&mut self) -> McapResult<Option<Message<'static>>> {
        while let Some(event) = self.reader.next_event() {
            let (opcode, data) = match event? {
                LinearReadEvent::ReadRequest(need) => {
                    let read = loop {
                        match self.source.read(self.reader.insert(need)) {
                            // Nothing read would mean the end of the file.
                            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                            other => break other?,
                        }
                    };
                    self.reader.notify_read(read);
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            self.past_data |= opcode == op::DATA_END;
            if self.past_data || !texts_fit(opcode, data).ok_or(McapError::UnexpectedEof)? {
                continue;
            }
            match parse_record(opcode, data)? {
                Record::Schema { header, data } => {
                    self.channels.add_schema(header, Cow::Owned(data.into_owned()))?;
                }
                Record::Channel(channel) => self.channels.add_channel(channel)?,
                Record::Message { header, data } => {
                    let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
                    return Ok(Some(Message {
                        channel: self.channels.get(header.channel_id).ok_or(unknown)?,
                        sequence: header.sequence,
                        log_time: header.log_time,
                        publish_time: header.publish_time,
                        data: Cow::Owned(data.into_owned()),
                    }));
                }
                _ => {}
            }
        }
        Ok(None)
    }
}

impl<R: Read> Iterator for Messages<R> {
    type Item = McapResult<Message<'static>>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let message = self.next_message().transpose();
        self.done = !matches!(message, Some(Ok(_)));
        message
    }
}

/// Whether a record is one that is used here; `None` where its texts do not fit into it.
fn texts_fit(opcode: u8, data: &[u8]) -> Option<bool> {
    match opcode {
        // Its number, name, encoding and text.
        op::SCHEMA => text(text(text(data.get(2..)?)?)?).map(|_| true),
        // Its number and that of its schema, topic, encoding, and pairs of texts.
        op::CHANNEL => {
            let after = text(text(data.get(4..)?)?)?;
            let (length, pairs) = after.split_first_chunk::<4>()?;
            let mut pairs = pairs.get(..u32::from_le_bytes(*length) as usize)?;
            while !pairs.is_empty() {
                pairs = text(pairs)?;
            }
            Some(true)
        }
        op::MESSAGE => Some(true),
        _ => Some(false),
    }
}

/// What follows a text: its length, four bytes, and as many as that says.
fn text(data: &[u8]) -> Option<&[u8]> {
    let (length, rest) = data.split_first_chunk::<4>()?;
    rest.get(u32::from_le_bytes(*length) as usize..)
}
