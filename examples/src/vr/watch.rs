//! What others do, on the page: a run that is served with Foxglove's protocol (`scan --live`), or a recording of one.

mod feed;
mod foxglove_client;
mod place;
mod recorded;
mod scene;
mod shapes;
mod source;

pub(super) use source::WatchSource;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::arguments::Arguments;
use super::client::Client;
use super::connection::{Inbound, Outgoing};
use super::error::VrError;
use super::event::{Command, Event};
use super::listener::{Listening, listen};
use super::message::Notice;
use super::page_kind::PageKind;
use super::protocol::{Frame, PROTOCOL, ServerMessage};
use crate::interruption;
use crate::report::save_figures;
use crate::say;
use feed::{Feed, Heard};
use foxglove_client::FoxgloveClient;
use place::place;
use recorded::Recorded;
use scene::{Change, Scene};

/// Time between two pictures.
const STEP: Duration = Duration::from_millis(33);
/// Name of the frame of a camera, which looks along its z.
const CAMERA: &str = "camera";

/// `report.json`: what was seen.
#[derive(Debug, Serialize)]
struct WatchFigures {
    source: String,
    /// Messages that are shown, that could not be decoded or drawn, and of topics that are not shown.
    messages: u64,
    malformed_messages: u64,
    messages_of_other_topics: u64,
    /// Things in the scene at the end, and their triangles.
    entities: u64,
    triangles: u64,
    /// Parts of scenes of kinds that are not drawn.
    parts_not_drawn: u64,
    refused_connections: u64,
    connections: u64,
    unsent_messages: u64,
    version: &'static str,
}

