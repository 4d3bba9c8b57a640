//! Pictures to sprays: paints one, compares painters, trains the network.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use paint_net::procedural::Texture;
use paint_net::thesis::{Objective, Shape};
use paint_net::train::{ThesisSettings, TrainSettings};
use paint_net::{Image, Limits, Route, SprayKernel};
use paintcopter_examples::paint_image::{
    Choice, Glazes, Job, Lesson, Pictures, ThesisLesson, compare, equal_sprays, learn, learn_thesis, pictures_in,
    print_equal_sprays, read_ink, read_picture, table,
};
use paintcopter_examples::progress::Stage;

type AnyError = Box<dyn std::error::Error>;

/// Decides what to spray so that the wall comes to look like a picture. Dark is paint, white is bare wall.
#[derive(Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    after_help = "Example:\n  paint-image --image photo.png --painter feedback --out out/photo\n  paint-image compare pictures/\n  paint-image train --preset painter --seed 1 --threads 2 --out out/training"
)]
struct Arguments {
    #[command(subcommand)]
    job: Option<Command>,
    /// Picture to paint, PNG or JPEG of any size and depth
    #[arg(long, value_name = "FILE", required = true)]
    image: Option<PathBuf>,
    /// Who decides the sprays
    #[arg(long, default_value = "feedback")]
    painter: PainterName,
    /// Paint in colour with these glazes; the painter is then the one of colours
    #[arg(long)]
    palette: Option<PaletteName>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/paint-image")]
    out: PathBuf,
    #[command(flatten)]
    nozzle: Nozzle,
}

#[derive(Args, Clone)]
struct Nozzle {
    /// Standard deviation of a spray, pixels
    #[arg(long, default_value_t = 2.0)]
    sigma: f64,
    /// Where a spray ends, in standard deviations
    #[arg(long, default_value_t = 2.0)]
    cut: f64,
    /// Distance between sprays along a row, pixels
    #[arg(long, default_value_t = 2)]
    along: usize,
    /// Distance between rows of sprays, pixels
    #[arg(long, default_value_t = 2)]
    row_spacing: usize,
    /// Smallest spray worth opening the valve for
    #[arg(long, default_value_t = 0.0)]
    min_volume: f64,
    /// Largest number of sprays [default: no limit]
    #[arg(long)]
    max_sprays: Option<usize>,
    /// Largest change of volume from one place of the path to the next [default: any]
    #[arg(long)]
    largest_change: Option<f64>,
    /// Path for which that holds: row by row, or along what is alike
    #[arg(long, default_value = "rows")]
    route: RouteName,
    /// Paint in layers by intensity, the base coat first
    #[arg(long)]
    layers: bool,
    /// Looks of the network at its canvas
    #[arg(long, default_value_t = 6)]
    passes: usize,
    /// Worker threads
    #[arg(long, default_value_t = 1)]
    threads: usize,
}

#[derive(Subcommand)]
enum Command {
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
    /// Compares a trained thesis' network with other painters at its number of sprays
    EqualSprays {
        /// Weights: thesis.safetensors of a training with --preset thesis-paint
        #[arg(long, value_name = "FILE")]
        weights: PathBuf,
        /// Folder or picture [default: five built-in textures of 128 x 128 pixels]
        pictures: Option<PathBuf>,
    },
    /// Trains a network: the feedback painter's, or the thesis' on digits or on procedural patches
    Train(Training),
}

#[derive(Args, Clone)]
struct Training {
    /// What to train
    #[arg(long, default_value = "painter")]
    preset: Preset,
    /// Folder with the pictures of MNIST, or the file; for thesis-mnist
    #[arg(long, value_name = "PATH", required_if_eq("preset", "thesis-mnist"))]
    data: Option<PathBuf>,
    /// Seed of the first weights and of all pictures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Steps [default: the preset's]
    #[arg(long)]
    steps: Option<usize>,
    /// Stop after this step; the schedule stays that of all steps [default: go on to the end]
    #[arg(long)]
    until: Option<usize>,
    /// Pictures per step [default: the preset's]
    #[arg(long)]
    batch: Option<usize>,
    /// First learning rate [default: the preset's]
    #[arg(long)]
    rate: Option<f64>,
    /// Last learning rate, for the thesis' presets [default: the thesis']
    #[arg(long)]
    last_rate: Option<f64>,
    /// Train the thesis' network as its algorithm is printed: the decision to paint on does not scale the volume
    #[arg(long)]
    as_printed: bool,
    /// Weight of the divergence of the latent code, for the thesis' presets; less pays for more detail [default: the thesis']
    #[arg(long)]
    latent_weight: Option<f64>,
    /// Worker threads; the weights do not depend on it
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Checkpoint to go on from
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Folder for the weights, the checkpoint, the curve and the film
    #[arg(long, value_name = "DIR", default_value = "out/training")]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Preset {
    Painter,
    ThesisMnist,
    ThesisPaint,
}

#[derive(Clone, Copy, ValueEnum)]
enum PainterName {
    Feedback,
    Coats,
    Deconvolution,
    Pursuit,
    Splats,
}

#[derive(Clone, Copy, ValueEnum)]
enum PaletteName {
    Cmy,
    Cmyk,
    Six,
}

