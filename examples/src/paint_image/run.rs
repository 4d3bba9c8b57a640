//! What the command line asks for, done.

use std::path::{Path, PathBuf};

use paint_net::painters::LayerPlanning;
use paint_net::path::ScanOrder;
use paint_net::procedural::Texture;
use paint_net::thesis::{Architecture, Objective};
use paint_net::train::{ThesisSettings, TrainSettings};
use paint_net::{Image, Limits, SprayKernel};

use super::arguments::{Arguments, Command, Nozzle, Preset, ScanOrderName, SharingName, Training};
use super::colour::{Glazes, paint_colours, read_picture, save_colours};
use super::compare::{compare, table};
use super::equal_sprays::{equal_sprays, print_equal_sprays, texture_picture};
use super::error::PaintImageError;
use super::files::{check_memory, pictures_in, read_network};
use super::ink::read_ink;
use super::job::{Job, PainterKind};
use super::training::{ThesisTrainingRun, TrainingImages, TrainingRun, train_painter, train_thesis};
use crate::progress::Stage;
use crate::result;
use crate::run_folder;
use crate::worker_threads::worker_threads;

/// Does what the command line asks for.
pub fn run(arguments: &Arguments) -> Result<(), PaintImageError> {
    match &arguments.job {
        None => {
            // The command line requires it.
            let image = arguments.image.clone().unwrap_or_default();
            let Arguments { painter, palette, out, nozzle, memory_gib, .. } = arguments;
            if palette.is_some() {
                only_for_one_paint(*painter, nozzle)?;
            }
            let job = job(painter.unwrap_or(PainterKind::Feedback), nozzle)?;
            for file in pictures_in(&image)? {
                check_memory(&file, palette.is_some(), *memory_gib)?;
                let out = if image.is_dir() { out.join(file.file_name().unwrap_or_default()) } else { out.clone() };
                match palette {
                    None => paint(&file, &job, &out)?,
                    Some(palette) => paint_file_in_colours(&file, &job, *palette, &out)?,
                }
            }
            Ok(())
        }
        Some(Command::Compare { pictures, runs, out, nozzle }) => {
            let pictures = pictures_or_textures(pictures.clone())?;
            create(out, "paint-image-compare")?;
            print!("{}", table(&compare(&job(PainterKind::Feedback, nozzle)?, &pictures, *runs, out)?));
            Ok(())
        }
        Some(Command::EqualSprays { weights, pictures }) => {
            print!(
                "{}",
                print_equal_sprays(&equal_sprays(weights.as_deref(), &pictures_or_textures(pictures.clone())?)?)
            );
            Ok(())
        }
        Some(Command::Train(training)) => run_training(training.clone()),
    }
}

/// The painter of colours has settings of its own.
fn only_for_one_paint(painter: Option<PainterKind>, nozzle: &Nozzle) -> Result<(), PaintImageError> {
    let given = [
        ("--painter", painter.is_some()),
        ("--layers", nozzle.layers.is_some()),
        ("--slew-limit", nozzle.slew_limit.is_some()),
        ("--scan-order", nozzle.scan_order.is_some()),
        ("--passes", nozzle.passes.is_some()),
        ("--threads", nozzle.threads.is_some()),
        ("--weights", nozzle.weights.is_some()),
    ];
    let given: Vec<&str> = given.iter().filter(|g| g.1).map(|g| g.0).collect();
    if given.is_empty() {
        return Ok(());
    }
    let given = given.join(", ");
    Err(PaintImageError::Settings(format!("{given}: for one paint only; leave that out, or --palette")))
}

fn pictures_or_textures(pictures: Option<PathBuf>) -> Result<Vec<Image>, PaintImageError> {
    Ok(match pictures {
        Some(path) => pictures_in(&path)?.iter().map(|p| read_ink(p)).collect::<Result<_, _>>()?,
        None => Texture::ALL.map(texture_picture).to_vec(),
    })
}

