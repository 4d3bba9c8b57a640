//! Training of the feedback painter.

use std::path::{Path, PathBuf};

use paint_net::train::{TrainSettings, Trainer};
use serde::Serialize;

use crate::interruption::{self, Finishing};
use crate::paint_image::error::PaintImageError;
use crate::paint_image::files::write_json;
use crate::pictures::{Panel, save_curves};
use crate::progress::Stage;
use crate::report::check_finite;
use crate::whole_file;

/// Steps between two points of the curve.
const POINT: usize = 50;

/// A training: its settings, and where to go on from.
#[derive(Debug, Clone)]
pub struct TrainingRun {
    /// How to train.
    pub settings: TrainSettings,
    /// Checkpoint to go on from.
    pub resume: Option<PathBuf>,
    /// Step after which to stop, if not at the end.
    pub until: Option<usize>,
    /// Steps between checkpoints.
    pub save_every: usize,
}

#[derive(Serialize)]
struct Outcome {
    seed: u64,
    steps: usize,
    parameters: usize,
    weights_bytes: usize,
    psnr_db_last: f64,
    wall_s: f64,
    threads: usize,
}

/// Trains, and writes `painter.safetensors`, `checkpoint.safetensors`, `curve.png` and `report.json` into the folder.
pub fn train_painter(run: &TrainingRun, folder: &Path) -> Result<(), PaintImageError> {
    let started = std::time::Instant::now();
    let settings = &run.settings;
    let mut trainer = match &run.resume {
        None => Trainer::new(settings.clone())?,
        Some(path) => {
            let file_error = |why: String| PaintImageError::File { path: path.display().to_string(), why };
            let bytes = std::fs::read(path).map_err(|e| file_error(format!("cannot be read ({e})")))?;
            Trainer::resume(settings.clone(), &bytes).map_err(|e| file_error(e.to_string()))?
        }
    };
    let save = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        whole_file::write(&path, bytes)
            .map_err(|e| PaintImageError::File { path: path.display().to_string(), why: e.to_string() })
    };
    let stage = Stage::start("train");
    let (mut losses, mut qualities) = (Vec::new(), Vec::new());
    let (mut loss, mut quality, mut count) = (0.0, 0.0, 0.0);
    let mut last = run.until.unwrap_or(settings.steps).min(settings.steps);
    let _finishing = Finishing::begin();
    while trainer.steps_done() < last {
        let progress = trainer.step();
        if interruption::is_requested() {
            last = progress.step;
        }
        loss += progress.loss;
        quality += progress.psnr_db;
        count += 1.0;
        if progress.step % POINT == 0 || progress.step == last {
            losses.push((progress.step as f64, loss / count));
            qualities.push((progress.step as f64, quality / count));
            (loss, quality, count) = (0.0, 0.0, 0.0);
        }
        if progress.step % run.save_every.max(1) == 0 || progress.step == last {
            save("checkpoint.safetensors", &trainer.checkpoint())?;
        }
        stage.share(progress.step as f64 / last as f64);
    }
    let network = trainer.network();
    let notes =
        [("seed", settings.seed.to_string()), ("step", format!("{} of {}", trainer.steps_done(), settings.steps))];
    let weights = network.to_safetensors(&notes);
    save("painter.safetensors", &weights)?;
    let psnr_db_last = qualities.last().map_or(0.0, |q| q.1);
    let panels = [
        Panel { label: "loss", curves: vec![("loss", losses)] },
        Panel { label: "PSNR of the batch, dB", curves: vec![("last pass", qualities)] },
    ];
    if panels.iter().all(|p| p.curves.iter().all(|c| c.1.len() > 1)) {
        save_curves(&folder.join("curve.png"), "Training of the feedback painter", "step", &panels)?;
    }
    let outcome = Outcome {
        seed: settings.seed,
        steps: trainer.steps_done(),
        parameters: network.parameters(),
        weights_bytes: weights.len(),
        psnr_db_last,
        wall_s: started.elapsed().as_secs_f64(),
        threads: settings.threads,
    };
    check_finite(&outcome)?;
    write_json(&folder.join("report.json"), &outcome)?;
    stage.done(&format!("{} steps, {psnr_db_last:.2} dB on the last pictures", trainer.steps_done()));
    Ok(())
}
