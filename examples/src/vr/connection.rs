//! One WebSocket: messages in within size and rate, whatever the session says out.

use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::time::{Duration, Instant};

use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

use super::client_lease::ClientLease;
use super::event::Event;
use super::page_kind::PageKind;
use super::protocol::ClientMessage;

/// Messages per second in the long run, and at once.
const MESSAGES_PER_SECOND: f64 = 200.0;
const BURST: f64 = 400.0;
/// How long the connection waits for what the session says before it looks for messages. The other way round an answer would wait for the
/// socket's time limit, which systems round up to several milliseconds.
const TURN: Duration = Duration::from_millis(1);
/// Messages that are read before the session has the word again.
const AT_ONCE: usize = 64;
/// A client that takes nothing for so long is gone.
const WRITE_TIME: Duration = Duration::from_secs(5);

/// Counts of all connections.
#[derive(Debug, Default)]
pub(super) struct TrafficCounts {
    /// Messages that are none of the protocol, oversized ones among them.
    pub(super) malformed: AtomicU64,
    /// Messages dropped for their rate.
    pub(super) too_many: AtomicU64,
    /// Connections that were not let in.
    pub(super) refused: AtomicU64,
}

/// What a connection has to tell the session.
pub(super) enum Inbound {
    /// It has the lease.
    Join { connection: u64, key: String, outbox: SyncSender<Outgoing> },
    /// Events of the person.
    Events { connection: u64, events: Vec<Event> },
    /// What a page says that is not for painting.
    Text { connection: u64, text: String },
    /// A file from there.
    File { connection: u64, bytes: Vec<u8> },
    /// A message was dropped: the person's page has to hear what has arrived.
    Dropped { connection: u64 },
    /// It is over.
    Leave { connection: u64 },
}

/// Where connections leave what they have to tell; it may be closed, and then takes nothing more.
pub(super) struct Inbox {
    sender: SyncSender<Inbound>,
    closed: AtomicBool,
    /// What says something.
    page: PageKind,
}

impl Inbox {
    /// With room for so many messages; the other end.
    pub(super) fn new(room: usize, page: PageKind) -> (Self, Receiver<Inbound>) {
        let (sender, receiver) = sync_channel(room);
        (Self { sender, closed: AtomicBool::new(false), page }, receiver)
    }

    /// Waits for room if need be; whether anybody is there to hear it.
    pub(super) fn send(&self, inbound: Inbound) -> bool {
        self.closed.load(Ordering::SeqCst) || self.sender.send(inbound).is_ok()
    }

    pub(super) fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
    }
}

/// What the session has to say.
pub(super) enum Outgoing {
    Text(String),
    Binary(Vec<u8>),
}

/// Allows a rate, and a burst.
struct Bucket {
    left: f64,
    filled: Instant,
}

impl Bucket {
    fn new() -> Self {
        Self { left: BURST, filled: Instant::now() }
    }

    fn take(&mut self) -> bool {
        let now = Instant::now();
        self.left = (self.left + MESSAGES_PER_SECOND * (now - self.filled).as_secs_f64()).min(BURST);
        self.filled = now;
        let allowed = self.left >= 1.0;
        self.left -= f64::from(u8::from(allowed));
        allowed
    }
}

/// Serves a connection that has the lease until it ends.
pub(super) fn serve_connection(
    stream: TcpStream,
    rest: Vec<u8>,
    connection: u64,
    lease: &ClientLease,
    inbox: &Inbox,
    outbox: &Receiver<Outgoing>,
    counts: &TrafficCounts,
) {
    // Small messages must not wait for larger ones.
    if stream.set_write_timeout(Some(WRITE_TIME)).and_then(|()| stream.set_nodelay(true)).is_ok() {
        let longest = Some(inbox.page.longest_message());
        let config = WebSocketConfig::default().max_message_size(longest).max_frame_size(longest);
        let mut socket = WebSocket::from_partially_read(stream, rest, Role::Server, Some(config));
        let mut bucket = Bucket::new();
        let mut turn = || turn(&mut socket, connection, &mut bucket, inbox, outbox, counts);
        let mut open = true;
        while open && lease.holds(connection) {
            open = turn();
        }
        // What had come before another connection took the lease is counted all the same.
        if open {
            turn();
        }
        let _ = socket.close(None);
        let _ = socket.flush();
    }
    lease.leave(connection);
    inbox.send(Inbound::Leave { connection });
}

