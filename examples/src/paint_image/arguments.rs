//! What `paint-image` can be told.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use super::colour::Glazes;
use super::job::PainterKind;
use crate::worker_threads;

/// Decides what to spray so that the wall comes to look like a picture. Dark is paint, white is bare wall.
#[derive(Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    after_help = "Example:\n  paint-image --image photo.png --painter feedback --out out/photo\n  paint-image compare pictures/\n  paint-image train --preset painter --seed 1 --threads 2 --out out/training"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub(super) job: Option<Command>,
    /// Picture to paint, PNG or JPEG of any size and depth; or a folder of them, each with a folder of its own in the results
    #[arg(long, value_name = "PATH", required = true)]
    pub(super) image: Option<PathBuf>,
    /// Who decides the sprays [default: feedback]
    #[arg(long)]
    pub(super) painter: Option<PainterKind>,
    /// Paint in colour with these glazes; the painter is then the one of colours
    #[arg(long)]
    pub(super) palette: Option<Glazes>,
    /// Memory that painting may need by estimate, GiB
    #[arg(long, value_name = "GIB", default_value_t = 8.0)]
    pub(super) memory_gib: f64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/paint-image")]
    pub(super) out: PathBuf,
    #[command(flatten)]
    pub(super) nozzle: Nozzle,
}

#[derive(Args, Clone)]
pub(super) struct Nozzle {
    /// Standard deviation of a spray, pixels
    #[arg(long, default_value_t = 2.0)]
    pub(super) sigma: f64,
    /// Where a spray ends, in standard deviations
    #[arg(long, default_value_t = 2.0)]
    pub(super) cut: f64,
    /// Distance between sprays along a row, pixels
    #[arg(long, default_value_t = 2)]
    pub(super) spray_spacing: usize,
    /// Distance between rows of sprays, pixels
    #[arg(long, default_value_t = 2)]
    pub(super) row_spacing: usize,
    /// Smallest spray worth opening the valve for
    #[arg(long, default_value_t = 0.0)]
    pub(super) min_volume: f64,
    /// Largest number of sprays, 0 for none at all [default: no limit]
    #[arg(long)]
    pub(super) max_sprays: Option<usize>,
    /// Slew limit: largest change of volume from one place of the path to the next [default: any]
    #[arg(long)]
    pub(super) slew_limit: Option<f64>,
    /// Path for which that holds: row by row, or first where the picture is alike [default: boustrophedon]
    #[arg(long)]
    pub(super) scan_order: Option<ScanOrderName>,
    /// Paint in layers by intensity, the base coat first: one plan cut into layers, or with "=sequential" a plan for each layer
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "joint")]
    pub(super) layers: Option<SharingName>,
    /// Passes of the network over its canvas [default: 6]
    #[arg(long)]
    pub(super) passes: Option<usize>,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
    /// Weights of the thesis' network: thesis.safetensors of a training with --preset thesis-paint [default: those shipped]
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Option<PathBuf>,
}

#[derive(Subcommand)]
pub(super) enum Command {
    /// Paints every picture of a folder with every painter: one table, and the canvases side by side
    Compare {
        /// Folder or picture [default: five built-in textures of 128 x 128 pixels]
        pictures: Option<PathBuf>,
        /// Runs of which the median time is taken
        #[arg(long, default_value_t = 3)]
        runs: usize,
        /// Folder for compare.md and compare.png
        #[arg(long, value_name = "DIR", default_value = "out/compare")]
        out: PathBuf,
        #[command(flatten)]
        nozzle: Nozzle,
    },
    /// Compares the thesis' network with other painters at its number of sprays
    EqualSprays {
        /// Weights: thesis.safetensors of a training with --preset thesis-paint [default: those shipped]
        #[arg(long, value_name = "FILE")]
        weights: Option<PathBuf>,
        /// Folder or picture [default: five built-in textures of 128 x 128 pixels]
        pictures: Option<PathBuf>,
    },
    /// Trains a network: the feedback painter's, or the thesis' on digits or on patches
    Train(Training),
}

#[derive(Args, Clone)]
pub(super) struct Training {
    /// What to train
    #[arg(long, default_value = "painter")]
    pub(super) preset: Preset,
    /// For thesis-mnist: folder with the pictures of MNIST, or the file. For thesis-paint: folder of photographs [default: procedural scenes]
    #[arg(long, value_name = "PATH", required_if_eq("preset", "thesis-mnist"))]
    pub(super) data: Option<PathBuf>,
    /// Seed of the first weights and of all pictures
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Steps [default: the preset's]
    #[arg(long)]
    pub(super) steps: Option<usize>,
    /// Stop after this step; the schedule stays that of all steps [default: go on to the end]
    #[arg(long)]
    pub(super) until: Option<usize>,
    /// Pictures per step [default: the preset's]
    #[arg(long)]
    pub(super) batch: Option<usize>,
    /// First learning rate [default: the preset's]
    #[arg(long)]
    pub(super) rate: Option<f64>,
    /// Last learning rate, for the thesis' presets [default: the thesis']
    #[arg(long)]
    pub(super) last_rate: Option<f64>,
    /// Train the thesis' network as its algorithm is printed: the decision to paint on does not scale the volume
    #[arg(long)]
    pub(super) as_printed: bool,
    /// Weight of the divergence of the latent code, for the thesis' presets; less pays for more detail [default: the thesis']
    #[arg(long)]
    pub(super) latent_weight: Option<f64>,
    /// Weight of the change of volume from one spray to the next, for the thesis' presets [default: 0.1]
    #[arg(long)]
    pub(super) variation_weight: Option<f64>,
    /// Train the thesis' network without its stop, as for its figure 8.4: it takes all of its steps, and nothing scales the volume
    #[arg(long, conflicts_with = "as_printed")]
    pub(super) never_stops: bool,
    /// Worker threads [default: all cores]; the weights do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
    /// Checkpoint to go on from
    #[arg(long, value_name = "FILE")]
    pub(super) resume: Option<PathBuf>,
    /// Folder for the weights, the checkpoint, the curve and the rollout picture
    #[arg(long, value_name = "DIR", default_value = "out/training")]
    pub(super) out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum Preset {
    Painter,
    ThesisMnist,
    ThesisPaint,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum ScanOrderName {
    Boustrophedon,
    ContextBased,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum SharingName {
    Joint,
    Sequential,
}