/// Serves what a source says until the person, or Enter, ends it.
pub(super) fn watch(source: &WatchSource, arguments: &Arguments) -> Result<(), VrError> {
    let feed: Box<dyn Feed> = match source {
        WatchSource::Address(address) => Box::new(FoxgloveClient::connect(address)?),
        WatchSource::Recording(path) => Box::new(Recorded::open(path)?),
    };
    let listening = listen(arguments.listen, "it shows what is watched", PageKind::Painting)?;
    let mut show = Show::new(feed);
    loop {
        let ended = match listening.inbox.recv_timeout(STEP) {
            Ok(inbound) => show.take(inbound),
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        show.go_on();
        if ended || listening.enter.try_recv().is_ok() || interruption::is_requested() {
            return show.end(&listening, &arguments.out);
        }
    }
}

/// The source, the scene that it has made, and what of it the page lacks.
struct Show {
    feed: Box<dyn Feed>,
    scene: Scene,
    client: Client,
    next_sequence: u64,
    /// Whether a page has come: a recording begins with it.
    begun: bool,
    paused: bool,
    place: Option<ServerMessage>,
    missing: Missing,
    shown: Option<Instant>,
}

/// What the page has not got yet; a slow one gets the latest of each.
#[derive(Default)]
struct Missing {
    things: BTreeSet<String>,
    frames: bool,
    picture: bool,
}

impl Show {
    fn new(feed: Box<dyn Feed>) -> Self {
        Self {
            feed,
            scene: Scene::default(),
            client: Client::default(),
            next_sequence: 0,
            begun: false,
            paused: false,
            place: None,
            missing: Missing::default(),
            shown: None,
        }
    }

    /// Takes what a connection says; whether that is the end.
    fn take(&mut self, inbound: Inbound) -> bool {
        match inbound {
            Inbound::Join { connection, key, outbox } => {
                self.client.join(connection, outbox);
                self.begun = true;
                let name = self.feed.name();
                let (next_sequence, paused) = (self.next_sequence, self.paused);
                self.client.say(&ServerMessage::Watching { protocol: PROTOCOL, key, next_sequence, name, paused });
                if let Some(place) = &self.place {
                    self.client.say(place);
                }
                self.missing = Missing { things: self.scene.keys().cloned().collect(), frames: true, picture: true };
            }
            Inbound::Events { connection, events } if self.client.is(connection) => {
                let ended = events.iter().any(|event| self.handle(event));
                self.client.say(&ServerMessage::Ack { next_sequence: self.next_sequence });
                return ended;
            }
            Inbound::Dropped { connection } if self.client.is(connection) => {
                self.client.say(&ServerMessage::Ack { next_sequence: self.next_sequence });
            }
            Inbound::Leave { connection } if self.client.is(connection) => self.client.leave(),
            // The words of a connection that has lost the lease.
            _ => {}
        }
        false
    }

    /// Does what a button says, each once and in order; whether that is the end.
    fn handle(&mut self, event: &Event) -> bool {
        if event.sequence() != self.next_sequence {
            return false;
        }
        self.next_sequence += 1;
        match event {
            Event::Command { command: Command::Pause { on }, .. } => self.paused = *on,
            Event::Command { command: Command::End, .. } => return true,
            // There is nothing to paint here.
            _ => {}
        }
        false
    }

    /// Takes what has come and shows it, unless the last picture is too new.
    fn go_on(&mut self) {
        if self.shown.is_some_and(|shown| shown.elapsed() < STEP) {
            return;
        }
        self.shown = Some(Instant::now());
        while let Some(heard) = self.feed.take(self.begun && !self.paused) {
            match heard {
                Heard::Message(message) => {
                    for change in self.scene.take(&message) {
                        self.changed(change);
                    }
                }
                Heard::Said(text) | Heard::Over(text) => self.say(text),
            }
        }
        if self.place.is_none() {
            self.find_place();
        }
        self.client.say(&ServerMessage::Playback { elapsed: self.feed.elapsed(), paused: self.paused });
        // A run goes on while the page holds it still; what has changed is shown afterwards.
        if self.client.is_there() && !self.paused {
            self.send();
        }
    }

    fn changed(&mut self, change: Change) {
        match change {
            Change::Entity(key) => {
                self.missing.things.insert(key);
            }
            Change::Frames => self.missing.frames = true,
            Change::Picture => self.missing.picture = true,
            Change::Text(text) => self.say(text),
        }
    }

    fn say(&mut self, text: String) {
        say!("{text}");
        self.client.say(&ServerMessage::Notice { notice: Notice::Text { text } });
    }

    /// Behind the camera, or else behind the first frame that moves.
    fn find_place(&mut self) {
        let camera = self.scene.frames().find(|(name, _)| *name == CAMERA);
        let Some((name, pose)) = camera.or_else(|| self.scene.frames().next()) else { return };
        let at = place(&pose, name == CAMERA, self.scene.bounds());
        let q = at.page_from_scene.rotation.coords;
        let message = ServerMessage::Place {
            position: at.page_from_scene.translation.vector.into(),
            rotation: [q.x, q.y, q.z, q.w],
            cradle: at.eyes.coords.into(),
            heading: at.heading,
        };
        self.client.say(&message);
        self.place = Some(message);
    }

    fn send(&mut self) {
        while let Some(key) = self.missing.things.pop_first() {
            if !self.client.send(Outgoing::Binary(self.scene.entity(&key))) {
                self.missing.things.insert(key);
                return;
            }
        }
        if std::mem::take(&mut self.missing.frames) {
            let pose = |(name, pose): (&str, nalgebra::Isometry3<f64>)| {
                let q = pose.rotation.coords;
                Frame { name: name.into(), position: pose.translation.vector.into(), rotation: [q.x, q.y, q.z, q.w] }
            };
            let frames = self.scene.frames().map(pose).collect();
            self.missing.frames = !self.client.say(&ServerMessage::Frames { frames });
        }
        if std::mem::take(&mut self.missing.picture) && !self.scene.picture().is_empty() {
            self.missing.picture = !self.client.send(Outgoing::Binary(self.scene.picture().to_vec()));
        }
    }

    /// Says goodbye and writes the report.
    fn end(mut self, listening: &Listening, folder: &Path) -> Result<(), VrError> {
        let counts = self.scene.counts();
        let source = self.feed.name();
        listening.close_inbox();
        save_figures(
            &WatchFigures {
                source: source.clone(),
                messages: counts.messages,
                malformed_messages: counts.malformed,
                messages_of_other_topics: counts.other_topics,
                entities: self.scene.keys().count() as u64,
                triangles: self.scene.triangles(),
                parts_not_drawn: counts.not_drawn,
                refused_connections: listening.counts.refused.load(Ordering::Relaxed),
                connections: self.client.connections,
                unsent_messages: self.client.unsent,
                version: env!("CARGO_PKG_VERSION"),
            },
            folder,
        )?;
        let lost = counts.malformed + counts.not_drawn;
        if lost > 0 {
            say!(
                "{source}: {} messages or parts of them could not be read, {} are of kinds that are not drawn",
                counts.malformed,
                counts.not_drawn
            );
        }
        let folder = folder.display().to_string();
        let notice = Notice::Ended { folder, left_out: 0.0, failed: None };
        self.client.say(&ServerMessage::Notice { notice });
        self.client.leave();
        listening.wait_until_told();
        if self.begun && counts.messages == 0 {
            return Err(VrError::NothingToWatch { from: source });
        }
        Ok(())
    }
}
