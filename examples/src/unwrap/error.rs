//! What can go wrong with an atlas.

use std::path::{Path, PathBuf};

/// Why `unwrap` gives up.
#[derive(Debug, thiserror::Error)]
pub enum UnwrapError {
    /// The mesh file is not one.
    #[error(transparent)]
    Mesh(#[from] crate::mesh_io::MeshError),
    /// A picture that the mesh file names cannot be read.
    #[error(transparent)]
    Material(#[from] crate::mesh_io::MaterialError),
    /// The region holds nothing, or cannot be read.
    #[error("{}: {source}", path.display())]
    Region {
        /// The mesh file.
        path: PathBuf,
        /// What is wrong.
        source: crate::region::RegionError,
    },
    /// The mesh cannot be laid out.
    #[error("{}: {source}", path.display())]
    Atlas {
        /// The mesh file.
        path: PathBuf,
        /// Why.
        source: uv_param::Error,
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
    /// The texture needs coordinates that the mesh does not have.
    #[error("{}: has no texture coordinates on all corners, so that --texture cannot be laid on it: export them, or leave the option out", .0.display())]
    NoCoordinates(PathBuf),
    /// A picture or a list of seams cannot be read.
    #[error("{}: cannot be read ({why})", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// The results cannot be written.
    #[error("{}: cannot be written ({why}): choose another --out", path.display())]
    Unwritable {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        why: String,
    },
    /// A figure is not finite.
    #[error(transparent)]
    Report(#[from] crate::report::ReportError),
    /// The atlas was written, but breaks what it promises.
    #[error(
        "{flips} faces are flipped and {overlaps} pairs overlap in the atlas that was written: do not use it, and report the mesh"
    )]
    Broken {
        /// Faces.
        flips: usize,
        /// Pairs.
        overlaps: usize,
    },
}

impl UnwrapError {
    pub(super) fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unreadable { path: path.into(), why: why.to_string() }
    }

    pub(super) fn unwritable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unwritable { path: path.into(), why: why.to_string() }
    }
}
