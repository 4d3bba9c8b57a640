//! The program as a server of a session.

use std::sync::atomic::Ordering;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;

use super::arguments::Arguments;
use super::client::Client;
use super::connection::{Inbound, Outgoing, TrafficCounts};
use super::counters::Traffic;
use super::error::VrError;
use super::listener::listen;
use super::message::Notice;
use super::output::save;
use super::protocol::{ServerMessage, patch, robot, surface, welcome};
use super::session::{Handled, Session};

/// Time between two changes of the picture, and between two poses of the robot.
const PICTURE_STEP: Duration = Duration::from_millis(11);
const ROBOT_STEP: Duration = Duration::from_millis(33);

/// Serves a session until the person ends it.
pub(super) fn serve(arguments: &Arguments, mut session: Session) -> Result<(), VrError> {
    let listening = listen(arguments.listen, "mouse, keyboard and touch paint")?;
    let mut desk = Desk::default();
    loop {
        let ended = match listening.inbox.recv_timeout(PICTURE_STEP) {
            Ok(inbound) => desk.take(inbound, &mut session, arguments, &listening.counts)?,
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        if ended || listening.enter.try_recv().is_ok() {
            return desk.end(&mut session, arguments, &listening.counts);
        }
        desk.show(&mut session);
    }
}

/// The session's side of the connection.
#[derive(Default)]
struct Desk {
    client: Client,
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
                self.client.join(connection, outbox);
                self.client.say(&welcome(session, &key));
                self.client.send(Outgoing::Binary(surface(session.world())));
                self.missed = [true; 2];
            }
            Inbound::Events { connection, events } if self.client.is(connection) => {
                let begun = ThreadTime::now();
                let count = events.len();
                for event in &events {
                    match session.handle(event)? {
                        // What follows a gap comes again with it.
                        Handled::Gap => break,
                        Handled::Results { end: true } => return Ok(true),
                        Handled::Results { end: false } => self.save_now(session, arguments, counts),
                        Handled::Done | Handled::Repeated | Handled::Refused => {}
                    }
                }
                self.traffic.work(begun.elapsed().as_secs_f64(), count);
                self.client.say(&ServerMessage::Ack { next_sequence: session.next_sequence() });
            }
            Inbound::Dropped { connection } if self.client.is(connection) => {
                self.client.say(&ServerMessage::Ack { next_sequence: session.next_sequence() });
            }
            Inbound::Leave { connection } if self.client.is(connection) => self.client.leave(),
            // The words of a connection that has lost the seat.
            _ => {}
        }
        Ok(false)
    }

    /// Shows the person what has changed.
    fn show(&mut self, session: &mut Session) {
        for notice in session.take_notices() {
            self.client.say(&ServerMessage::Notice { notice });
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
                let sent = shown.is_none_or(|shown| self.client.send(Outgoing::Binary(patch(number as u8, &shown))));
                self.missed[number] = !sent;
            }
        }
        if due(&mut self.robot_shown, ROBOT_STEP) {
            self.client.say(&robot(session));
        }
    }

    fn end(&mut self, session: &mut Session, arguments: &Arguments, counts: &TrafficCounts) -> Result<(), VrError> {
        session.finish()?;
        self.missed = [true; 2];
        self.shown = None;
        self.show(session);
        let saved = self.save(session, arguments, counts);
        self.client
            .say(&ServerMessage::Notice { notice: Notice::Ended { folder: arguments.out.display().to_string() } });
        // Time for the last words to reach the page.
        std::thread::sleep(Duration::from_millis(200));
        saved
    }

    /// Writes recording and results while the session goes on. What cannot be written then is told and no end of the session.
    fn save_now(&mut self, session: &mut Session, arguments: &Arguments, counts: &TrafficCounts) {
        let saved = session.save_recording().and_then(|path| {
            // Too little flown is a result of the end, not of the way to it.
            match self.save(session, arguments, counts) {
                Ok(()) | Err(VrError::Unreachable { .. } | VrError::NeverCaughtUp { .. }) => Ok(path),
                Err(error) => Err(error),
            }
        });
        let notice = match saved {
            Ok(path) => Notice::Saved { path: path.map_or_else(String::new, |path| path.display().to_string()) },
            Err(error) => Notice::Text { text: format!("not saved: {error}") },
        };
        self.client.say(&ServerMessage::Notice { notice });
    }

    fn save(&mut self, session: &Session, arguments: &Arguments, counts: &TrafficCounts) -> Result<(), VrError> {
        self.traffic.malformed = counts.malformed.load(Ordering::Relaxed);
        self.traffic.too_many = counts.too_many.load(Ordering::Relaxed);
        self.traffic.refused = counts.refused.load(Ordering::Relaxed);
        (self.traffic.connections, self.traffic.unsent) = (self.client.connections, self.client.unsent);
        save(session, &self.traffic, &arguments.out)
    }
}
