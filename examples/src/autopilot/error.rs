//! What goes wrong between this robot and its autopilot.

use std::path::PathBuf;
use std::time::Duration;

/// Why there is no flight with this autopilot, or no longer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AutopilotError {
    /// The folder of PX4 lacks something.
    #[error(
        "{folder}: no PX4 for this robot ({missing} is missing): give the folder that holds px4, px4-alias.sh and etc/"
    )]
    Folder {
        /// The folder that was given.
        folder: PathBuf,
        /// What it lacks.
        missing: String,
    },
    /// A file for the run of PX4 could not be made, or it could not be started.
    #[error("{path}: {source}")]
    File {
        /// Which file or program.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A port is not to be had, or a link broke.
    #[error("{what}: {source}")]
    Socket {
        /// Which link.
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A serial port that is not to be had.
    #[error(
        "serial port {device} at {baud} baud: {source}: is it there, free, and yours to open (on Linux by the group dialout)?"
    )]
    Serial {
        /// Its name.
        device: PathBuf,
        /// Its rate, bit/s.
        baud: u32,
        /// What the system said.
        source: std::io::Error,
    },
    /// PX4 ended.
    #[error("PX4 ended ({status}); its log {log} says why")]
    Ended {
        /// How it ended.
        status: String,
        /// Its log.
        log: PathBuf,
    },
    /// Nothing came in time.
    #[error("{what} said nothing for {seconds} s: {hint}")]
    Silent {
        /// Who.
        what: String,
        /// How long was waited.
        seconds: f64,
        /// What to look at.
        hint: String,
    },
    /// Bytes come, but no heartbeat of an autopilot is among them.
    #[error(
        "{what} sends {bytes} bytes, but no heartbeat of an autopilot is in them: is it MAVLink, at this address and rate?"
    )]
    Nonsense {
        /// Which link.
        what: String,
        /// How many bytes have come.
        bytes: usize,
    },
    /// Another vehicle, or another maker's autopilot.
    #[error("the autopilot says it is {found}: what flies here is a multirotor on PX4, whose modes are known")]
    Airframe {
        /// What it says of itself.
        found: String,
    },
    /// It does not become ready, arm or change its mode.
    #[error("the autopilot does not {what} within {seconds} s ({state}); it last said: {said}")]
    Refused {
        /// What it was asked.
        what: &'static str,
        /// How long was waited.
        seconds: f64,
        /// Its state.
        state: String,
        /// Its last words.
        said: String,
    },
}

impl AutopilotError {
    /// Silence of a link.
    pub(crate) fn silent(what: &str, waited: Duration, hint: &str) -> Self {
        Self::Silent { what: what.to_owned(), seconds: waited.as_secs_f64(), hint: hint.to_owned() }
    }
}
