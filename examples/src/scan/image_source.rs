//! Where an image of a frame is: a file, or a message of a recording.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::mcap_messages::images::{ImageData, image};
use crate::mcap_messages::{MessagesFault, messages_of};

/// Where an image is.
#[derive(Debug, Clone)]
pub enum ImageSource {
    /// A PNG or JPEG file.
    File(PathBuf),
    /// A message of an MCAP file.
    Message {
        /// The topic, open to be read.
        topic: Arc<ImageTopic>,
        /// Which of its messages, counted from 0.
        index: usize,
    },
}

impl std::fmt::Display for ImageSource {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Message { topic, index } => write!(f, "{}, {} {index}", topic.path.display(), topic.topic),
        }
    }
}

type Messages = Box<dyn Iterator<Item = Result<mcap::Message<'static>, MessagesFault>> + Send>;

/// The images of a topic. A recording is read in its order, at two places: one for the present, one for frames that are looked at again. An image
/// before both is looked for from the start.
pub struct ImageTopic {
    path: PathBuf,
    topic: String,
    /// Streams, and the messages of the topic that each has passed.
    cursors: Mutex<Vec<(Messages, usize)>>,
}

impl std::fmt::Debug for ImageTopic {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{} of {}", self.topic, self.path.display())
    }
}

impl ImageTopic {
    pub(super) fn new(path: &Path, topic: &str) -> Self {
        Self { path: path.to_path_buf(), topic: topic.into(), cursors: Mutex::default() }
    }

    /// The pixels of a message.
    pub(super) fn read(&self, index: usize) -> Result<ImageData, String> {
        // A reader that panicked leaves a stream that the next one can go on with, or begin anew.
        let mut cursors = self.cursors.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let nearest = (0..cursors.len()).filter(|k| cursors[*k].1 <= index).max_by_key(|k| cursors[*k].1);
        let (mut messages, mut passed) = match nearest {
            Some(nearest) => cursors.swap_remove(nearest),
            None => (Box::new(messages_of(&self.path).map_err(reason)?) as Messages, 0),
        };
        // The one that is farthest stays.
        if cursors.len() > 1 {
            let nearer = usize::from(cursors[1].1 < cursors[0].1);
            drop(cursors.remove(nearer));
        }
        for message in &mut messages {
            let message = message.map_err(reason)?;
            if message.channel.topic != self.topic {
                continue;
            }
            passed += 1;
            if passed == index + 1 {
                let found = image(&message).map(|(_, data)| data);
                cursors.push((messages, passed));
                return found.ok_or_else(|| "the message is no image".into());
            }
        }
        Err("the recording ends before".into())
    }
}

/// What is wrong, in words.
pub(super) fn reason(fault: MessagesFault) -> String {
    match fault {
        MessagesFault::Unreadable(why) => why.to_string(),
        MessagesFault::Malformed(why) | MessagesFault::CutOff(why) => why,
    }
}
