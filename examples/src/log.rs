//! What the libraries say of themselves, on stderr, where somebody asks for it.

use std::io::IsTerminal as _;

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::FmtSpan;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// The libraries, and this package.
const SPEAKERS: [&str; 8] =
    ["tsdf_hash", "vio_ekf", "ptu_kinematics", "paint_planner", "paint_sim", "uv_param", "paint_net", "paintcopter"];

/// Subscribes to spans and events: as detailed as `verbose` says (0: not at all), or as `RUST_LOG` says, which comes first.
pub(crate) fn subscribe(verbose: u8) {
    let level = match verbose {
        0 => LevelFilter::OFF,
        1 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    let targets = match std::env::var("RUST_LOG").map(|text| text.parse::<Targets>()) {
        Ok(Ok(targets)) => targets,
        Ok(Err(error)) => {
            eprintln!("warning: RUST_LOG is not used: {error}");
            return;
        }
        Err(_) if verbose == 0 => return,
        Err(_) => Targets::new().with_targets(SPEAKERS.map(|speaker| (speaker, level))),
    };
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
        .with_span_events(FmtSpan::CLOSE);
    // There is one already where a program has its own.
    let _ = tracing_subscriber::registry().with(lines).with(targets).try_init();
}
