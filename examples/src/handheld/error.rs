//! Why there is no painting.

use std::path::{Path, PathBuf};

use crate::pictures::PictureError;
use crate::report::ReportError;

/// Why `handheld` gives up; every variant names the input and the way out.
#[derive(Debug, thiserror::Error)]
pub enum HandheldError {
    /// The mesh file is not one.
    #[error(transparent)]
    Mesh(#[from] crate::mesh_io::MeshError),
    /// The mesh cannot be laid out.
    #[error("the mesh cannot be laid out: {0}")]
    Atlas(#[from] uv_param::Error),
    /// The simulator refuses.
    #[error(transparent)]
    Simulation(#[from] paint_sim::Error),
    /// The planner refuses.
    #[error(transparent)]
    Planner(#[from] paint_planner::Error),
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
    /// There is nothing to paint yet.
    #[error(
        "no target: paint black on {}, the atlas of this mesh ({width} x {height} texels), what shall be painted, and give it as --target with the same \
         --mesh and --texel", atlas.display()
    )]
    NoTarget {
        /// The atlas that was written.
        atlas: PathBuf,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The target is no picture of the atlas.
    #[error(
        "{}: {found_w} x {found_h} pixels, but the atlas of this mesh has {wanted_w} x {wanted_h} texels: paint on the \
         atlas.png that this run wrote, or choose another --texel", path.display()
    )]
    TargetSize {
        /// The picture.
        path: PathBuf,
        /// Columns of the picture.
        found_w: usize,
        /// Rows of the picture.
        found_h: usize,
        /// Columns of the atlas.
        wanted_w: usize,
        /// Rows of the atlas.
        wanted_h: usize,
    },
    /// Nothing of the target came within the nozzle's reach.
    #[error(
        "no spray within {reach_m} m of the nozzle meets the target in the {seconds:.0} s of the motion, which comes no nearer to it than \
         {nearest_m:.3} m: move the robot closer, point its x axis at the target, check the units of mesh and motion (--motion-scale), the \
         axes of the motion (--motion-axes) and its place (--place-motion)"
    )]
    Unreachable {
        /// Shortest distance of the robot from the target, m.
        nearest_m: f64,
        /// How far paint flies, m.
        reach_m: f64,
        /// Duration of the motion, s.
        seconds: f64,
    },
    /// Less than half of the target was painted.
    #[error(
        "only {:.0} % of the wanted paint is on the target: {advice}; the results are written all the same", 100.0 * share
    )]
    Unfinished {
        /// Share of the target's mass.
        share: f64,
        /// What to do.
        advice: String,
    },
    /// A file cannot be read.
    #[error("{}: cannot be read ({why})", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// A recorded motion moves no robot.
    #[error("--motion {}: {why}", path.display())]
    Motion {
        /// The file.
        path: PathBuf,
        /// What is wrong, and the way out.
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
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] crate::recording::RecordingError),
    /// A picture cannot be drawn.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A figure is not finite.
    #[error(transparent)]
    Report(#[from] ReportError),
}

impl HandheldError {
    pub(super) fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unreadable { path: path.into(), why: why.to_string() }
    }

    pub(super) fn unwritable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Unwritable { path: path.into(), why: why.to_string() }
    }
}
