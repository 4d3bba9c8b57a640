//! Messages of MCAP recordings: a stream of them, and what images and times in them are, as Foxglove or ROS 2 has them.

pub(crate) mod cdr;
#[cfg(feature = "recordings")]
mod chunks;
pub(crate) mod fields;
pub(crate) mod images;
mod records;
pub(crate) mod ros2;

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use mcap::Message;
use mcap::sans_io::LinearReaderOptions;

#[cfg(feature = "recordings")]
use chunks::{Lz4, Zstd};
use records::Messages;

/// First bytes of an MCAP file.
pub(crate) const FIRST_BYTES: &[u8] = b"\x89MCAP";

/// Why a file gives no messages.
#[derive(Debug)]
pub(crate) enum MessagesFault {
    /// The system refused.
    Unreadable(std::io::Error),
    /// It is no sound recording.
    Malformed(String),
    /// It is one whose end is missing.
    CutOff(String),
}

impl std::fmt::Display for MessagesFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unreadable(error) => error.fmt(f),
            Self::Malformed(why) | Self::CutOff(why) => why.fmt(f),
        }
    }
}

/// Streams a file's messages; memory does not grow with the file.
pub(crate) fn messages_of(
    path: &Path,
) -> Result<impl Iterator<Item = Result<Message<'static>, MessagesFault>> + Send + use<>, MessagesFault> {
    let file = File::open(path).map_err(MessagesFault::Unreadable)?;
    if let Some(way_out) = other_format(path) {
        return Err(MessagesFault::Malformed(way_out));
    }
    // A record that claims to be longer than the file asks for memory that is not there.
    let most = usize::try_from(file.metadata().map_err(MessagesFault::Unreadable)?.len()).unwrap_or(usize::MAX);
    let options = LinearReaderOptions::default().with_record_length_limit(most).with_validate_chunk_crcs(true);
    #[cfg_attr(not(feature = "recordings"), allow(unused_mut, reason = "our own chunks are not compressed"))]
    let mut reader = Messages::new(BufReader::new(file), options);
    #[cfg(feature = "recordings")]
    {
        reader.add_decompressor(Zstd::new()).map_err(|e| broken(&e))?;
        reader.add_decompressor(Lz4::new()).map_err(|e| broken(&e))?;
    }
    Ok(reader.map(|message| message.map_err(|e| broken(&e))))
}

/// What to do with a recording that is no MCAP file; `None` if it may be one.
fn other_format(path: &Path) -> Option<String> {
    let convert = |what: &str, source: &Path| {
        let name = source.file_stem().unwrap_or_default().to_string_lossy();
        let source = source.display();
        Some(format!(
            "{what}, no MCAP file: convert it with `pip install rosbags` and `rosbags-convert --src {source} --dst {name}_mcap \
             --dst-storage mcap`, then give {name}_mcap/{name}_mcap.mcap"
        ))
    };
    if path.is_dir() {
        return Some("a folder, no MCAP file: name the .mcap file in it".into());
    }
    let mut head = [0; 16];
    File::open(path).ok()?.read_exact(&mut head).ok()?;
    if head.starts_with(b"#ROSBAG V") {
        return convert("a bag of ROS 1", path);
    }
    // The folder holds the list of topics.
    let folder = path.parent().filter(|folder| folder.join("metadata.yaml").exists()).unwrap_or(path);
    if head == *b"SQLite format 3\0" { convert("a bag of ROS 2 in SQLite", folder) } else { None }
}

fn broken(error: &mcap::McapError) -> MessagesFault {
    use mcap::McapError::{UnexpectedEoc, UnexpectedEof, UnsupportedCompression};
    let unsound = || format!("no sound MCAP file ({error}): `mcap recover` may help");
    match error {
        UnsupportedCompression(name) => MessagesFault::Malformed(format!(
            "its chunks are compressed with {name}, which is not read here: rewrite it with `mcap compress --compression none`"
        )),
        // The length of a chunk is written when it has ended.
        UnexpectedEof | UnexpectedEoc => MessagesFault::CutOff(unsound()),
        _ => MessagesFault::Malformed(unsound()),
    }
}

/// Name of a message's schema; empty without one.
pub(crate) fn schema_of<'a>(message: &'a Message) -> &'a str {
    message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str())
}
