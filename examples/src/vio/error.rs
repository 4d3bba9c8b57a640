//! Why there is no usable trajectory, and files in and out with that error.

use std::path::Path;

use crate::pictures::PictureError;
use crate::report::ReportError;
use crate::whole_file;

/// Why there is no usable trajectory; every variant names the input and the way out.
#[derive(Debug, thiserror::Error)]
pub enum VioError {
    /// A file cannot be read.
    #[error("{path}: cannot be read ({why})")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system or the decoder said.
        why: String,
    },
    /// A file does not say what it should.
    #[error("{path}: {why}")]
    Malformed {
        /// The file.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// A file cannot be written.
    #[error("{path}: cannot be written ({why}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        why: String,
    },
    /// The recording is readable, but no odometry comes out of it.
    #[error("{recording}: {why}")]
    Unusable {
        /// Folder or file.
        recording: String,
        /// What is missing, and what to do.
        why: String,
    },
    /// The recording is readable, but its pictures cannot be used.
    #[error("{recording}: {why}")]
    Pictures {
        /// Folder or file.
        recording: String,
        /// What is wrong with them.
        why: String,
    },
    /// The library refused.
    #[error(transparent)]
    Library(#[from] vio_ekf::Error),
    /// A picture cannot be drawn or saved.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The report cannot be saved.
    #[error(transparent)]
    Report(#[from] ReportError),
}

impl VioError {
    pub(super) fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unreadable { path: path.display().to_string(), why: why.to_string() }
    }

    pub(super) fn malformed(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Malformed { path: path.display().to_string(), why: why.to_string() }
    }

    pub(super) fn unwritable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unwritable { path: path.display().to_string(), why: why.to_string() }
    }
}

/// The text of a file.
pub(super) fn read_text(path: &Path) -> Result<String, VioError> {
    std::fs::read_to_string(path).map_err(|error| VioError::unreadable(path, &error))
}

/// Writes a file.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), VioError> {
    whole_file::write(path, bytes).map_err(|error| VioError::unwritable(path, &error))
}

/// Makes a folder and those above it.
pub(super) fn make_folder(path: &Path) -> Result<(), VioError> {
    std::fs::create_dir_all(path).map_err(|error| VioError::unwritable(path, &error))
}
