//! A recording that plays at the speed at which it was made.

use std::path::{Path, PathBuf};
use std::time::Instant;

use mcap::Message;

use super::super::error::VrError;
use super::feed::{Feed, FeedMessage, Heard};
use crate::mcap_messages::{MessagesFault, messages_of, schema_of};

type Messages = Box<dyn Iterator<Item = Result<Message<'static>, MessagesFault>>>;

/// A recording and where it is played.
pub(super) struct Recorded {
    path: PathBuf,
    messages: Option<Messages>,
    next: Option<Message<'static>>,
    /// Log time of its first message, ns.
    first: Option<u64>,
    /// What was played so far, s, and when that was.
    elapsed: f64,
    looked: Option<Instant>,
}

impl Recorded {
    /// Begins to read it.
    pub(super) fn open(path: &Path) -> Result<Self, VrError> {
        let mut messages = messages_of(path).map_err(|fault| VrError::recording(path, why(fault)))?;
        let next = messages.next().transpose().map_err(|fault| VrError::recording(path, why(fault)))?;
        let first = next.as_ref().map(|message| message.log_time);
        if first.is_none() {
            return Err(VrError::recording(path, "there is no message in it"));
        }
        Ok(Self { path: path.into(), messages: Some(Box::new(messages)), next, first, elapsed: 0.0, looked: None })
    }

    /// Reads the message after the one that is taken; how the recording ends where there is none.
    fn advance(&mut self) -> Option<String> {
        match self.messages.as_mut()?.next() {
            Some(Ok(message)) => self.next = Some(message),
            end => {
                self.messages = None;
                return Some(match end {
                    Some(Err(fault)) => format!("the recording breaks off: {}", why(fault)),
                    _ => "the recording is over".into(),
                });
            }
        }
        None
    }
}

impl Feed for Recorded {
    fn take(&mut self, playing: bool) -> Option<Heard> {
        let now = Instant::now();
        let before = self.looked.replace(now);
        if playing && self.messages.is_some() {
            self.elapsed += before.map_or(0.0, |before| (now - before).as_secs_f64());
        }
        if self.next.is_none()
            && let Some(end) = self.advance()
        {
            return Some(Heard::Over(end));
        }
        let message = self.next.as_ref()?;
        let at = message.log_time.saturating_sub(self.first.unwrap_or(0)) as f64 * 1e-9;
        if !playing || at > self.elapsed {
            return None;
        }
        let message = self.next.take()?;
        // Schemas of Foxglove in another encoding are none that are read here.
        let protobuf = message.channel.message_encoding == "protobuf";
        let schema = if protobuf { schema_of(&message).to_owned() } else { String::new() };
        Some(Heard::Message(FeedMessage {
            topic: message.channel.topic.clone(),
            schema,
            data: message.data.into_owned(),
        }))
    }

    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn elapsed(&self) -> Option<f64> {
        Some(self.elapsed)
    }
}

fn why(fault: MessagesFault) -> String {
    match fault {
        MessagesFault::Unreadable(why) => format!("cannot be read ({why})"),
        MessagesFault::Malformed(why) | MessagesFault::CutOff(why) => why,
    }
}

#[cfg(test)]
mod tests {
    use super::super::feed::LOG;
    use super::*;
    use crate::recording::{Recorder, log_message};

    #[test]
    fn all_that_is_due_comes_at_once_and_nothing_in_a_pause() {
        let path = std::env::temp_dir().join(format!("paintcopter-watched-{}.mcap", std::process::id()));
        let mut recorder = Recorder::create(&path).unwrap();
        let channel = recorder.channel::<foxglove::messages::Log>("/log").unwrap();
        // Four at the beginning, one an hour later.
        for time in [5.0, 5.0, 5.0, 5.0, 3605.0] {
            recorder.write(channel, time, &log_message(time, "said")).unwrap();
        }
        recorder.finish().unwrap();
        let mut recorded = Recorded::open(&path).unwrap();
        assert!(recorded.take(false).is_none());
        for _ in 0..4 {
            let Some(Heard::Message(message)) = recorded.take(true) else { panic!("it is due") };
            assert_eq!((message.topic.as_str(), message.schema.as_str()), ("/log", LOG));
        }
        assert!(recorded.take(true).is_none());
        recorded.elapsed = 3600.0;
        assert!(recorded.take(false).is_none());
        assert!(matches!(recorded.take(true), Some(Heard::Message(_))));
        assert!(matches!(recorded.take(true), Some(Heard::Over(_))));
        assert!(recorded.take(true).is_none());
        std::fs::remove_file(&path).unwrap();
    }
}
