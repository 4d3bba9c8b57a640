//! The program as a server: connections on threads of their own, the session on this one.

use std::io::{BufRead, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;

use super::arguments::Arguments;
use super::connection::{Inbound, Outgoing, TrafficCounts, serve_connection};
use super::counters::Traffic;
use super::error::VrError;
use super::front_door::{Door, Visit, refuse};
use super::message::Notice;
use super::output::save;
use super::protocol::{ServerMessage, patch, robot, surface, welcome};
use super::seat::Seat;
use super::session::{Handled, Session};

/// Connections at once; more are turned away.
const MOST_CONNECTIONS: usize = 32;
/// Messages that wait for the session, and those that wait for the page.
const INBOX: usize = 256;
const OUTBOX: usize = 256;
/// Time between two changes of the picture, and between two poses of the robot.
const PICTURE_STEP: Duration = Duration::from_millis(11);
const ROBOT_STEP: Duration = Duration::from_millis(33);

/// Serves a session until the person ends it.
pub(super) fn serve(arguments: &Arguments, mut session: Session) -> Result<(), VrError> {
    let address = arguments.listen;
    let listening = |source| VrError::Listen { address: address.to_string(), source };
    let listener = TcpListener::bind(address).map_err(listening)?;
    let address = listener.local_addr().map_err(listening)?;
    let token = if address.ip().is_loopback() { None } else { Some(secret()?) };
    announce(&address.to_string(), token.as_deref());
    let (inbox, events) = sync_channel(INBOX);
    let counts = Arc::new(TrafficCounts::default());
    let house = Arc::new(House {
        door: Door { token },
        seat: Seat::default(),
        inbox,
        counts: Arc::clone(&counts),
        visitors: AtomicUsize::new(0),
    });
    std::thread::spawn(move || receive(&listener, &house));
    let enter = wait_for_enter();
    let mut desk = Desk::default();
    loop {
        let ended = match events.recv_timeout(PICTURE_STEP) {
            Ok(inbound) => desk.take(inbound, &mut session, arguments, &counts)?,
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        if ended || enter.try_recv().is_ok() {
            return desk.end(&mut session, arguments, &counts);
        }
        desk.show(&mut session);
    }
}

/// What the threads of the connections share.
struct House {
    door: Door,
    seat: Seat,
    inbox: SyncSender<Inbound>,
    counts: Arc<TrafficCounts>,
    visitors: AtomicUsize,
}

fn receive(listener: &TcpListener, house: &Arc<House>) {
    for stream in listener.incoming() {
        let Ok(mut stream) = stream else { continue };
        if house.visitors.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
            let _ = refuse(&mut stream, "503 Service Unavailable", "Too many connections.");
            house.counts.refused.fetch_add(1, Ordering::Relaxed);
            house.visitors.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let house = Arc::clone(house);
        std::thread::spawn(move || {
            // A client that goes away in the middle of a request is no matter.
            let _ = visit(stream, &house);
            house.visitors.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

fn visit(mut stream: TcpStream, house: &House) -> std::io::Result<()> {
    let (rest, answer, shown) = match house.door.open(&mut stream)? {
        Visit::Answered => return Ok(()),
        Visit::Refused => {
            house.counts.refused.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        }
        Visit::Session { rest, answer, key } => (rest, answer, key),
    };
    let fresh = secret().map_err(std::io::Error::other)?;
    let Some((connection, key)) = house.seat.take(shown.as_deref(), fresh) else {
        house.counts.refused.fetch_add(1, Ordering::Relaxed);
        return refuse(&mut stream, "409 Conflict", "Another person is painting.").map(|_| ());
    };
    stream.write_all(answer.as_bytes())?;
    let (outbox, outgoing) = sync_channel(OUTBOX);
    if house.inbox.send(Inbound::Join { connection, key, outbox }).is_ok() {
        serve_connection(stream, rest, connection, &house.seat, &house.inbox, &outgoing, &house.counts);
    }
    Ok(())
}

/// The session's side of the connection.
#[derive(Default)]
struct Desk {
    client: Option<(u64, SyncSender<Outgoing>)>,
    /// Pictures that the page has missed because it was slow: they are sent whole when it takes them.
    missed: [bool; 2],
    shown: Option<Instant>,
    robot_shown: Option<Instant>,
    traffic: Traffic,
}

impl Desk {
    /// Takes what a connection says; whether the session is over.
    fn take(
        &mut self,
        inbound: Inbound,
        session: &mut Session,
        arguments: &Arguments,
        counts: &TrafficCounts,
    ) -> Result<bool, VrError> {
        match inbound {
            Inbound::Join { connection, key, outbox } => {
                self.client = Some((connection, outbox));
                self.traffic.connections += 1;
                self.say(&welcome(session, &key));
                self.send(Outgoing::Binary(surface(session.world())));
                self.missed = [true; 2];
            }
            Inbound::Events { connection, events } if self.is(connection) => {
                let begun = ThreadTime::now();
                let count = events.len();
                for event in &events {
                    match session.handle(event)? {
                        // What follows a gap comes again with it.
                        Handled::Gap => break,
                        Handled::Results { end: true } => return Ok(true),
                        Handled::Results { end: false } => self.save(session, arguments, counts)?,
                        Handled::Done | Handled::Repeated | Handled::Refused => {}
                    }
                }
                self.traffic.work(begun.elapsed().as_secs_f64(), count);
                self.say(&ServerMessage::Ack { next_sequence: session.next_sequence() });
            }
            Inbound::Dropped { connection } if self.is(connection) => {
                self.say(&ServerMessage::Ack { next_sequence: session.next_sequence() });
            }
            Inbound::Leave { connection } if self.is(connection) => self.client = None,
            // The words of a connection that has lost the seat.
            _ => {}
        }
        Ok(false)
    }

    /// Shows the person what has changed.
    fn show(&mut self, session: &mut Session) {
        for notice in session.take_notices() {
            self.say(&ServerMessage::Notice { notice });
        }
        let due = |last: &mut Option<Instant>, step: Duration| {
            let due = last.is_none_or(|last| last.elapsed() >= step);
            if due {
                *last = Some(Instant::now());
            }
            due
        };
        if due(&mut self.shown, PICTURE_STEP) {
            let begun = ThreadTime::now();
            let patches = session.take_patches();
            self.traffic.work(begun.elapsed().as_secs_f64(), 0);
            for (number, changed) in patches.into_iter().enumerate() {
                let whole = std::mem::take(&mut self.missed[number]);
                let shown = if whole { Some(session.canvases()[number].whole()) } else { changed };
                let sent = shown.is_none_or(|shown| self.send(Outgoing::Binary(patch(number as u8, &shown))));
                self.missed[number] = !sent;
            }
        }
        if due(&mut self.robot_shown, ROBOT_STEP) {
            self.say(&robot(session));
        }
    }

    fn end(&mut self, session: &mut Session, arguments: &Arguments, counts: &TrafficCounts) -> Result<(), VrError> {
        session.finish()?;
        self.missed = [true; 2];
        self.shown = None;
        self.show(session);
        let saved = self.save(session, arguments, counts);
        // Time for the last words to reach the page.
        std::thread::sleep(Duration::from_millis(200));
        saved
    }

    fn save(&mut self, session: &Session, arguments: &Arguments, counts: &TrafficCounts) -> Result<(), VrError> {
        self.traffic.malformed = counts.malformed.load(Ordering::Relaxed);
        self.traffic.too_many = counts.too_many.load(Ordering::Relaxed);
        self.traffic.refused = counts.refused.load(Ordering::Relaxed);
        let saved = save(session, &self.traffic, &arguments.out);
        let folder = arguments.out.display().to_string();
        self.say(&ServerMessage::Notice { notice: Notice::Ended { folder } });
        saved
    }

    fn is(&self, connection: u64) -> bool {
        self.client.as_ref().is_some_and(|(own, _)| *own == connection)
    }

    fn say(&mut self, message: &ServerMessage) {
        // These types have no maps with keys that are no text, the only thing that JSON cannot say.
        let Ok(text) = serde_json::to_string(message) else { return };
        self.send(Outgoing::Text(text));
    }

    /// Whether the page takes it; it is counted where not.
    fn send(&mut self, outgoing: Outgoing) -> bool {
        let Some((_, outbox)) = &self.client else { return false };
        match outbox.try_send(outgoing) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                self.traffic.unsent += 1;
                false
            }
        }
    }
}

fn announce(address: &str, token: Option<&str>) {
    let query = token.map_or(String::new(), |token| format!("?token={token}"));
    println!("http://{address}/{query}");
    if token.is_some() {
        eprintln!("Whoever has this address with its token can paint. Headsets show VR only over https or localhost:");
        eprintln!(
            "put a TLS proxy before it, or use `adb reverse tcp:8090 tcp:8090` and open localhost in the headset."
        );
    } else {
        eprintln!("Open it in a browser; mouse, keyboard and touch paint. For a headset: connect it by USB, run");
        eprintln!(
            "`adb reverse tcp:{0} tcp:{0}`, and open the address in the headset's browser.",
            address.rsplit(':').next().unwrap_or("8090")
        );
    }
    eprintln!("Press Enter here, or End on the page, to end the session.");
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
