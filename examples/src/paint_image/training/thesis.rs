//! Training of the thesis' network: digits as in its table's first row, patches of procedural scenes or of photographs as in its second.

use std::path::{Path, PathBuf};

use paint_net::procedural::lattice;
use paint_net::thesis::{Architecture, Network};
use paint_net::train::{ThesisLoss, ThesisSettings, ThesisTrainer, thesis_patch, thesis_patch_of};
use paint_net::{Error, Image};
use serde::Serialize;

use super::digits;
use super::held_out::{Painted, volume_picture};
use super::rollout::rollout_picture;
use crate::interruption::{self, Finishing};
use crate::paint_image::error::PaintImageError;
use crate::paint_image::files::{pictures_in, write_json};
use crate::paint_image::ink::read_small_ink;
use crate::pictures::{Panel, save_curves};
use crate::progress::Stage;
use crate::report::check_finite;
use crate::whole_file;

/// Digits that are trained on; the others, which come after them in the file, are held out.
const TRAINED: usize = 7000;
/// Patches that are held out, and their numbers, which no training reaches.
const HELD: u64 = 200;
const FIRST_HELD: u64 = 1 << 40;
/// One photograph of so many is held out.
const TESTED: usize = 10;
/// Pictures in the rollout picture.
const SHOWN: usize = 10;

/// What the network is shown.
#[derive(Debug, Clone)]
pub enum TrainingImages {
    /// Digits from a file or folder in the format of MNIST: the first 7000 to train, the others to test.
    Digits(PathBuf),
    /// Patches of procedural scenes.
    Patches,
    /// Patches of the photographs in a folder: every tenth of them, by name, to test.
    Photographs(PathBuf),
}

/// The pictures to train on as they are.
enum Samples {
    Digits(Vec<Image>),
    Patches,
    Photographs(Vec<Image>),
}

impl Samples {
    /// The `n`th sample.
    fn sample(&self, settings: &ThesisSettings, n: u64) -> Result<Image, Error> {
        match self {
            Self::Digits(all) => Ok(all[(lattice(settings.seed, n as i64, -13) * all.len() as f64) as usize].clone()),
            Self::Patches => thesis_patch(settings.seed, n, &settings.architecture),
            Self::Photographs(all) => thesis_patch_of(all, settings.seed, n, &settings.architecture),
        }
    }

    /// How many there are, where they are not made on the way.
    fn count(&self) -> Option<usize> {
        match self {
            Self::Digits(all) | Self::Photographs(all) => Some(all.len()),
            Self::Patches => None,
        }
    }
}

/// A training of the thesis' network.
#[derive(Debug, Clone)]
pub struct ThesisTrainingRun {
    /// How to train.
    pub settings: ThesisSettings,
    /// On what.
    pub pictures: TrainingImages,
    /// Checkpoint to go on from; the curve beside it is gone on with.
    pub resume: Option<PathBuf>,
    /// Step after which to stop, if not at the end.
    pub until: Option<usize>,
    /// Steps between checkpoints and evaluations on the held-out pictures.
    pub save_every: usize,
}

#[derive(Serialize)]
struct Outcome {
    seed: u64,
    steps: usize,
    parameters: usize,
    trained_pictures: usize,
    held_pictures: usize,
    /// With the noise of training, cross-entropy between the floored ink and the picture.
    bce_nats_per_picture: f64,
    kl_latent_nats_per_picture: f64,
    steps_used_mean: f64,
    steps_used_share: f64,
    volume_variation: f64,
    /// Without noise, as the painter paints.
    painted_bce_nats_per_px: f64,
    painted_psnr_db: f64,
    painted_steps_mean: f64,
    /// Share of the sprayed volume that lands where the ink had reached what is wanted.
    painted_over_share: f64,
    /// By the weights rounded to bytes.
    small_painted_psnr_db: f64,
    wall_s: f64,
    threads: usize,
}

