//! The page that holds the lease, from the side of whoever serves it.

use std::sync::mpsc::{SyncSender, TrySendError};

use super::connection::Outgoing;
use super::protocol::ServerMessage;

/// The page, if one is there.
#[derive(Default)]
pub(super) struct Client {
    own: Option<(u64, SyncSender<Outgoing>)>,
    /// Messages that it did not take because it was slow.
    pub(super) unsent: u64,
    /// Pages that have come.
    pub(super) connections: u64,
}

impl Client {
    pub(super) fn join(&mut self, connection: u64, outbox: SyncSender<Outgoing>) {
        self.own = Some((connection, outbox));
        self.connections += 1;
    }

    pub(super) fn leave(&mut self) {
        self.own = None;
    }

    pub(super) fn is_there(&self) -> bool {
        self.own.is_some()
    }

    /// Whether a connection is the one that holds the lease.
    pub(super) fn is(&self, connection: u64) -> bool {
        self.own.as_ref().is_some_and(|(own, _)| *own == connection)
    }

    pub(super) fn say(&mut self, message: &ServerMessage) -> bool {
        // These types have no maps with keys that are no text, the only thing that JSON cannot say.
        let Ok(text) = serde_json::to_string(message) else { return false };
        self.send(Outgoing::Text(text))
    }

    /// Whether the page takes it; it is counted where not.
    pub(super) fn send(&mut self, outgoing: Outgoing) -> bool {
        let Some((_, outbox)) = &self.own else { return false };
        match outbox.try_send(outgoing) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                self.unsent += 1;
                false
            }
        }
    }
}
