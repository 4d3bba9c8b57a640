//! Why a flight did not come about.

use std::path::PathBuf;

use crate::autopilot::AutopilotError;
use crate::mission::MissionError;
use crate::report::ReportError;

/// Why a flight did not come about, or its result is not usable.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The autopilot.
    #[error(transparent)]
    Autopilot(#[from] AutopilotError),
    /// The mission.
    #[error(transparent)]
    Mission(#[from] MissionError),
    /// The simulation.
    #[error("simulation: {0}")]
    Simulation(#[from] paint_sim::Error),
    /// The report.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A file.
    #[error("{path}: {source}")]
    File {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An option of the built-in simulation alone.
    #[error("{option} is for the built-in simulation of `paintcopter`: leave it out with --autopilot")]
    BuiltInOnly {
        /// The option.
        option: &'static str,
    },
    /// An option of several flights.
    #[error(
        "{option} is for a whole mission on PX4: leave it out with --seconds and with --autopilot udp: and serial:"
    )]
    WholeMissionOnly {
        /// The option.
        option: &'static str,
    },
    /// A flight that is not begun.
    #[error("interrupted before it took off")]
    Interrupted,
    /// There is nothing left to fly with.
    #[error("flight {flight} has broken the vehicle")]
    Broken {
        /// The flight, from 1 on.
        flight: usize,
    },
    /// An option that says nothing about a vehicle that is not simulated.
    #[error("{option} is for the simulated vehicle on PX4: leave it out with --autopilot udp: and serial: ({why})")]
    SimulationOnly {
        /// The option.
        option: &'static str,
        /// Why.
        why: &'static str,
    },
    /// The mission has nothing to fly.
    #[error("the mission has no flight: nothing of it is within reach")]
    NothingToFly,
    /// The flight was given up; what there is of it is in the folder.
    #[error("the flight was not finished: {reason}; what there is of it is in {folder}")]
    Unfinished {
        /// Why.
        reason: String,
        /// The folder of the results.
        folder: PathBuf,
    },
}
