//! Training of the thesis' network: digits as in its table's first row, procedural patches as in its second.

use std::path::{Path, PathBuf};

use paint_net::procedural::lattice;
use paint_net::thesis::Network;
use paint_net::train::{ThesisLoss, ThesisSettings, ThesisTrainer, thesis_patch};
use paint_net::{Error, Image, metrics};
use serde::Serialize;

use super::digits;
use super::rollout::{rollout_picture, stamp};
use crate::interruption::{self, Finishing};
use crate::paint_image::error::PaintImageError;
use crate::paint_image::files::write_json;
use crate::pictures::{Panel, save_curves};
use crate::progress::Stage;
use crate::report::check_finite;
use crate::whole_file;

/// Digits that are trained on; the others, which come after them in the file, are held out.
const TRAINED: usize = 7000;
/// Patches that are held out, and their numbers, which no training reaches.
const HELD: u64 = 200;
const FIRST_HELD: u64 = 1 << 40;
/// Pictures in the rollout picture.
const SHOWN: usize = 10;

/// What the network is shown.
#[derive(Debug, Clone)]
pub enum TrainingImages {
    /// Digits from a file or folder in the format of MNIST: the first 7000 to train, the others to test.
    Digits(PathBuf),
    /// Patches of procedural scenes.
    Patches,
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
    /// Without noise, as the painter paints.
    painted_bce_nats_per_px: f64,
    painted_psnr_db: f64,
    painted_steps_mean: f64,
    wall_s: f64,
    threads: usize,
}

/// Trains, and writes `thesis.safetensors`, `checkpoint.safetensors`, `curve.csv`, `curve.png`, `rollout.png` and `report.json`.
pub fn train_thesis(run: &ThesisTrainingRun, folder: &Path) -> Result<(), PaintImageError> {
    let started = std::time::Instant::now();
    let settings = &run.settings;
    let (shown, held) = pictures(run)?;
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
    let picture = |n: u64| match &shown {
        Some(digits) => Ok(digits[(lattice(settings.seed, n as i64, -13) * digits.len() as f64) as usize].clone()),
        None => thesis_patch(settings.seed, n, &settings.architecture),
    };
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
    save("thesis.safetensors", &network.to_safetensors(&notes))?;
    curve.draw(&folder.join("curve.png"))?;
    let bright = matches!(run.pictures, TrainingImages::Digits(_));
    rollout_picture(&network, &held[..SHOWN.min(held.len())], bright)?.save(&folder.join("rollout.png"))?;
    let loss = trainer.validate(&held)?;
    let painted = evaluate(&network, &held)?;
    let outcome = Outcome {
        seed: settings.seed,
        steps: trainer.steps_done(),
        parameters: network.parameters(),
        trained_pictures: shown.as_ref().map_or(trainer.steps_done() * settings.batch, Vec::len),
        held_pictures: held.len(),
        bce_nats_per_picture: loss.cross_entropy,
        kl_latent_nats_per_picture: loss.latent,
        steps_used_mean: loss.steps,
        steps_used_share: loss.steps / settings.architecture.steps as f64,
        painted_bce_nats_per_px: painted[0],
        painted_psnr_db: painted[1],
        painted_steps_mean: painted[2],
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

/// Digits to train on, if they are not made on the way, and held-out pictures to test.
fn pictures(run: &ThesisTrainingRun) -> Result<(Option<Vec<Image>>, Vec<Image>), PaintImageError> {
    let architecture = &run.settings.architecture;
    match &run.pictures {
        TrainingImages::Digits(path) => {
            let mut all = digits::read(path, architecture.side)?;
            if all.len() <= TRAINED {
                return Err(file_error(path, format!("holds {} pictures: give more than {TRAINED}", all.len())));
            }
            let held = all.split_off(TRAINED);
            Ok((Some(all), held))
        }
        TrainingImages::Patches => {
            let held = (0..HELD).map(|k| thesis_patch(run.settings.seed, FIRST_HELD + k, architecture));
            Ok((None, held.collect::<Result<_, _>>()?))
        }
    }
}

/// Means over the pictures as they are painted without noise: cross-entropy per pixel, PSNR, steps.
fn evaluate(network: &Network, pictures: &[Image]) -> Result<[f64; 3], Error> {
    let mut sums = [0.0; 3];
    for some in pictures.chunks(50) {
        let tasks: Vec<(Image, Option<Image>)> = some.iter().map(|p| (p.clone(), None)).collect();
        for (picture, steps) in some.iter().zip(network.paint(&tasks)?) {
            let mut canvas = picture.map(|_| 0.0);
            for step in &steps {
                stamp(step, &mut canvas)?;
            }
            let ink = canvas.map(f64::tanh);
            sums[0] += metrics::binary_cross_entropy(&ink, picture)?;
            // An empty picture that stays empty would count 200 dB.
            sums[1] += metrics::psnr(&ink, picture, None)?.min(60.0);
            sums[2] += steps.len() as f64;
        }
    }
    Ok(sums.map(|sum| sum / pictures.len() as f64))
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
