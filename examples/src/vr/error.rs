//! Why there is no session.

use std::path::{Path, PathBuf};

/// Why `vr` gives up; every variant names the input and the way out.
#[derive(Debug, thiserror::Error)]
pub enum VrError {
    /// The mesh cannot be read or placed.
    #[error(transparent)]
    Mesh(#[from] crate::mission_file::MissionFileError),
    /// The map cannot be read.
    #[error("{}: {source}", path.display())]
    Map {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: tsdf_hash::Error,
    },
    /// The surface cannot be painted.
    #[error("{name}: {source}")]
    Surface {
        /// The surface.
        name: String,
        /// What is wrong.
        source: crate::surface::SurfaceError,
    },
    /// More texels than a headset can hold.
    #[error(
        "the atlas would be {side} texels wide, at most {most} can be shown: choose a larger --texel or a smaller --scale"
    )]
    AtlasTooLarge {
        /// Its longer side.
        side: usize,
        /// What is possible.
        most: usize,
    },
    /// A number of the command line is out of range.
    #[error("{option} {value}: {must_be}")]
    Option {
        /// The option.
        option: &'static str,
        /// What was given.
        value: f64,
        /// What is accepted.
        must_be: &'static str,
    },
    /// A table of pigments cannot be used.
    #[error("{}: {why}; --pigments wants the folder that has the tables", path.display())]
    Pigments {
        /// The table.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// The simulator refuses.
    #[error(transparent)]
    Simulation(#[from] paint_sim::Error),
    /// The kinematics refuse.
    #[error(transparent)]
    Kinematics(#[from] ptu_kinematics::Error),
    /// The address cannot be listened on.
    #[error("{address}: cannot be listened on ({source}): choose another --listen")]
    Listen {
        /// The address.
        address: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// What shall be watched does not answer.
    #[error("{address}: {why}: is `scan --live {address}` running there?")]
    Watch {
        /// Host and port.
        address: String,
        /// What is wrong.
        why: String,
    },
    /// Nothing of what was watched could be shown.
    #[error(
        "{from}: said nothing that could be shown (scenes, frames, pictures and log lines of Foxglove's schemas are)"
    )]
    NothingToWatch {
        /// Address or file.
        from: String,
    },
    /// The robot did not follow the hand.
    #[error(
        "the robot never caught up: it was {lag:.1} m behind when the hand stopped, and flew on for {seconds:.0} s; paint slower, wait for it, \
         or choose a surface that it can stay before; the results are written all the same"
    )]
    NeverCaughtUp {
        /// Latency in distance at the last state, m.
        lag: f64,
        /// Time that the robot flew on, s.
        seconds: f64,
    },
    /// An option that belongs to another experiment.
    #[error(
        "--pigments: belongs to --experiment layers, and would be ignored here: leave it out, or choose that experiment"
    )]
    PigmentsUnused,
    /// The system gives no random numbers for a token.
    #[error("no random token from the operating system ({0}): only loopback can be served here")]
    Token(getrandom::Error),
    /// A recording is no session.
    #[error("{}: {why}", path.display())]
    Recording {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
    /// A replay came out otherwise than it was.
    #[error("{}: {different} of {plans} plans differ from the recorded ones: replay with the version that recorded it", path.display())]
    Different {
        /// The recording.
        path: PathBuf,
        /// Plans that differ or are missing.
        different: usize,
        /// Plans of the recording.
        plans: usize,
    },
    /// More than half of what was painted could not be planned.
    #[error("only {:.0} % of the painted segments could be flown: {advice}; the results are written all the same", 100.0 * share)]
    Unreachable {
        /// Share of the segments.
        share: f64,
        /// What to do.
        advice: &'static str,
    },
    /// The way of the simulated hand leads past the surface.
    #[error(
        "{name}: the simulated hand has met no surface: its way is 1.8 m wide and 0.9 m high (contour) or 1.35 by 1 m (area-fill); choose a larger --scale, or another --up"
    )]
    NothingPainted {
        /// The surface.
        name: String,
    },
    /// The results cannot be written.
    #[error("{}: cannot be written ({source}): choose another --out", path.display())]
    Unwritable {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A design cannot begin.
    #[error("{0}")]
    Design(String),
    /// The recording cannot be written.
    #[error(transparent)]
    Recorder(#[from] crate::recording::RecordingError),
    /// A picture cannot be drawn.
    #[error(transparent)]
    Picture(#[from] crate::pictures::PictureError),
    /// A figure is not finite.
    #[error(transparent)]
    Report(#[from] crate::report::ReportError),
    /// A comparison of pictures failed.
    #[error(transparent)]
    Compare(#[from] paint_net::Error),
}

impl VrError {
    pub(super) fn unwritable(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Unwritable { path: path.into(), source }
    }

    pub(super) fn recording(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Recording { path: path.into(), why: why.to_string() }
    }
}
