//! Noise settings that fit recordings: five factors, found without derivatives.
//!
//! What a data sheet says about noise is not what a filter needs: vibration, lost samples and a model that is not the world
//! add to it. [`tune`] looks for the factors that make the errors over some recordings small and the covariances consistent.
//!
//! ```text
//! cost = mean over recordings of  ln ATE + w · mean |ln (NEES / 3)|
//! ```
//!
//! The logarithm keeps one bad recording from deciding; the second term fixes the level of all noise, of which the error
//! alone knows the ratios only.

mod cross_validation;
mod points;

pub use cross_validation::{HeldOut, penalty};
pub use points::PointRecording;

use bobyqa::{Bobyqa, Config, RestartConfig};

use crate::error::Error;
use crate::error::invalid;
use crate::filter::settings::Settings;
use crate::samples::ImuNoise;

/// Factors on the noise that is assumed, as powers of ten.
///
/// In this order: the gyroscope's white noise and walk, the accelerometer's white noise and walk, and what is measured in
/// images (grey levels and pixels alike).
pub type NoisePoint = [f64; 5];

/// The inertial noise and the settings with factors applied.
pub fn with_factors(noise: &ImuNoise, settings: &Settings, point: &NoisePoint) -> (ImuNoise, Settings) {
    let [gyro, gyro_walk, accel, accel_walk, image] = point.map(|power| 10_f64.powf(power));
    let noise = ImuNoise {
        gyro_density: noise.gyro_density * gyro,
        gyro_walk: noise.gyro_walk * gyro_walk,
        accel_density: noise.accel_density * accel,
        accel_walk: noise.accel_walk * accel_walk,
    };
    let mut settings = *settings;
    settings.landmarks.pixel_sigma *= image;
    settings.patches.pixel_sigma *= image;
    settings.patches.intensity_sigma *= image;
    (noise, settings)
}

/// How a search is run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TuneSettings {
    /// Evaluations of the cost at most; 200.
    pub evaluations: usize,
    /// How far from the start to look, powers of ten; 3.
    pub range: f64,
    /// First step, powers of ten; 0.5.
    pub step: f64,
    /// Last step, powers of ten; 0.01.
    pub precision: f64,
}

impl Default for TuneSettings {
    fn default() -> Self {
        Self { evaluations: 200, range: 3.0, step: 0.5, precision: 0.01 }
    }
}

/// One point that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// The factors.
    pub point: NoisePoint,
    /// What they cost.
    pub cost: f64,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned {
    /// The best point.
    pub best: Trial,
    /// All points in the order they were asked for, those known before included.
    pub trials: Vec<Trial>,
}

/// How a recording went with some noise settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Root mean square position error after alignment of position and yaw, m.
    pub ate: f64,
    /// Mean normalised squared error of position, attitude and velocity; 3 is consistent.
    pub nees: [f64; 3],
    /// Share of the recording without a usable estimate, 0 to 1.
    pub lost: f64,
}

/// Errors below this are as good as none, m.
const LEAST_ATE: f64 = 1e-4;
/// A recording that is lost altogether costs as if it were worse by this factor, and more by what was lost: graded, so
/// that the search finds its way back.
const LOSS_FACTOR: f64 = 1e4;

/// The cost of some recordings: its exponential is an error in metres, worse by the inconsistency.
pub fn cost(scores: &[Score], consistency_weight: f64) -> f64 {
    let one = |score: &Score| {
        let inconsistency = score.nees.iter().map(|nees| (nees / 3.0).clamp(1e-3, 1e6).ln().abs()).sum::<f64>() / 3.0;
        let error = score.ate.clamp(LEAST_ATE, 1e3).ln();
        error + consistency_weight * inconsistency + score.lost * LOSS_FACTOR.ln()
    };
    scores.iter().map(one).sum::<f64>() / scores.len().max(1) as f64
}

/// Looks for the point of least cost by Powell's BOBYQA (2009): a quadratic model through eleven points, inside bounds.
///
/// `known` are trials of an earlier search; where it asks for one of their points again, the cost is not computed again. The
/// search is deterministic, so that one that was interrupted goes on where it stopped. `cost` must be finite, and better a
/// slope than a cliff where recordings are lost.
pub fn tune(
    start: &NoisePoint,
    settings: &TuneSettings,
    known: &[Trial],
    mut cost: impl FnMut(&NoisePoint) -> f64,
) -> Result<Tuned, Error> {
    settings.check()?;
    if let Some(index) = start.iter().position(|power| !power.is_finite()) {
        return Err(Error::NonFinite { what: "start of the search, factor", index });
    }
    let mut config = Config::new(start.len());
    config.rho_begin = settings.step;
    config.rho_end = settings.precision;
    config.max_fun = settings.evaluations;
    // Landmarks come and go: the cost has small steps everywhere, on which one convergence rests too early.
    let mut restart = RestartConfig::new();
    restart.cycle_budget_frac = 0.0;
    restart.max_restarts = 5;
    restart.improve_rel_tol = 1e-3;
    config.restart = Some(restart);
    let refused = |_| invalid("evaluations", settings.evaluations as f64, "leaves no search");
    let mut solver = Bobyqa::new(start.len(), config).map_err(refused)?;
    let mut trials: Vec<Trial> = Vec::new();
    let mut x = *start;
    let bound = |sign: f64| start.map(|power| power + sign * settings.range);
    solver.minimize(
        |x| {
            let mut point = *start;
            point.copy_from_slice(x);
            let same = |trial: &&Trial| trial.point == point;
            let cost = known.iter().chain(&trials).find(same).map_or_else(|| cost(&point), |trial| trial.cost);
            trials.push(Trial { point, cost });
            cost
        },
        &mut x,
        &bound(-1.0),
        &bound(1.0),
    );
    let best = trials.iter().filter(|trial| trial.cost.is_finite()).min_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = *best.ok_or(Error::NonFinite { what: "cost of every trial; the first is", index: 0 })?;
    Ok(Tuned { best, trials })
}

impl TuneSettings {
    /// Refuses settings that leave no search.
    pub fn check(&self) -> Result<(), Error> {
        if !(20..=100_000).contains(&self.evaluations) {
            return Err(invalid("evaluations", self.evaluations as f64, "must be between 20 and 100000"));
        }
        if !(self.range > 0.0 && self.range <= 6.0) {
            return Err(invalid("range", self.range, "must be positive, in powers of ten, and at most 6"));
        }
        if !(self.step > 0.0 && self.step <= self.range) {
            return Err(invalid("step", self.step, "must be positive and not above the range"));
        }
        if !(self.precision > 0.0 && self.precision <= self.step) {
            return Err(invalid("precision", self.precision, "must be positive and not above the step"));
        }
        Ok(())
    }
}
