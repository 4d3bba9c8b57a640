//! The search for noise settings: which points are tried, and what they cost.

use std::fs::File;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use vio_ekf::tune::{HeldOut, NoisePoint, Score, Trial, cost, penalty, tune};

use super::data::TuningData;
use super::output::save;
use super::report::TuningReport;
use super::settings::Tuning;
use super::trial_log::{append, read_trials, trials_text};
use crate::progress::Stage;
use crate::vio::error::{VioError, write_file};

/// The noise as it is given.
const DATA_SHEET: NoisePoint = [0.0; 5];

/// Scores of all recordings at one point, some at a time.
fn scores(data: &TuningData, point: &NoisePoint, threads: usize) -> Result<Vec<Score>, VioError> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= data.len() {
                return done;
            }
            done.push((index, data.score(index, point)));
        }
    };
    let mut all: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.clamp(1, data.len())).map(|_| scope.spawn(work)).collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, _>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(join).collect()
    });
    // In the order of the recordings: sums must not depend on who was first.
    all.sort_unstable_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, score)| score).collect()
}

/// Searches, and writes `trials.csv` as it goes, then `noise.yaml`, `tune.png`, `report.md` and `report.json`.
///
/// # Errors
/// [`VioError`] if the recordings cannot be used, or a file cannot be written.
pub fn tune_noise(data: &TuningData, tuning: &Tuning, folder: &Path) -> Result<TuningReport, VioError> {
    tuning.search.check()?;
    let path = folder.join("trials.csv");
    let known = if tuning.resume && path.is_file() { read_trials(&path)? } else { Vec::new() };
    write_file(&path, trials_text(&known).as_bytes())?;
    let mut log = File::options().append(true).open(&path).map_err(|error| VioError::unwritable(&path, &error))?;
    let mut computed = 0;
    let mut failed = None;
    let started = Instant::now();

    let stage = Stage::start("tune");
    let mut scored: Vec<(NoisePoint, Vec<Score>)> = Vec::new();
    let mut evaluate = |point: &NoisePoint| {
        let scores = scores(data, point, tuning.threads)?;
        let value = cost(&scores, tuning.consistency_weight) + penalty(point, tuning.regularization);
        scored.push((*point, scores));
        Ok::<_, VioError>(value)
    };
    let found = tune(&tuning.start, &tuning.search, &known, |point| {
        computed += 1;
        stage.share(computed as f64 / tuning.search.evaluations as f64);
        let value = if failed.is_none() { evaluate(point) } else { Ok(f64::NAN) };
        value.and_then(|value| append(&mut log, &path, point, value).map(|()| value)).unwrap_or_else(|error| {
            failed.get_or_insert(error);
            f64::NAN
        })
    });
    if let Some(error) = failed {
        return Err(error);
    }
    let found = found?;
    let search_wall_s = started.elapsed().as_secs_f64();
    // Complete and in order, reused points included: the next one to resume needs nothing else.
    write_file(&path, trials_text(&found.trials).as_bytes())?;
    stage.done(&format!("{} evaluations, {computed} of them computed", found.trials.len()));

    let mut random = Vec::with_capacity(tuning.random);
    if tuning.random > 0 {
        let stage = Stage::start("random points");
        let mut generator = SplitMix64::seed_from_u64(tuning.seed);
        for k in 0..tuning.random {
            stage.share(k as f64 / tuning.random as f64);
            let point = tuning.start.map(|power| power + tuning.search.range * (2.0 * uniform(&mut generator) - 1.0));
            random.push(Trial { point, cost: evaluate(&point)? });
        }
        stage.done(&format!("{} evaluations", random.len()));
    }

    // Judged on recordings that were left out; what does not help there is not handed on.
    evaluate(&DATA_SHEET)?;
    let held_out = HeldOut::of(&scored, tuning.consistency_weight, tuning.regularization);
    let data_sheet_kept = held_out.is_some_and(|held_out| !held_out.is_gain());
    let chosen = if data_sheet_kept { DATA_SHEET } else { found.best.point };
    let (start, best) = (scores(data, &tuning.start, tuning.threads)?, scores(data, &chosen, tuning.threads)?);
    let geometric =
        |scores: &[Score]| (scores.iter().map(|s| s.ate.max(1e-9).ln()).sum::<f64>() / scores.len() as f64).exp();
    let nees = |scores: &[Score]| scores.iter().flat_map(|s| s.nees).sum::<f64>() / (3.0 * scores.len() as f64);
    let least = random.iter().map(|trial| trial.cost).fold(f64::INFINITY, f64::min);
    let factor = chosen.map(|power| 10_f64.powf(power));
    let report = TuningReport {
        version: env!("CARGO_PKG_VERSION"),
        recordings: data.len(),
        evaluations: found.trials.len(),
        evaluations_computed: computed,
        weighted_error_start_m: found.trials[0].cost.exp(),
        weighted_error_best_m: found.best.cost.exp(),
        ate_start_m: geometric(&start),
        ate_best_m: geometric(&best),
        nees_start: nees(&start),
        nees_best: nees(&best),
        factor_gyro_white: factor[0],
        factor_gyro_walk: factor[1],
        factor_accel_white: factor[2],
        factor_accel_walk: factor[3],
        factor_image: factor[4],
        held_out_error_data_sheet_m: held_out.map(|held_out| held_out.data_sheet.exp()),
        held_out_error_tuned_m: held_out.map(|held_out| held_out.tuned.exp()),
        held_out_ate_data_sheet_m: held_out.map(|held_out| held_out.data_sheet_position.exp()),
        held_out_ate_tuned_m: held_out.map(|held_out| held_out.tuned_position.exp()),
        data_sheet_kept,
        random_samples: random.len(),
        weighted_error_random_m: (!random.is_empty()).then(|| least.exp()),
        ratio_to_random: (!random.is_empty()).then(|| (found.best.cost - least).exp()),
        search_wall_s,
        threads: tuning.threads,
    };
    save(&report, data, tuning, (&found.trials, &random), folder)?;
    Ok(report)
}

/// A number in `[0, 1)`.
fn uniform(random: &mut SplitMix64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}