/// Tells a WebSocket whose handshake is answered that it is not let in, and why.
pub(super) fn turn_away(stream: TcpStream, (code, why): (u16, &'static str)) {
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, None);
    let _ = socket.close(Some(CloseFrame { code: code.into(), reason: why.into() }));
    // Until the other side has taken it: what is closed before may be lost.
    let _ = socket.get_ref().set_read_timeout(Some(WRITE_TIME));
    let begun = Instant::now();
    while begun.elapsed() < WRITE_TIME && socket.read().is_ok() {}
}

/// Sends what there is, then reads what has come; whether the connection goes on.
fn turn(
    socket: &mut WebSocket<TcpStream>,
    connection: u64,
    bucket: &mut Bucket,
    inbox: &Inbox,
    outbox: &Receiver<Outgoing>,
    counts: &TrafficCounts,
) -> bool {
    // Whoever takes nothing more, or is told nothing more, is still heard: what has come has come.
    let open = send(socket, outbox).is_some();
    for _ in 0..AT_ONCE {
        match read_now(socket) {
            Ok(Some(message)) => {
                if !take(message, connection, bucket, inbox, counts) {
                    return false;
                }
            }
            Ok(None) => break,
            Err(error) => {
                // Oversized or broken frames: nothing after them can be trusted.
                let broken = !matches!(error, Error::Io(_) | Error::ConnectionClosed | Error::AlreadyClosed);
                counts.malformed.fetch_add(u64::from(broken), Ordering::Relaxed);
                return false;
            }
        }
    }
    open
}

/// Waits for something to send, and sends all there is; `None` where there is nobody to send or to take it any more.
fn send(socket: &mut WebSocket<TcpStream>, outbox: &Receiver<Outgoing>) -> Option<()> {
    let mut next = outbox.recv_timeout(TURN);
    while let Ok(outgoing) = next {
        let message = match outgoing {
            Outgoing::Text(text) => Message::text(text),
            Outgoing::Binary(bytes) => Message::binary(bytes),
        };
        socket.write(message).ok()?;
        next = outbox.try_recv().map_err(|error| match error {
            TryRecvError::Empty => RecvTimeoutError::Timeout,
            TryRecvError::Disconnected => RecvTimeoutError::Disconnected,
        });
    }
    socket.flush().ok()?;
    next.is_err_and(|error| error == RecvTimeoutError::Timeout).then_some(())
}

/// The next message if it is there. Only reading does not wait: writing has a time limit of its own.
fn read_now(socket: &mut WebSocket<TcpStream>) -> Result<Option<Message>, Error> {
    socket.get_ref().set_nonblocking(true)?;
    let read = socket.read();
    socket.get_ref().set_nonblocking(false)?;
    match read {
        Err(Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => Ok(None),
        read => read.map(Some),
    }
}

/// Hands a message to the session; whether the connection goes on.
fn take(message: Message, connection: u64, bucket: &mut Bucket, inbox: &Inbox, counts: &TrafficCounts) -> bool {
    let said = match (message, inbox.page) {
        (Message::Ping(_) | Message::Pong(_), _) => return true,
        (Message::Close(_), _) => return false,
        (Message::Text(text), PageKind::Painting) => serde_json::from_str::<ClientMessage>(&text)
            .ok()
            .map(|message| Inbound::Events { connection, events: message.events }),
        (Message::Text(text), PageKind::Design) => Some(Inbound::Text { connection, text: text.to_string() }),
        (Message::Binary(bytes), PageKind::Design) => Some(Inbound::File { connection, bytes: bytes.into() }),
        (Message::Binary(_) | Message::Frame(_), _) => None,
    };
    let dropped = if said.is_none() {
        Some(&counts.malformed)
    } else if bucket.take() {
        None
    } else {
        Some(&counts.too_many)
    };
    let inbound = match (dropped, said) {
        (None, Some(said)) => said,
        (counter, _) => {
            counter.unwrap_or(&counts.malformed).fetch_add(1, Ordering::Relaxed);
            Inbound::Dropped { connection }
        }
    };
    inbox.send(inbound)
}
