//! The address that is listened on: connections on threads of their own, what they say in one inbox.

use std::io::{BufRead, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::client_lease::ClientLease;
use super::connection::{Inbound, TrafficCounts, serve_connection};
use super::error::VrError;
use super::http_server::{HttpOutcome, HttpServer, refuse};

/// Connections at once; more are turned away.
const MOST_CONNECTIONS: usize = 32;
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
}

/// Listens, and prints the address to open. Anything but loopback is served only with a token, which is printed with it. `does` is what
/// the page is for.
pub(super) fn listen(address: SocketAddr, does: &str) -> Result<Listening, VrError> {
    let refused = |source| VrError::Listen { address: address.to_string(), source };
    let listener = TcpListener::bind(address).map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    let token = if address.ip().is_loopback() { None } else { Some(secret()?) };
    announce(&address.to_string(), token.as_deref(), does);
    let (inbox, events) = sync_channel(INBOX);
    let counts = Arc::new(TrafficCounts::default());
    let state = Arc::new(ServerState {
        http: HttpServer { token },
        lease: ClientLease::default(),
        inbox,
        counts: Arc::clone(&counts),
        visitors: AtomicUsize::new(0),
    });
    std::thread::spawn(move || receive(&listener, &state));
    Ok(Listening { inbox: events, counts, enter: wait_for_enter() })
}

/// What the threads of the connections share.
struct ServerState {
    http: HttpServer,
    lease: ClientLease,
    inbox: SyncSender<Inbound>,
    counts: Arc<TrafficCounts>,
    visitors: AtomicUsize,
}

fn receive(listener: &TcpListener, state: &Arc<ServerState>) {
    for stream in listener.incoming() {
        let Ok(mut stream) = stream else { continue };
        if state.visitors.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
            let _ = refuse(&mut stream, "503 Service Unavailable", "Too many connections.");
            state.counts.refused.fetch_add(1, Ordering::Relaxed);
            state.visitors.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let state = Arc::clone(state);
        std::thread::spawn(move || {
            // A client that goes away in the middle of a request is no matter.
            let _ = visit(stream, &state);
            state.visitors.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

fn visit(mut stream: TcpStream, state: &ServerState) -> std::io::Result<()> {
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
        return refuse(&mut stream, "409 Conflict", "Another person is here.").map(|_| ());
    };
    stream.write_all(answer.as_bytes())?;
    let (outbox, outgoing) = sync_channel(OUTBOX);
    if state.inbox.send(Inbound::Join { connection, key, outbox }).is_ok() {
        serve_connection(stream, rest, connection, &state.lease, &state.inbox, &outgoing, &state.counts);
    }
    Ok(())
}

fn announce(address: &str, token: Option<&str>, does: &str) {
    let query = token.map_or(String::new(), |token| format!("?token={token}"));
    println!("http://{address}/{query}");
    if token.is_some() {
        eprintln!("Whoever has this address with its token is let in. Headsets show VR only over https or localhost:");
        eprintln!(
            "put a TLS proxy before it, or use `adb reverse tcp:8090 tcp:8090` and open localhost in the headset."
        );
    } else {
        eprintln!("Open it in a browser; {does}. For a headset: connect it by USB, run");
        eprintln!(
            "`adb reverse tcp:{0} tcp:{0}`, and open the address in the headset's browser.",
            address.rsplit(':').next().unwrap_or("8090")
        );
    }
    eprintln!("Press Enter here, or Stop on the page, to end.");
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
