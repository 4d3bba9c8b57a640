//! Painting by hand in a headset or a browser tab, while the robot follows (VR paper).
//!
//! One process simulates the paint that the person sees, plans and flies what the person paints, and simulates the paint of the robot.
//! [`Session`] is all of that without a network, a function of the events that come in; a server hands it those of the page, a replay
//! those of a recording.

mod arguments;
mod canvas;
mod client;
mod client_lease;
mod connection;
mod counters;
mod design;
mod error;
mod event;
mod experiment;
mod figures;
mod hand;
mod http_server;
mod latency;
mod layers;
mod listener;
mod message;
mod mission_export;
mod output;
mod page_kind;
mod palette;
mod protocol;
mod recording;
mod run;
mod run_up;
mod serve;
mod session;
mod settings;
mod simulated_vehicle;
mod watch;
mod web_files;
mod world;

pub use arguments::Arguments;
pub use error::VrError;
pub use event::{Command, Event};
pub use run::run;
pub use session::Session;
pub use settings::{Timing, VrSettings};
pub use world::VrWorld;
