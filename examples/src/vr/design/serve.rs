//! The program as a server of a design.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use super::design_error::DesignError;
use super::estimator::{Found, Job};
use super::figures::{AnswerTimes, DesignFigures};
use super::message::{PICTURE, PROTOCOL, Reply, with_head};
use super::session::{DesignSession, Handled};
use super::worker::Worker;
use crate::report::save_figures;
use crate::vr::arguments::Arguments;
use crate::vr::client::Client;
use crate::vr::connection::{Inbound, Outgoing};
use crate::vr::error::VrError;
use crate::vr::listener::{Listening, listen};
use crate::vr::page_kind::PageKind;
use crate::{interruption, run_folder, say};

/// How long the session waits for messages before it looks whether something was found.
const WAIT: Duration = Duration::from_millis(10);

/// Serves a design until the person, or Enter, ends it.
pub(in crate::vr) fn design(arguments: &Arguments) -> Result<(), VrError> {
    let mission = arguments.mission();
    // Before anybody opens a page: a file that cannot be read, or placed.
    let name = mission.read_surface()?.0;
    let session = DesignSession::new(mission, &arguments.out).map_err(|error| VrError::Design(error.to_string()))?;
    let listening = listen(arguments.listen, "it is where the mission is designed", PageKind::Design)?;
    let mut host = Host::new(session, name, &arguments.out);
    host.estimate();
    loop {
        let ended = match listening.inbox.recv_timeout(WAIT) {
            Ok(inbound) => host.take(inbound),
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        while let Ok(found) = host.worker.found.try_recv() {
            host.tell(found);
        }
        if ended || listening.enter.try_recv().is_ok() || interruption::is_requested() {
            return host.end(&listening, &arguments.out);
        }
    }
}

/// The session, its page, and what the page was told.
struct Host {
    session: DesignSession,
    worker: Worker,
    client: Client,
    folder: String,
    figures: DesignFigures,
    times: AnswerTimes,
    /// Surface and estimate as a page that comes now takes them.
    surface: Option<Vec<u8>>,
    estimate: Option<Vec<u8>>,
}

impl Host {
    fn new(session: DesignSession, surface: String, folder: &Path) -> Self {
        let figures = DesignFigures { surface, version: env!("CARGO_PKG_VERSION"), ..DesignFigures::default() };
        Self {
            session,
            worker: Worker::start(),
            client: Client::default(),
            folder: folder.display().to_string(),
            figures,
            times: AnswerTimes::default(),
            surface: None,
            estimate: None,
        }
    }

    /// Takes what a connection says; whether that is the end.
    fn take(&mut self, inbound: Inbound) -> bool {
        let handled = match inbound {
            Inbound::Join { connection, key, outbox } => {
                self.client.join(connection, outbox);
                self.welcome(key);
                return false;
            }
            Inbound::Leave { connection } if self.client.is(connection) => {
                self.client.leave();
                return false;
            }
            Inbound::Text { connection, text } if self.client.is(connection) => self.session.handle(&text),
            Inbound::File { connection, bytes } if self.client.is(connection) => self.session.handle_picture(&bytes),
            // The words of a connection that has lost the lease.
            _ => return false,
        };
        match handled {
            Ok(Handled::Changed) => {
                self.figures.changes += 1;
                self.times.ask(self.session.number());
                self.estimate();
            }
            Ok(Handled::Written(path)) => {
                self.figures.missions += 1;
                say!("{} is written", path.display());
                self.say(&Reply::Written { mission: path.display().to_string() });
            }
            Ok(Handled::Ended) => return true,
            Err(error) => self.refuse(&error),
        }
        self.say(&Reply::State(self.session.state()));
        false
    }

    fn refuse(&mut self, error: &DesignError) {
        self.figures.refused_changes += 1;
        self.say(&Reply::Error { text: error.to_string() });
    }

    /// Estimates the design as it is now.
    fn estimate(&mut self) {
        self.worker.estimate(Job { number: self.session.number(), mission: self.session.mission() });
    }

    /// Tells a page that has come all that it needs.
    fn welcome(&mut self, key: String) {
        self.say(&Reply::Hello {
            protocol: PROTOCOL,
            key,
            name: self.figures.surface.clone(),
            folder: self.folder.clone(),
            palettes: DesignSession::palettes(),
            walls: DesignSession::walls(),
        });
        if let Some(bytes) = self.session.picture().and_then(|picture| std::fs::read(&picture.path).ok()) {
            self.client.send(Outgoing::Binary(with_head(PICTURE, &(), &bytes)));
        }
        for bytes in [&self.surface, &self.estimate].into_iter().flatten() {
            self.client.send(Outgoing::Binary(bytes.clone()));
        }
        self.say(&Reply::State(self.session.state()));
    }

    /// Tells the page what was found.
    fn tell(&mut self, found: Found) {
        match found {
            Found::Surface { bytes, shown } => {
                self.session.show(shown);
                self.client.send(Outgoing::Binary(bytes.clone()));
                self.surface = Some(bytes);
                self.estimate = None;
                self.say(&Reply::State(self.session.state()));
            }
            Found::Known { mission } => self.session.accept_parts(&mission),
            Found::Estimate { number, own, bytes } => {
                self.times.answer(number);
                *(if own { &mut self.figures.own_estimates } else { &mut self.figures.coarse_estimates }) += 1;
                self.client.send(Outgoing::Binary(bytes.clone()));
                self.estimate = Some(bytes);
            }
            Found::NoSurface { text } => {
                self.say(&Reply::Error { text });
                if self.session.take_back_parts() {
                    self.estimate();
                }
                self.say(&Reply::State(self.session.state()));
            }
            Found::Failed { text } => {
                self.say(&Reply::Error { text });
                self.say(&Reply::State(self.session.state()));
            }
        }
    }

    fn say(&mut self, reply: &Reply) {
        // These types have no maps with keys that are no text, the only thing that JSON cannot say.
        if let Ok(text) = serde_json::to_string(reply) {
            self.client.send(Outgoing::Text(text));
        }
    }

    /// Says goodbye and writes the report. Missions are the person's own: only the report belongs to the run.
    fn end(mut self, listening: &Listening, folder: &Path) -> Result<(), VrError> {
        listening.close_inbox();
        run_folder::begin(folder, "vr").map_err(VrError::unwritable(folder))?;
        let [median, longest] = self.times.median_and_longest();
        let figures = DesignFigures {
            first_estimate_s_median: median,
            first_estimate_s_max: longest,
            refused_connections: listening.counts.refused.load(Ordering::Relaxed),
            connections: self.client.connections,
            unsent_messages: self.client.unsent,
            ..std::mem::take(&mut self.figures)
        };
        save_figures(&figures, folder)?;
        self.say(&Reply::Ended { folder: folder.display().to_string() });
        self.client.leave();
        listening.wait_until_told();
        Ok(())
    }
}
