//! Why a motion could not be sprayed.

use std::path::{Path, PathBuf};

use crate::mesh_io::MeshError;
use crate::mission::MissionError;
use crate::mission_file::MissionFileError;
use crate::paint_set::PaintSetError;
use crate::report::ReportError;

/// Why a motion could not be sprayed.
#[derive(Debug, thiserror::Error)]
pub enum SprayError {
    /// The motion cannot be read, or makes no sense.
    #[error("{path}: {why}")]
    Motion {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        why: String,
    },
    /// The nozzle is on the wrong side of the surface.
    #[error(
        "{path}: {percent:.0} % of the paint leaves a nozzle that is inside or behind the surface: check --scale, --placed, or which way the faces look"
    )]
    Behind {
        /// The file.
        path: PathBuf,
        /// Share of the shots.
        percent: f64,
    },
    /// The paint.
    #[error(transparent)]
    Paint(#[from] PaintSetError),
    /// The mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The mesh cannot be placed as missions do.
    #[error(transparent)]
    Placed(#[from] MissionFileError),
    /// The surface, or the simulation on it.
    #[error(transparent)]
    Mission(#[from] MissionError),
    /// A device was asked for that this program was built without.
    #[error("--gpu: this program was built without it: build with --features gpu, or leave it out")]
    NoGpu,
    /// The report.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The folder for the results.
    #[error("{path}: cannot be created ({source}): choose another --out")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

impl SprayError {
    pub(super) fn motion(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Motion { path: path.to_owned(), why: why.to_string() }
    }
}
