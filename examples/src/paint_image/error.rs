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
    /// It would need too much memory.
    #[error(
        "{path}: {width} x {height} pixels need about {need_gib:.1} GiB, more than {limit_gib} GiB: make it smaller (a spot of spray covers many \
         pixels) or raise --memory-gib"
    )]
    TooLarge {
        /// The file.
        path: String,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Estimate.
        need_gib: f64,
        /// What is allowed.
        limit_gib: f64,
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