/// Trains, and writes `thesis.safetensors`, the same with its matrices as bytes in `thesis-small.safetensors`, `checkpoint.safetensors`,
/// `curve.csv`, `curve.png`, `rollout.png`, `volumes.png` and `report.json`.
pub fn train_thesis(run: &ThesisTrainingRun, folder: &Path) -> Result<(), PaintImageError> {
    let started = std::time::Instant::now();
    let settings = &run.settings;
    let (samples, held) = pictures(run)?;
    let mut trainer = match &run.resume {
        None => ThesisTrainer::new(settings.clone())?,
        Some(path) => {
            let bytes = std::fs::read(path).map_err(|e| file_error(path, format!("cannot be read ({e})")))?;
            ThesisTrainer::resume(settings.clone(), &bytes).map_err(|e| file_error(path, e.to_string()))?
        }
    };
    let save = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        whole_file::write(&path, bytes).map_err(|e| file_error(&path, e.to_string()))
    };
    let mut curve = Curve::before(run.resume.as_deref(), trainer.steps_done());
    let picture = |n: u64| samples.sample(settings, n);
    let mut last = run.until.unwrap_or(settings.steps).min(settings.steps);
    let stage = Stage::start("train");
    let _finishing = Finishing::begin();
    while trainer.steps_done() < last {
        let loss = trainer.step(&picture)?;
        let step = trainer.steps_done();
        if interruption::is_requested() {
            last = step;
        }
        curve.add(step, "trained", &loss);
        if step % run.save_every.max(1) == 0 || step == last {
            curve.add(step, "held", &trainer.validate(&held)?);
            save("checkpoint.safetensors", &trainer.checkpoint())?;
            save("curve.csv", curve.text().as_bytes())?;
        }
        stage.share(step as f64 / last as f64);
    }
    let network = trainer.network();
    let notes =
        [("seed", settings.seed.to_string()), ("step", format!("{} of {}", trainer.steps_done(), settings.steps))];
    let small = network.to_small_safetensors(&notes);
    save("thesis.safetensors", &network.to_safetensors(&notes))?;
    save("thesis-small.safetensors", &small)?;
    curve.draw(&folder.join("curve.png"))?;
    let bright = matches!(run.pictures, TrainingImages::Digits(_));
    rollout_picture(&network, &held[..SHOWN.min(held.len())], bright)?.save(&folder.join("rollout.png"))?;
    volume_picture(&network, &held)?.save(&folder.join("volumes.png"))?;
    let (loss, painted) = (trainer.validate(&held)?, Painted::by(&network, &held)?);
    let outcome = Outcome {
        seed: settings.seed,
        steps: trainer.steps_done(),
        parameters: network.parameters(),
        trained_pictures: samples.count().unwrap_or(trainer.steps_done() * settings.batch),
        held_pictures: held.len(),
        bce_nats_per_picture: loss.cross_entropy,
        kl_latent_nats_per_picture: loss.latent,
        steps_used_mean: loss.steps,
        steps_used_share: loss.steps / settings.architecture.steps as f64,
        volume_variation: loss.variation,
        painted_bce_nats_per_px: painted.bce_nats_per_px,
        painted_psnr_db: painted.psnr_db,
        painted_steps_mean: painted.steps_mean,
        painted_over_share: painted.over_share,
        small_painted_psnr_db: Painted::by(&Network::from_safetensors(&small)?, &held)?.psnr_db,
        wall_s: started.elapsed().as_secs_f64(),
        threads: settings.threads,
    };
    check_finite(&outcome)?;
    write_json(&folder.join("report.json"), &outcome)?;
    stage.done(&format!(
        "{} steps; held out: {:.1} nats per picture, {:.1} of {} steps used",
        outcome.steps, outcome.bce_nats_per_picture, outcome.steps_used_mean, settings.architecture.steps
    ));
    Ok(())
}

/// Procedural patch `number` of those that a training with this seed holds out.
///
/// # Errors
/// An architecture that has no patches.
pub fn held_out_patch(seed: u64, number: u64, architecture: &Architecture) -> Result<Image, Error> {
    thesis_patch(seed, FIRST_HELD + number, architecture)
}

