//! What is wrong with painting a picture.

use paint_net::Error;

use crate::pictures::PictureError;
use crate::report::ReportError;

/// What is wrong with painting a picture.
#[derive(Debug, thiserror::Error)]
pub enum PaintImageError {
    /// The file is not a picture that can be painted.
    #[error("{path}: {why}; give a PNG or JPEG file")]
    Unreadable {
        /// The file.
        path: String,
        /// Why.
        why: String,
    },
    /// The painter refused.
    #[error("{0}")]
    Painter(#[from] Error),
    /// What was asked for does not go together.
    #[error("{0}")]
    Settings(String),
    /// A result could not be drawn or written.
    #[error("{0}")]
    Picture(#[from] PictureError),
    /// A file could not be written or read.
    #[error("{path}: {why}")]
    File {
        /// The file.
        path: String,
        /// What the system said.
        why: String,
    },
    /// A figure is not finite, or the figures cannot be written.
    #[error(transparent)]
    Report(#[from] ReportError),
}
