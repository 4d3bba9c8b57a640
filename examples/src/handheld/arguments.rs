//! The command line of `handheld`.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};

use crate::mesh_frame::MeshScale;
use crate::worker_threads;

/// Paints an object with a nozzle on a handheld gantry: a person sweeps it past, the program decides where the nozzle slides and when it
/// sprays. Without a mesh: a cube of 60 mm on its corner, with a circle of 34 mm on each upper face.
#[derive(Debug, Clone, Parser)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
#[command(
    version,
    after_help = "Examples:\n  handheld\n  handheld --mesh bust.obj --scale 0.001 --target face.png --texel 0.002\n  handheld --evaluate"
)]
pub struct Arguments {
    /// Object, OBJ, glTF, PLY, STL or OFF, z up
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Wanted paint on the atlas of the mesh: black is a full coat, white is bare; as many pixels as the atlas has texels (a first run
    /// without one writes atlas.png to paint on, and ends)
    #[arg(long, value_name = "PNG", requires = "mesh")]
    pub target: Option<PathBuf>,
    /// Metres per unit of the mesh file, or m, cm, mm, ft, in, or fit (the longest side becomes 3 m) [default: what the file says, else what its
    /// size tells]
    #[arg(long, value_name = "METRES|UNIT|fit")]
    pub scale: Option<MeshScale>,
    /// Side of a texel on the surface, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.001)]
    pub texel: f64,
    /// Flow of the nozzle, cubic metres per second
    #[arg(long, value_name = "M3_PER_S", default_value_t = 0.5e-9)]
    pub flow: f64,
    /// Distance from the nozzle to the object that the person keeps, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.06)]
    pub stand_off: f64,
    /// Punishment of paint above the target
    #[arg(long, default_value_t = 3.0)]
    pub punishment: f64,
    /// Thickness of a full coat, metres
    #[arg(long, value_name = "METRES", default_value_t = 20e-6)]
    pub coat: f64,
    /// Motion of the robot: recorded poses (MCAP, TUM or EuRoC text; spray along x, slide along z), or `synthetic` sweeps
    #[arg(long, value_name = "FILE|synthetic", default_value = "synthetic")]
    pub motion: String,
    /// Metres per unit of the recorded motion
    #[arg(long, default_value_t = 1.0)]
    pub motion_scale: f64,
    /// Axes of the recorded motion
    #[arg(long, value_enum, default_value_t = MotionAxes::Robot)]
    pub motion_axes: MotionAxes,
    /// Move the recorded motion so that its middle is before the largest side of the target
    #[arg(long)]
    pub place_motion: bool,
    /// Seconds before each side of the target [default: what the paint needs]
    #[arg(long, value_name = "SECONDS")]
    pub seconds: Option<f64>,
    /// Speeds of the nozzle to choose from at each decision, odd
    #[arg(long, default_value_t = 3)]
    pub directions: usize,
    /// Decisions of 0.1 s to look ahead
    #[arg(long, default_value_t = 7)]
    pub horizon: usize,
    /// Beginnings kept by the beam search that simulates candidates; 0 takes the graph's best path
    #[arg(long, default_value_t = 0)]
    pub beam: usize,
    /// Standard deviation of a measured coordinate of the robot's pose, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.002)]
    pub pose_noise: f64,
    /// The camera alone: no inertial sensor helps it
    #[arg(long)]
    pub no_inertial: bool,
    /// How far the object stands from where its model says, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    pub registration_error: f64,
    /// Correct the object's place by distances measured while painting
    #[arg(long)]
    pub correct_registration: bool,
    /// The density and flux of the paper as they are printed
    #[arg(long)]
    pub paper_literal: bool,
    /// Print the figures of the planner: 32 scenarios of each of 10 seeds, ranks among all 2187 paths, times
    #[arg(long)]
    pub evaluate: bool,
    /// Scenarios of each seed
    #[arg(long, default_value_t = 32)]
    pub scenarios: usize,
    /// Seeds of the scenarios
    #[arg(long, default_value_t = 10)]
    pub seeds: u64,
    /// Compute the density and cast the droplets of path simulation on a GPU (needs the feature `gpu`)
    #[arg(long)]
    pub gpu: bool,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub threads: Option<usize>,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/handheld")]
    pub out: PathBuf,
}

/// Which way the axes of recorded poses point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MotionAxes {
    /// The spray along x, the slide along z
    Robot,
    /// A camera that looks along z, with y downwards
    Camera,
}