/// Pictures to train on, and held-out ones to test.
fn pictures(run: &ThesisTrainingRun) -> Result<(Samples, Vec<Image>), PaintImageError> {
    let ThesisSettings { seed, architecture, .. } = &run.settings;
    match &run.pictures {
        TrainingImages::Digits(path) => {
            let mut all = digits::read(path, architecture.side)?;
            if all.len() <= TRAINED {
                return Err(file_error(path, format!("holds {} pictures: give more than {TRAINED}", all.len())));
            }
            let held = all.split_off(TRAINED);
            Ok((Samples::Digits(all), held))
        }
        TrainingImages::Patches => {
            let held = (0..HELD).map(|k| held_out_patch(*seed, k, architecture));
            Ok((Samples::Patches, held.collect::<Result<_, _>>()?))
        }
        TrainingImages::Photographs(folder) => {
            let files = pictures_in(folder)?;
            if files.len() < 2 {
                return Err(file_error(folder, "holds one picture: give two or more, one of them to test".into()));
            }
            // No square is smaller than a quarter of the shorter side, nor needs more pixels than the network sees.
            let shortest = 4 * architecture.side as u32;
            let (mut trained, mut tested) = (Vec::new(), Vec::new());
            for (k, file) in files.iter().enumerate() {
                if k % TESTED == 0 { &mut tested } else { &mut trained }.push(read_small_ink(file, shortest)?);
            }
            let held = (0..HELD).map(|k| thesis_patch_of(&tested, *seed, FIRST_HELD + k, architecture));
            Ok((Samples::Photographs(trained), held.collect::<Result<_, _>>()?))
        }
    }
}

fn file_error(path: &Path, why: String) -> PaintImageError {
    PaintImageError::File { path: path.display().to_string(), why }
}

/// The loss over the steps, as a table that a later run goes on with.
struct Curve(Vec<String>);

const HEAD: &str = "step,pictures,total,cross_entropy,latent,stop,variation,steps";

impl Curve {
    /// What stands beside the checkpoint, up to its step; nothing if there is none.
    fn before(resume: Option<&Path>, step: usize) -> Self {
        let text = resume.and_then(|path| std::fs::read_to_string(path.with_file_name("curve.csv")).ok());
        let lines = text.iter().flat_map(|text| text.lines().skip(1));
        let earlier =
            |line: &&str| line.split(',').next().and_then(|n| n.parse().ok()).is_some_and(|n: usize| n <= step);
        Self(lines.filter(earlier).map(str::to_string).collect())
    }

    fn add(&mut self, step: usize, pictures: &str, loss: &ThesisLoss) {
        let ThesisLoss { total, cross_entropy, latent, stop, variation, steps } = loss;
        self.0.push(format!(
            "{step},{pictures},{total:.3},{cross_entropy:.3},{latent:.3},{stop:.3},{variation:.4},{steps:.3}"
        ));
    }

    fn text(&self) -> String {
        format!("{HEAD}\n{}\n", self.0.join("\n"))
    }

    /// Points of a column; those of training are means over twenty steps.
    fn points(&self, pictures: &str, column: usize) -> Vec<(f64, f64)> {
        let number = |text: Option<&&str>| text.and_then(|t| t.parse::<f64>().ok());
        let rows =
            self.0.iter().map(|line| line.split(',').collect::<Vec<_>>()).filter(|f| f.get(1) == Some(&pictures));
        let points: Vec<(f64, f64)> = rows.filter_map(|f| Some((number(f.first())?, number(f.get(column))?))).collect();
        let together = if pictures == "trained" { 20 } else { 1 };
        let mean = |some: &[(f64, f64)]| {
            let share = 1.0 / some.len() as f64;
            (some.iter().map(|p| p.0 * share).sum(), some.iter().map(|p| p.1 * share).sum())
        };
        points.chunks(together).map(mean).collect()
    }

    fn draw(&self, path: &Path) -> Result<(), PaintImageError> {
        let column = |k| vec![("trained on", self.points("trained", k)), ("held out", self.points("held", k))];
        let panels = [
            Panel { label: "cross-entropy, nats", curves: column(3) },
            Panel { label: "divergence of z, nats", curves: column(4) },
            Panel { label: "steps used", curves: column(7) },
        ];
        if panels.iter().all(|p| p.curves.iter().all(|c| c.1.len() > 1)) {
            save_curves(path, "Training of the thesis' network, per picture", "step", &panels)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curve needs two points of both kinds; twenty steps of training are one.
    #[test]
    fn curves_are_drawn_once_there_are_some() {
        let path = std::env::temp_dir().join(format!("paintcopter-thesis-curve-{}.png", std::process::id()));
        let curve = |steps: usize| {
            let line = |step: usize, pictures: &str| format!("{step},{pictures},3.0,2.0,0.5,0.4,0.1,4.0");
            let trained = (0..steps).map(|step| line(step, "trained"));
            Curve(trained.chain([line(0, "held"), line(steps, "held")]).collect())
        };
        curve(20).draw(&path).unwrap();
        assert!(!path.exists());
        curve(40).draw(&path).unwrap();
        let picture = image::open(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert!(picture.width() > 300 && picture.height() > 300);
    }
}
