//! Noise settings from recordings: what is run, what it costs, and the page about it.

use std::f64::consts::LN_10;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde::Serialize;
use vio_ekf::sim::ImuModel;
use vio_ekf::tune::{NoisePoint, PointRecording, Score, Trial, TuneSettings, cost, tune, with_factors};
use vio_ekf::{Camera, ImuNoise, Settings};

use super::error::{read_text, write_file};
use super::simulate::flight_spline;
use super::{Flight, Recording, RunSettings, VioError, judge, run};
use crate::pictures::{Panel, save_curves};
use crate::progress::Stage;
use crate::report::save_figures;

/// Standard deviation of the simulated points, pixels.
const PIXEL_SIGMA: f64 = 1.0;
/// Names of the five groups, in the order of a [`NoisePoint`].
const GROUPS: [&str; 5] =
    ["gyroscope, white", "gyroscope, walk", "accelerometer, white", "accelerometer, walk", "image"];

/// What the settings are tuned on.
pub enum Lessons {
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

impl Lessons {
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
    let Some(judgement) = judge(&run, truth)? else { return Ok(lost) };
    let nees = [judgement.nees_position, judgement.nees_attitude, judgement.nees_velocity.unwrap_or(3.0)];
    Ok(Score { ate: judgement.ate_yaw, nees, lost: 1.0 - judgement.coverage })
}

/// Scores of all recordings at one point, some at a time.
fn scores(lessons: &Lessons, point: &NoisePoint, threads: usize) -> Result<Vec<Score>, VioError> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= lessons.len() {
                return done;
            }
            done.push((index, lessons.score(index, point)));
        }
    };
    let mut all: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.clamp(1, lessons.len())).map(|_| scope.spawn(work)).collect();
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
pub fn tune_noise(lessons: &Lessons, tuning: &Tuning, folder: &Path) -> Result<TuningReport, VioError> {
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
        let scores = scores(lessons, point, tuning.threads)?;
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
        (scores(lessons, &tuning.start, tuning.threads)?, scores(lessons, &found.best.point, tuning.threads)?);
    let geometric =
        |scores: &[Score]| (scores.iter().map(|s| s.ate.max(1e-9).ln()).sum::<f64>() / scores.len() as f64).exp();
    let nees = |scores: &[Score]| scores.iter().flat_map(|s| s.nees).sum::<f64>() / (3.0 * scores.len() as f64);
    let least = random.iter().map(|trial| trial.cost).fold(f64::INFINITY, f64::min);
    let factor = found.best.point.map(|power| 10_f64.powf(power));
    let report = TuningReport {
        version: env!("CARGO_PKG_VERSION"),
        recordings: lessons.len(),
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
    save(&report, lessons, tuning, (&found.trials, &random), folder)?;
    Ok(report)
}

fn save(
    report: &TuningReport,
    lessons: &Lessons,
    tuning: &Tuning,
    (trials, random): (&[Trial], &[Trial]),
    folder: &Path,
) -> Result<(), VioError> {
    // What is worse than the start would hide the rest.
    let better = |of: &[Trial]| best_so_far(of).into_iter().filter(|point| point.1 <= trials[0].cost / LN_10).collect();
    let mut curves = vec![("search", better(trials))];
    if !random.is_empty() {
        curves.push(("random points", better(random)));
    }
    let powers = |k: usize| trials.iter().enumerate().map(|(i, t)| (i as f64 + 1.0, t.point[k])).collect();
    let panels = [
        Panel { label: "best so far [log10 m]", curves },
        Panel { label: "inertial [powers of 10]", curves: (0..4).map(|k| (GROUPS[k], powers(k))).collect() },
        Panel { label: "image [powers of 10]", curves: vec![(GROUPS[4], powers(4))] },
    ];
    save_curves(&folder.join("tune.png"), "Search for noise settings", "evaluation", &panels)?;
    let base = match lessons {
        Lessons::Points(_) => (ImuNoise::default(), 200.0),
        Lessons::Recordings(recordings) => (recordings[0].imu.noise, recordings[0].imu.rate_hz),
    };
    let best = [
        report.factor_gyro_white,
        report.factor_gyro_walk,
        report.factor_accel_white,
        report.factor_accel_walk,
        report.factor_image,
    ];
    let (noise, settings) = with_factors(&base.0, &Settings::default(), &best.map(f64::log10));
    let yaml = format!(
        "imu0:\n  gyroscope_noise_density: {:e}\n  gyroscope_random_walk: {:e}\n  accelerometer_noise_density: {:e}\n  \
         accelerometer_random_walk: {:e}\n  update_rate: {}\n",
        noise.gyro_density, noise.gyro_walk, noise.accel_density, noise.accel_walk, base.1
    );
    write_file(&folder.join("noise.yaml"), yaml.as_bytes())?;
    write_file(&folder.join("report.md"), markdown(report, tuning, best, &settings).as_bytes())?;
    save_figures(report, folder)?;
    Ok(())
}

fn markdown(report: &TuningReport, tuning: &Tuning, best: [f64; 5], settings: &Settings) -> String {
    let mut text = format!(
        "# Noise settings from {} recordings\n\n{} evaluations in {:.0} s on {} threads. Version {}.\n\n![Search](tune.png)\n\n\
         | noise | start | found |\n|---|---|---|\n",
        report.recordings, report.evaluations, report.search_wall_s, report.threads, report.version
    );
    for ((name, power), factor) in GROUPS.iter().zip(tuning.start).zip(best) {
        let _ = writeln!(text, "| {name}, factor | {:.3} | {factor:.3} |", 10_f64.powf(power));
    }
    let mut row = |name: &str, start: f64, found: f64| {
        let _ = writeln!(text, "| {name} | {start:.4} | {found:.4} |");
    };
    row("position error, geometric mean [m]", report.ate_start_m, report.ate_best_m);
    row("NEES, mean (3 is honest)", report.nees_start, report.nees_best);
    row("error weighted by dishonesty [m]", report.weighted_error_start_m, report.weighted_error_best_m);
    if let (Some(error), Some(ratio)) = (report.weighted_error_random_m, report.ratio_to_random) {
        let _ = writeln!(
            text,
            "\nThe best of {} points drawn at random inside the same bounds: {error:.4} m; the search reaches {ratio:.3} of it.",
            report.random_samples
        );
    }
    let (patches, landmarks) = (&settings.patches, &settings.landmarks);
    let _ = writeln!(
        text,
        "\nThe inertial noise is in [noise.yaml](noise.yaml), for `vio --imu`. For images: `grey_sigma` {:.3}, `pixel_sigma` \
         {:.4} of patches and {:.4} of landmarks. Every point tried is in [trials.csv](trials.csv), all figures in \
         [report.json](report.json).",
        patches.grey_sigma, patches.pixel_sigma, landmarks.pixel_sigma
    );
    text
}

fn best_so_far(trials: &[Trial]) -> Vec<(f64, f64)> {
    let mut least = f64::INFINITY;
    let mut lower = |(index, trial): (usize, &Trial)| {
        least = least.min(trial.cost);
        (index as f64 + 1.0, least / LN_10)
    };
    trials.iter().enumerate().map(&mut lower).collect()
}

/// splitmix64, in `[0, 1)`.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Numbers are written so that they read back to the last bit.
fn line(point: &NoisePoint, cost: f64) -> String {
    let [a, b, c, d, e] = point;
    format!("{a},{b},{c},{d},{e},{cost}\n")
}

fn trials_text(trials: &[Trial]) -> String {
    trials.iter().map(|trial| line(&trial.point, trial.cost)).collect()
}

fn append(log: &mut File, path: &Path, point: &NoisePoint, cost: f64) -> Result<(), VioError> {
    log.write_all(line(point, cost).as_bytes()).map_err(|error| VioError::unwritable(path, &error))
}

fn read_trials(path: &Path) -> Result<Vec<Trial>, VioError> {
    let text = read_text(path)?;
    let mut trials = Vec::new();
    // A last line that was cut off is computed again.
    for (index, line) in text.split_inclusive('\n').filter(|line| line.ends_with('\n')).enumerate() {
        let numbers: Option<Vec<f64>> = line.trim().split(',').map(|field| field.parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[a, b, c, d, e, cost]) => trials.push(Trial { point: [a, b, c, d, e], cost }),
            _ => return Err(VioError::malformed(path, &format!("line {}: expected six numbers", index + 1))),
        }
    }
    Ok(trials)
}