#[derive(Clone, Copy, ValueEnum)]
enum RouteName {
    Rows,
    Alike,
}

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("paint-image: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<(), AnyError> {
    match arguments.job {
        None => {
            // The command line requires it.
            let image = arguments.image.unwrap_or_default();
            let job = job(arguments.painter, &arguments.nozzle)?;
            match arguments.palette {
                None => paint(&image, &job, &arguments.out),
                Some(palette) => paint_colours(&image, &job, palette, &arguments.out),
            }
        }
        Some(Command::Compare { pictures, runs, out, nozzle }) => {
            let pictures = pictures_or_textures(pictures)?;
            create(&out)?;
            print!("{}", table(&compare(&job(PainterName::Feedback, &nozzle)?, &pictures, runs, &out)?));
            Ok(())
        }
        Some(Command::EqualSprays { weights, pictures }) => {
            print!("{}", print_equal_sprays(&equal_sprays(&weights, &pictures_or_textures(pictures)?)?));
            Ok(())
        }
        Some(Command::Train(training)) => train(training),
    }
}

fn pictures_or_textures(pictures: Option<PathBuf>) -> Result<Vec<Image>, AnyError> {
    Ok(match pictures {
        Some(path) => pictures_in(&path)?.iter().map(|p| read_ink(p)).collect::<Result<_, _>>()?,
        None => Texture::ALL.map(|t| t.image(1000, 128)).to_vec(),
    })
}

fn train(training: Training) -> Result<(), AnyError> {
    let Training { preset, data, seed, steps, until, batch, rate, last_rate, as_printed, latent_weight, .. } = training;
    let Training { threads, resume, out, .. } = training;
    create(&out)?;
    let (shape, pictures) = match preset {
        Preset::Painter => {
            let preset = TrainSettings::default();
            let settings = TrainSettings {
                seed,
                threads,
                steps: steps.unwrap_or(preset.steps),
                batch: batch.unwrap_or(preset.batch),
                learning_rate: rate.unwrap_or(preset.learning_rate),
                ..preset
            };
            learn(&Lesson { settings, resume, until, save_every: 500 }, &out)?;
            println!("{}", out.join("painter.safetensors").display());
            return Ok(());
        }
        // The command line requires the data.
        Preset::ThesisMnist => (Shape::MNIST, Pictures::Digits(data.unwrap_or_default())),
        Preset::ThesisPaint => (Shape::PAINT, Pictures::Patches),
    };
    let preset = ThesisSettings::default();
    let settings = ThesisSettings {
        seed,
        shape,
        threads,
        steps: steps.unwrap_or(preset.steps),
        batch: batch.unwrap_or(preset.batch),
        learning_rate: rate.unwrap_or(preset.learning_rate),
        last_learning_rate: last_rate.unwrap_or(preset.last_learning_rate),
        objective: Objective {
            gated: !as_printed,
            latent: latent_weight.unwrap_or(preset.objective.latent),
            ..preset.objective
        },
        ..preset
    };
    learn_thesis(&ThesisLesson { settings, pictures, resume, until, save_every: 100 }, &out)?;
    println!("{}", out.join("thesis.safetensors").display());
    Ok(())
}

fn job(painter: PainterName, nozzle: &Nozzle) -> Result<Job, AnyError> {
    let painter = match painter {
        PainterName::Feedback => Choice::Feedback,
        PainterName::Coats => Choice::Coats,
        PainterName::Deconvolution => Choice::Deconvolution,
        PainterName::Pursuit => Choice::Pursuit,
        PainterName::Splats => Choice::Splats,
    };
    let limits = Limits {
        along: nozzle.along,
        row_spacing: nozzle.row_spacing,
        min_volume: nozzle.min_volume,
        max_sprays: nozzle.max_sprays,
        ..Limits::default()
    };
    let kernel = SprayKernel::new(nozzle.sigma, nozzle.cut)?;
    Ok(Job {
        painter,
        passes: nozzle.passes,
        kernel,
        limits,
        largest_change: nozzle.largest_change,
        route: match nozzle.route {
            RouteName::Rows => Route::Rows,
            RouteName::Alike => Route::Alike,
        },
        layers: nozzle.layers,
        threads: nozzle.threads,
    })
}

fn paint(image: &Path, job: &Job, out: &Path) -> Result<(), AnyError> {
    let wanted = read_ink(image)?;
    create(out)?;
    let stage = Stage::start("paint");
    let (painting, figures) = job.paint(&wanted, &mut |share| stage.share(share))?;
    stage.done(&format!("{} sprays, {:.2} dB, {:.1} ms", figures.sprays, figures.psnr_db, figures.cpu_ms));
    job.save(out, &wanted, &painting, &figures)?;
    println!("{}", out.join("report.json").display());
    Ok(())
}

fn paint_colours(image: &Path, job: &Job, palette: PaletteName, out: &Path) -> Result<(), AnyError> {
    let glazes = match palette {
        PaletteName::Cmy => Glazes::Cmy,
        PaletteName::Cmyk => Glazes::Cmyk,
        PaletteName::Six => Glazes::Six,
    };
    if job.layers || job.largest_change.is_some() {
        return Err("--layers and --largest-change are for one paint: leave them out, or --palette".into());
    }
    let (wanted, palette) = (read_picture(image)?, glazes.palette()?);
    create(out)?;
    let stage = Stage::start("paint");
    let (painting, figures) = job.paint_colours(&wanted, &palette, &mut |share| stage.share(share))?;
    stage
        .done(&format!("{} sprays, CIEDE2000 {:.2}, {:.1} ms", figures.sprays, figures.ciede2000_mean, figures.cpu_ms));
    job.save_colours(out, &wanted, &palette, &painting, &figures)?;
    println!("{}", out.join("report.json").display());
    Ok(())
}

fn create(folder: &Path) -> Result<(), AnyError> {
    Ok(std::fs::create_dir_all(folder)
        .map_err(|e| format!("{}: cannot be created ({e}): choose another --out", folder.display()))?)
}
