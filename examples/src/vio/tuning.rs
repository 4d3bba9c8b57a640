//! Noise settings from recordings: what is run, what it costs, and the report.

mod output;
mod trial_log;

use std::fs::File;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde::Serialize;
use vio_ekf::sim::ImuModel;
use vio_ekf::tune::{NoisePoint, PointRecording, Score, Trial, TuneSettings, cost, tune, with_factors};
use vio_ekf::{Camera, ImuNoise, Settings};

use super::error::write_file;
use super::simulate::flight_spline;
use super::{Flight, Recording, RunSettings, VioError, evaluate_run, run};
use crate::progress::Stage;
use output::save;
use trial_log::{append, read_trials, trials_text};

/// Standard deviation of the simulated points, pixels.
const PIXEL_SIGMA: f64 = 1.0;
/// Names of the five groups, in the order of a [`NoisePoint`].
const GROUPS: [&str; 5] =
    ["gyroscope, white", "gyroscope, walk", "accelerometer, white", "accelerometer, walk", "image"];

/// What the settings are tuned on.
pub enum TuningData {
    /// Simulated flights before points.
    Points(Vec<PointRecording>),
    /// Recordings whose true motion is known.
    Recordings(Vec<Recording>),
}

/// A tuning.
#[derive(Debug, Clone, Copy)]
pub struct Tuning {
    /// The search.
    pub search: TuneSettings,
    /// Powers of ten on the noise that is given, from which the search starts.
    pub start: NoisePoint,
    /// How much dishonest covariances cost, beside errors.
    pub consistency_weight: f64,
    /// Points drawn at random inside the same bounds, to compare with.
    pub random: usize,
    /// Seed of these.
    pub seed: u64,
    /// Whether to go on from `trials.csv` in the folder.
    pub resume: bool,
    /// Recordings that are run at once.
    pub threads: usize,
}

/// What `report.json` of a tuning holds.
#[derive(Debug, Clone, Serialize)]
pub struct TuningReport {
    /// Version of the program.
    pub version: &'static str,
    /// Recordings.
    pub recordings: usize,
    /// Points that the search asked for.
    pub evaluations: usize,
    /// Points whose cost was computed in this run, random ones left out.
    pub evaluations_computed: usize,
    /// Geometric mean of the position errors, each worsened by its dishonesty: at the start of the search.
    pub weighted_error_start_m: f64,
    /// The same at its end.
    pub weighted_error_best_m: f64,
    /// Geometric mean of the position errors at the start.
    pub ate_start_m: f64,
    /// The same at the end.
    pub ate_best_m: f64,
    /// Mean normalised squared error of position, attitude and velocity at the start; 3 is honest.
    pub nees_start: f64,
    /// The same at the end.
    pub nees_best: f64,
    /// Factor on the gyroscope's white noise.
    pub factor_gyro_white: f64,
    /// Factor on its walk.
    pub factor_gyro_walk: f64,
    /// Factor on the accelerometer's white noise.
    pub factor_accel_white: f64,
    /// Factor on its walk.
    pub factor_accel_walk: f64,
    /// Factor on the noise in images.
    pub factor_image: f64,
    /// Points drawn at random.
    pub random_samples: usize,
    /// Weighted error of the best of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighted_error_random_m: Option<f64>,
    /// Weighted error of the search over that of the best random point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio_to_random: Option<f64>,
    /// Wall-clock time of the search.
    pub search_wall_s: f64,
    /// Worker threads.
    pub threads: usize,
}

impl TuningData {
    /// As many simulated flights of so many seconds, before points.
    ///
    /// # Errors
    /// [`VioError::Library`] for lengths that cannot be.
    pub fn simulated(flights: usize, seconds: f64, seed: u64) -> Result<Self, VioError> {
        let one = |k: u64| {
            let spline = flight_spline(&Flight::Room, seconds, seed + k)?;
            let recording =
                PointRecording::simulate(&spline, &Camera::euroc(), &ImuModel::default(), PIXEL_SIGMA, 9.81, seed + k)?;
            Ok(recording)
        };
        (0..flights.max(1) as u64).map(one).collect::<Result<_, VioError>>().map(Self::Points)
    }

    fn len(&self) -> usize {
        match self {
            Self::Points(points) => points.len(),
            Self::Recordings(recordings) => recordings.len(),
        }
    }

    fn score(&self, index: usize, point: &NoisePoint) -> Result<Score, VioError> {
        match self {
            Self::Points(points) => Ok(points[index].score(&ImuNoise::default(), &Settings::default(), point)?),
            Self::Recordings(recordings) => score_recording(&recordings[index], point),
        }
    }
}

/// A recording that cannot be followed at all costs the most, but is no reason to stop the search.
fn score_recording(recording: &Recording, point: &NoisePoint) -> Result<Score, VioError> {
    let lost = Score { ate: 1.0, nees: [3.0; 3], lost: 1.0 };
    let Some(truth) = &recording.truth else {
        let why = "has no truth to be tuned against: give one with the recording".into();
        return Err(VioError::Unusable { recording: recording.name.clone(), why });
    };
    let (noise, filter) = with_factors(&recording.imu.noise, &Settings::default(), point);
    let settings = RunSettings { filter, noise: Some(noise), threads: 1, quiet: true };
    let run = match run(recording, &settings) {
        Ok(run) => run,
        Err(VioError::Unusable { .. }) => return Ok(lost),
        Err(error) => return Err(error),
    };
    let Some(evaluation) = evaluate_run(&run, truth)? else { return Ok(lost) };
    let nees = [evaluation.nees_position, evaluation.nees_attitude, evaluation.nees_velocity.unwrap_or(3.0)];
    Ok(Score { ate: evaluation.ate_yaw, nees, lost: 1.0 - evaluation.coverage })
}

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
    let evaluate = |point: &NoisePoint| {
        let scores = scores(data, point, tuning.threads)?;
        Ok::<_, VioError>(cost(&scores, tuning.consistency_weight))
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
        let mut state = tuning.seed;
        for k in 0..tuning.random {
            stage.share(k as f64 / tuning.random as f64);
            let point = tuning.start.map(|power| power + tuning.search.range * (2.0 * uniform(&mut state) - 1.0));
            random.push(Trial { point, cost: evaluate(&point)? });
        }
        stage.done(&format!("{} evaluations", random.len()));
    }

    let (start, best) =
        (scores(data, &tuning.start, tuning.threads)?, scores(data, &found.best.point, tuning.threads)?);
    let geometric =
        |scores: &[Score]| (scores.iter().map(|s| s.ate.max(1e-9).ln()).sum::<f64>() / scores.len() as f64).exp();
    let nees = |scores: &[Score]| scores.iter().flat_map(|s| s.nees).sum::<f64>() / (3.0 * scores.len() as f64);
    let least = random.iter().map(|trial| trial.cost).fold(f64::INFINITY, f64::min);
    let factor = found.best.point.map(|power| 10_f64.powf(power));
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
        random_samples: random.len(),
        weighted_error_random_m: (!random.is_empty()).then(|| least.exp()),
        ratio_to_random: (!random.is_empty()).then(|| (found.best.cost - least).exp()),
        search_wall_s,
        threads: tuning.threads,
    };
    save(&report, data, tuning, (&found.trials, &random), folder)?;
    Ok(report)
}

/// splitmix64, in `[0, 1)`.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}
