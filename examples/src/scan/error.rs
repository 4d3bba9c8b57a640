//! Why a sequence cannot be read, or gave no map.

use std::path::Path;

/// What is wrong with a recorded sequence.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// The folder follows none of the layouts.
    #[error(
        "{folder}: no sequence found: expected frame-*.depth.png (7-Scenes), depth.txt (TUM), depth/ with pose.txt \
         (ICL-NUIM) or depth/ with trajectory.log (Redwood), or an MCAP file"
    )]
    UnknownLayout {
        /// The folder.
        folder: String,
    },
    /// A file cannot be read.
    #[error("{path}: cannot be read ({why})")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system or the decoder said.
        why: String,
    },
    /// A text file does not say what it should.
    #[error("{path}, line {line}: {why}")]
    Malformed {
        /// The file.
        path: String,
        /// Counted from 1; 0 for the file as a whole.
        line: usize,
        /// What was expected, and found.
        why: String,
    },
}

impl SequenceError {
    pub(super) fn malformed(path: &Path, line: usize, why: impl Into<String>) -> Self {
        Self::Malformed { path: path.display().to_string(), line, why: why.into() }
    }

    pub(super) fn unreadable_image(image: &dyn std::fmt::Display, why: &dyn std::fmt::Display) -> Self {
        Self::Unreadable { path: image.to_string(), why: why.to_string() }
    }

    pub(super) fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unreadable { path: path.display().to_string(), why: why.to_string() }
    }
}

/// Why a run gave no map.
#[derive(Debug, thiserror::Error)]
pub enum ScanError {
    /// The sequence cannot be read.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// The map refused something.
    #[error(transparent)]
    Map(tsdf_hash::Error),
    /// The stored map cannot be used, or not written.
    #[error("{path}: {source}")]
    Stored {
        /// The file.
        path: String,
        /// What is wrong with it.
        source: tsdf_hash::Error,
    },
    /// The poses make no trajectory.
    #[error(transparent)]
    Trajectory(#[from] vio_ekf::Error),
    /// A picture cannot be rendered.
    #[error(transparent)]
    Render(#[from] paint_sim::Error),
    /// A picture cannot be saved.
    #[error(transparent)]
    Picture(#[from] crate::pictures::PictureError),
    /// A device was asked for that this program was built without.
    #[error("--device gpu: this program was built without it: build with --features gpu, or use --device cpu")]
    NoGpu,
    /// A frame is not what the camera takes.
    #[error("the depth image is {found} pixels, the camera's are {expected}: its camera is not known")]
    OtherSize {
        /// Width x height of this image.
        found: String,
        /// Width x height of the camera's images.
        expected: String,
    },
    /// No pose was recorded, and none is tracked.
    #[error("{0}")]
    NoPose(&'static str),
    /// Tracking did not find the camera.
    #[error("the camera is lost: {0}")]
    Lost(String),
    /// Shape and texture of a frame do not fix its pose.
    #[error("{0} of 6 directions of its pose are not fixed by shape or texture: not fused along a guess")]
    Degenerate(usize),
    /// Half of the work or less was done, or the result does not agree with itself.
    #[error("{0}")]
    Unusable(String),
    /// A recording of the run cannot be written.
    #[error("{path}: cannot be written ({why}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        why: String,
    },
    /// Viewers cannot connect.
    #[error("--live {address}: cannot be listened on ({why}): choose another address or port")]
    Listen {
        /// The address.
        address: std::net::SocketAddr,
        /// What the system said.
        why: String,
    },
    /// Messages cannot be described.
    #[error("the live view could not be opened: {0}")]
    Recording(String),
    /// A checkpoint cannot be used.
    #[error("{path}: {why}")]
    Checkpoint {
        /// The file.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// No frame could be fused.
    #[error("{folder}: none of the {frames} frames could be fused; the first: {first}")]
    NothingFused {
        /// The sequence.
        folder: String,
        /// Frames it lists.
        frames: usize,
        /// What was wrong with the first of them.
        first: String,
    },
}

impl From<tsdf_hash::Error> for ScanError {
    /// A frame that cannot be read a second time is what cannot be read the first time.
    fn from(error: tsdf_hash::Error) -> Self {
        let tsdf_hash::Error::FrameSource { frame, source } = error else { return Self::Map(error) };
        match source.downcast() {
            Ok(fault) => Self::Sequence(*fault),
            Err(source) => Self::Map(tsdf_hash::Error::FrameSource { frame, source }),
        }
    }
}