fn run_training(training: Training) -> Result<(), PaintImageError> {
    let Training { preset, data, seed, steps, until, batch, rate, last_rate, as_printed, never_stops, .. } = training;
    let Training { latent_weight, variation_weight, threads, resume, out, .. } = training;
    create(&out, "paint-image-train")?;
    let threads = worker_threads(threads);
    let (architecture, pictures) = match preset {
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
            train_painter(&TrainingRun { settings, resume, until, save_every: 500 }, &out)?;
            result!("{}", out.join("painter.safetensors").display());
            return Ok(());
        }
        // The command line requires the data.
        Preset::ThesisMnist => (Architecture::MNIST, TrainingImages::Digits(data.unwrap_or_default())),
        Preset::ThesisPaint => (Architecture::PAINT, data.map_or(TrainingImages::Patches, TrainingImages::Photographs)),
    };
    let preset = ThesisSettings::default();
    // `S_stop` grows by less than 1 a step.
    let stop = if never_stops { architecture.steps as f64 } else { architecture.stop };
    let architecture = Architecture { stop, ..architecture };
    let settings = ThesisSettings {
        seed,
        architecture,
        threads,
        steps: steps.unwrap_or(preset.steps),
        batch: batch.unwrap_or(preset.batch),
        learning_rate: rate.unwrap_or(preset.learning_rate),
        last_learning_rate: last_rate.unwrap_or(preset.last_learning_rate),
        objective: Objective {
            gated: !as_printed && !never_stops,
            latent: latent_weight.unwrap_or(preset.objective.latent),
            variation: variation_weight.unwrap_or(preset.objective.variation),
            stop: if never_stops { 0.0 } else { preset.objective.stop },
            ..preset.objective
        },
        ..preset
    };
    train_thesis(&ThesisTrainingRun { settings, pictures, resume, until, save_every: 100 }, &out)?;
    result!("{}", out.join("thesis.safetensors").display());
    Ok(())
}

fn job(painter: PainterKind, nozzle: &Nozzle) -> Result<Job, PaintImageError> {
    Ok(Job {
        painter,
        passes: nozzle.passes.unwrap_or(6),
        kernel: SprayKernel::new(nozzle.sigma, nozzle.cut)?,
        limits: Limits {
            spray_spacing: nozzle.spray_spacing,
            row_spacing: nozzle.row_spacing,
            min_volume: nozzle.min_volume,
            max_sprays: nozzle.max_sprays,
            ..Limits::default()
        },
        slew_limit: nozzle.slew_limit,
        order: match nozzle.scan_order {
            Some(ScanOrderName::ContextBased) => ScanOrder::ContextBased,
            Some(ScanOrderName::Boustrophedon) | None => ScanOrder::Boustrophedon,
        },
        layers: nozzle.layers.map(|sharing| match sharing {
            SharingName::Joint => LayerPlanning::Joint,
            SharingName::Sequential => LayerPlanning::Sequential,
        }),
        threads: worker_threads(nozzle.threads),
        thesis: nozzle.weights.as_deref().map(read_network).transpose()?,
    })
}

fn paint(image: &Path, job: &Job, out: &Path) -> Result<(), PaintImageError> {
    let wanted = read_ink(image)?;
    create(out, "paint-image")?;
    let stage = Stage::start("paint");
    let (painting, figures) = job.paint(&wanted, &mut |share| stage.share(share))?;
    stage.done(&format!("{} sprays, {:.2} dB, {:.1} ms", figures.sprays, figures.psnr_db, figures.cpu_ms));
    job.save(out, &wanted, &painting, &figures)?;
    result!("{}", out.join("report.json").display());
    Ok(())
}

fn paint_file_in_colours(image: &Path, job: &Job, glazes: Glazes, out: &Path) -> Result<(), PaintImageError> {
    let (wanted, palette) = (read_picture(image)?, glazes.palette()?);
    create(out, "paint-image")?;
    let stage = Stage::start("paint");
    let (painting, figures) = paint_colours(job, &wanted, &palette, &mut |share| stage.share(share))?;
    stage
        .done(&format!("{} sprays, CIEDE2000 {:.2}, {:.1} ms", figures.sprays, figures.ciede2000_mean, figures.cpu_ms));
    save_colours(job, out, &wanted, &palette, &painting, &figures)?;
    result!("{}", out.join("report.json").display());
    Ok(())
}

fn create(folder: &Path, subcommand: &str) -> Result<(), PaintImageError> {
    run_folder::begin(folder, subcommand).map_err(|e| PaintImageError::File {
        path: folder.display().to_string(),
        why: format!("cannot be created ({e}): choose another --out"),
    })
}
