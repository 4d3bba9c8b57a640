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
use super::listener::{Listening, listen};
use super::message::Notice;
use super::output::save;
use super::page_kind::PageKind;
use super::protocol::{ServerMessage, patch, robot, surface, welcome};
use super::session::{Handled, Session};
use crate::interruption;

/// Time between two changes of what the person paints, and between two of the robot and of what it has sprayed.
const HAND_STEP: Duration = Duration::from_millis(5);
const ROBOT_STEP: Duration = Duration::from_millis(33);
/// How long the session waits for events before it looks whether the robot is to be shown.
const WAIT: Duration = Duration::from_millis(11);

/// Serves a session until the person ends it.
pub(super) fn serve(arguments: &Arguments, mut session: Session) -> Result<(), VrError> {
    let listening = listen(arguments.listen, "mouse, keyboard and touch paint", PageKind::Painting)?;
    let mut connection = Connection::default();
    loop {
        let ended = match listening.inbox.recv_timeout(WAIT) {
            Ok(inbound) => connection.take(inbound, &mut session, arguments, &listening.counts)?,
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        if ended || listening.enter.try_recv().is_ok() || interruption::is_requested() {
            return connection.end(&mut session, arguments, &listening);
        }
        connection.show(&mut session);
    }
}

/// The session's side of the connection.
#[derive(Default)]
struct Connection {
    client: Client,
    /// Pictures that the page has missed because it was slow: they are sent whole when it takes them.
    missed: [bool; 2],
    /// When each of the pictures was sent, and the robot.
    shown: [Option<Instant>; 2],
    robot_shown: Option<Instant>,
    traffic: Traffic,
}

impl Connection {
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
            // The words of a connection that has lost the lease.
            _ => {}
        }
        Ok(false)
    }

    /// Shows the person what has changed.
    fn show(&mut self, session: &mut Session) {
        for notice in session.take_notices() {
            self.client.say(&ServerMessage::Notice { notice });
        }
        let due = |last: Option<Instant>, step: Duration| last.is_none_or(|last| last.elapsed() >= step);
        for (number, step) in [HAND_STEP, ROBOT_STEP].into_iter().enumerate() {
            if !due(self.shown[number], step) {
                continue;
            }
            let begun = ThreadTime::now();
            let changed = session.take_patch(number);
            self.traffic.work(begun.elapsed().as_secs_f64(), 0);
            let whole = std::mem::take(&mut self.missed[number]);
            let Some(shown) = (if whole { Some(session.canvases()[number].whole()) } else { changed }) else {
                continue;
            };
            // Only what was sent counts: the first change after a pause goes out at once.
            self.shown[number] = Some(Instant::now());
            self.missed[number] = !self.client.send(Outgoing::Binary(patch(number as u8, &shown)));
        }
        if due(self.robot_shown, ROBOT_STEP) {
            self.robot_shown = Some(Instant::now());
            self.client.say(&robot(session));
        }
    }

    fn end(&mut self, session: &mut Session, arguments: &Arguments, listening: &Listening) -> Result<(), VrError> {
        let text = "the robot finishes, and the results are written".into();
        self.client.say(&ServerMessage::Notice { notice: Notice::Text { text } });
        listening.close_inbox();
        let saved = self.finish(session, arguments, &listening.counts);
        let (folder, left_out) = (arguments.out.display().to_string(), *saved.as_ref().unwrap_or(&0.0));
        let failed = saved.as_ref().err().map(ToString::to_string);
        self.client.say(&ServerMessage::Notice { notice: Notice::Ended { folder, left_out, failed } });
        self.client.leave();
        listening.wait_until_told();
        saved.map(|_| ())
    }

    fn finish(&mut self, session: &mut Session, arguments: &Arguments, counts: &TrafficCounts) -> Result<f64, VrError> {
        session.finish()?;
        self.missed = [true; 2];
        self.shown = [None; 2];
        self.show(session);
        self.save(session, arguments, counts)
    }

    /// Writes recording and results while the session goes on. What cannot be written then is told and no end of the session.
    fn save_now(&mut self, session: &mut Session, arguments: &Arguments, counts: &TrafficCounts) {
        let saved = session.save_recording().and_then(|path| {
            // Too little flown is a result of the end, not of the way to it.
            match self.save(session, arguments, counts) {
                Ok(left_out) => Ok((path, left_out)),
                Err(VrError::Unreachable { .. } | VrError::NeverCaughtUp { .. }) => Ok((path, 0.0)),
                Err(error) => Err(error),
            }
        });
        let notice = match saved {
            Ok((path, left_out)) => {
                Notice::Saved { path: path.map_or_else(String::new, |path| path.display().to_string()), left_out }
            }
            Err(error) => Notice::Text { text: format!("not saved: {error}") },
        };
        self.client.say(&ServerMessage::Notice { notice });
    }

    /// Writes the results; the share of the paint that the mission leaves out.
    fn save(&mut self, session: &Session, arguments: &Arguments, counts: &TrafficCounts) -> Result<f64, VrError> {
        self.traffic.malformed = counts.malformed.load(Ordering::Relaxed);
        self.traffic.too_many = counts.too_many.load(Ordering::Relaxed);
        self.traffic.refused = counts.refused.load(Ordering::Relaxed);
        (self.traffic.connections, self.traffic.unsent) = (self.client.connections, self.client.unsent);
        save(session, &self.traffic, &arguments.out)
    }
}
