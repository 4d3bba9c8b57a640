//! A recorded sequence: which images, from where, through which camera.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use tsdf_hash::Intrinsics;

use super::layouts;

/// A sequence of depth images, with colour and poses where they were recorded.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// How the folder is laid out: `7-Scenes`, `TUM`, `ICL-NUIM` or `Redwood`.
    pub layout: &'static str,
    /// Camera of the depth images; colour images are taken as registered to it.
    pub intrinsics: Intrinsics,
    /// Units of the depth images per metre.
    pub depth_scale: f64,
    /// The frames, by rising stamps.
    pub frames: Vec<FrameFiles>,
}

/// One frame, not yet read.
#[derive(Debug, Clone)]
pub struct FrameFiles {
    /// Seconds.
    pub stamp: f64,
    /// 16-bit PNG.
    pub depth: PathBuf,
    /// PNG or JPEG.
    pub colour: Option<PathBuf>,
    /// Recorded pose of the camera: z forward, x right, y down.
    pub world_from_camera: Option<Isometry3<f64>>,
}

/// What is wrong with a recorded sequence.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// The folder follows none of the layouts.
    #[error(
        "{folder}: no sequence found: expected frame-*.depth.png (7-Scenes), depth.txt (TUM), depth/ with pose.txt \
         (ICL-NUIM) or depth/ with trajectory.log (Redwood)"
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

    pub(super) fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unreadable { path: path.display().to_string(), why: why.to_string() }
    }
}

impl Sequence {
    /// Recognises the layout of a folder and lists its frames.
    ///
    /// # Errors
    /// [`SequenceError`]; images themselves are read later, by [`Images::read`](super::Images::read).
    pub fn open(folder: &Path) -> Result<Self, SequenceError> {
        let sequence = if folder.join("depth.txt").is_file() {
            layouts::tum(folder)?
        } else if folder.join("trajectory.log").is_file() {
            layouts::redwood(folder)?
        } else if folder.join("pose.txt").is_file() && folder.join("depth").is_dir() {
            layouts::icl(folder)?
        } else if let Some(frames) = layouts::seven_scenes(folder)? {
            frames
        } else {
            return Err(SequenceError::UnknownLayout { folder: folder.display().to_string() });
        };
        if sequence.frames.is_empty() {
            return Err(SequenceError::malformed(folder, 0, "the sequence has no frame"));
        }
        Ok(sequence)
    }
}
