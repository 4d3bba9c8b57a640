//! The address that is listened on: connections on threads of their own, what they say in one inbox.

use std::collections::VecDeque;
use std::io::{BufRead, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::client_lease::ClientLease;
use super::connection::{Inbound, Inbox, TrafficCounts, serve_connection, turn_away};
use super::error::VrError;
use super::http_server::{HttpOutcome, HttpServer};
use super::page_kind::PageKind;

use crate::{result, say};

/// Connections that have not said yet what they want, or are being answered. Another one ends the oldest of them: whoever asks for the page
/// does so within a millisecond, who keeps connections half open must open them faster than that.
const MOST_WAITING: usize = 128;
/// An answer that is taken no faster than this is given up.
const ANSWER_TIME: Duration = Duration::from_secs(5);
/// What a visitor is told who finds another person here: code of the WebSocket's end, and why.
const OCCUPIED: (u16, &str) = (4001, "Another person is here.");
/// Messages that wait for the session, and those that wait for the page.
const INBOX: usize = 256;
const OUTBOX: usize = 256;

/// What comes in.
pub(super) struct Listening {
    /// What the connections say.
    pub(super) inbox: Receiver<Inbound>,
    pub(super) counts: Arc<TrafficCounts>,
    /// A line on the standard input, which ends the program.
    pub(super) enter: Receiver<()>,
    state: Arc<ServerState>,
}

impl Listening {
    /// The session is over: what the connections still say is dropped, so that none of them waits and each can be spoken to.
    pub(super) fn close_inbox(&self) {
        self.state.inbox.close();
        // Whoever waits for room in it goes on.
        while self.inbox.try_recv().is_ok() {}
    }

    /// Waits until a connection whose outbox was given up has sent what was in it.
    pub(super) fn wait_until_told(&self) {
        let begun = Instant::now();
        while begun.elapsed() < ANSWER_TIME && !self.state.lease.is_free() {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Listens, and prints the address to open. Anything but loopback is served only with a token, which is printed with it. `does` is what
/// the page is for.
pub(super) fn listen(address: SocketAddr, does: &str, page: PageKind) -> Result<Listening, VrError> {
    let refused = |source| VrError::Listen { address: address.to_string(), source };
    let listener = TcpListener::bind(address).map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    let token = if address.ip().is_loopback() { None } else { Some(secret()?) };
    announce(address, token.as_deref(), does);
    let (inbox, events) = Inbox::new(INBOX, page);
    let counts = Arc::new(TrafficCounts::default());
    let state = Arc::new(ServerState {
        http: HttpServer { token, page },
        lease: ClientLease::default(),
        inbox,
        counts: Arc::clone(&counts),
        waiting: Mutex::default(),
    });
    let shared = Arc::clone(&state);
    std::thread::spawn(move || receive(&listener, &shared));
    Ok(Listening { inbox: events, counts, enter: wait_for_enter(), state })
}

/// What the threads of the connections share.
struct ServerState {
    http: HttpServer,
    lease: ClientLease,
    inbox: Inbox,
    counts: Arc<TrafficCounts>,
    waiting: Mutex<Waiting>,
}

/// The connections that are not let in yet, the oldest first.
#[derive(Default)]
struct Waiting {
    next: u64,
    streams: VecDeque<(u64, TcpStream)>,
}

impl Waiting {
    /// Takes one more; its number, and whether the oldest had to go.
    fn come(&mut self, stream: &TcpStream) -> std::io::Result<(u64, bool)> {
        let full = self.streams.len() >= MOST_WAITING;
        if let Some((_, oldest)) = self.streams.pop_front_if(|_| full) {
            let _ = oldest.shutdown(Shutdown::Both);
        }
        self.next += 1;
        self.streams.push_back((self.next, stream.try_clone()?));
        Ok((self.next, full))
    }

    fn leave(&mut self, number: u64) {
        self.streams.retain(|(other, _)| *other != number);
    }
}

impl ServerState {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn receive(listener: &TcpListener, state: &Arc<ServerState>) {
    for stream in listener.incoming() {
        let Ok(stream) = stream else { continue };
        let Ok((number, full)) = state.waiting().come(&stream) else { continue };
        state.counts.refused.fetch_add(full.into(), Ordering::Relaxed);
        let state = Arc::clone(state);
        std::thread::spawn(move || {
            // A client that goes away in the middle of a request is no matter.
            let _ = visit(stream, number, &state);
            state.waiting().leave(number);
        });
    }
}

fn visit(mut stream: TcpStream, number: u64, state: &ServerState) -> std::io::Result<()> {
    stream.set_write_timeout(Some(ANSWER_TIME))?;
    let (rest, answer, shown) = match state.http.open(&mut stream)? {
        HttpOutcome::Answered => return Ok(()),
        HttpOutcome::Refused => {
            state.counts.refused.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        }
        HttpOutcome::Session { rest, answer, key } => (rest, answer, key),
    };
    let fresh = secret().map_err(std::io::Error::other)?;
    let Some((connection, key)) = state.lease.take(shown.as_deref(), fresh) else {
        state.counts.refused.fetch_add(1, Ordering::Relaxed);
        stream.write_all(answer.as_bytes())?;
        // A page learns why only from a WebSocket.
        turn_away(stream, OCCUPIED);
        return Ok(());
    };
    stream.write_all(answer.as_bytes())?;
    state.waiting().leave(number);
    let (outbox, outgoing) = sync_channel(OUTBOX);
    if state.inbox.send(Inbound::Join { connection, key, outbox }) {
        serve_connection(stream, rest, connection, &state.lease, &state.inbox, &outgoing, &state.counts);
    }
    Ok(())
}

fn announce(address: SocketAddr, token: Option<&str>, does: &str) {
    let query = token.map_or(String::new(), |token| format!("?token={token}"));
    let port = address.port();
    result!("http://{}/{query}", SocketAddr::new(reachable(address.ip()), port));
    if token.is_some() {
        say!("Whoever has this address with its token is let in. Headsets show VR only over https or localhost:");
        say!(
            "put a TLS proxy before it, or use `adb reverse tcp:{port} tcp:{port}` and open http://localhost:{port}/{query} in the headset."
        );
    } else {
        say!("Open it in a browser; {does}. For a headset: connect it by USB, run");
        say!("`adb reverse tcp:{port} tcp:{port}`, and open the address in the headset's browser.");
    }
    say!("Press Enter here, or Stop on the page, to end.");
}

/// An address that others can open: where all of them are listened on, that of the network that other machines are reached by, as the system
/// chooses it for a datagram that is not sent; without any network, loopback.
fn reachable(listened: IpAddr) -> IpAddr {
    // From the blocks that are set aside for documents (RFC 5737, RFC 3849).
    let elsewhere: IpAddr = match listened {
        IpAddr::V4(_) => Ipv4Addr::new(192, 0, 2, 1).into(),
        IpAddr::V6(_) => Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1).into(),
    };
    let own = || {
        let socket = UdpSocket::bind(SocketAddr::new(listened, 0)).ok()?;
        socket.connect(SocketAddr::new(elsewhere, 9)).ok()?;
        Some(socket.local_addr().ok()?.ip())
    };
    let loopback = match listened {
        IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
    };
    if listened.is_unspecified() { own().unwrap_or(loopback) } else { listened }
}

/// A line on the standard input ends the session; a closed one does not.
fn wait_for_enter() -> Receiver<()> {
    let (send, receive) = sync_channel(1);
    std::thread::spawn(move || {
        let mut line = String::new();
        if std::io::stdin().lock().read_line(&mut line).is_ok_and(|count| count > 0) {
            let _ = send.send(());
        }
    });
    receive
}

/// Random text that nobody guesses.
fn secret() -> Result<String, VrError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(VrError::Token)?;
    Ok(format!("{:032x}", u128::from_le_bytes(bytes)))
}
