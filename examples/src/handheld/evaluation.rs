//! The planner on many scenarios: how long it takes, and how its paths rank among all there are (handheld paper, Section VI-A).

use std::fmt::Write as _;
use std::time::Instant;

use cpu_time::ProcessTime;
use paint_planner::gantry::{
    BeamSettings, GantryPlan, PaintModel, all_paths, greedy_path, plan_gantry, random_path, rank, refine,
};

use super::error::HandheldError;
use super::forecast::{Forecast, PaintDevice, PaintJob};
use super::object::{PaintObject, SurfaceSample};
use super::scenario::Scenario;
use super::settings::HandheldSettings;

/// What became of each scenario.
#[derive(Debug, Clone, Default)]
pub struct Evaluation {
    /// Wall-clock time of each decision, ms: density, graph, path, simulation of the first segment.
    pub decision_ms: Vec<f64>,
    /// Processor time of each decision, all threads together, ms.
    pub decision_cpu_ms: Vec<f64>,
    /// Wall-clock time with the beam, ms.
    pub beam_ms: Vec<f64>,
    /// The greedy planner's.
    pub greedy_ms: Vec<f64>,
    /// Number of all paths of each scenario.
    pub paths: Vec<usize>,
    /// Rank over number of the paths.
    pub ranks: Vec<f64>,
    /// The same with the beam.
    pub beam_ranks: Vec<f64>,
    /// The greedy planner's.
    pub greedy_ranks: Vec<f64>,
    /// Those of random paths.
    pub random_ranks: Vec<f64>,
    /// Paint of the path over that of the best of all, where that places any.
    pub paint_shares: Vec<f64>,
}

impl Evaluation {
    /// Share of the scenarios whose path is among the best twentieth.
    pub fn top5_share(&self) -> f64 {
        let top = self.ranks.iter().filter(|rank| **rank <= 0.05).count();
        top as f64 / self.ranks.len().max(1) as f64
    }
}

/// Mean; 0 of nothing.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Mean and standard deviation of a sample; 0 of nothing.
pub(super) fn mean_and_deviation(values: &[f64]) -> [f64; 2] {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    [mean, (squares / values.len().saturating_sub(1).max(1) as f64).sqrt()]
}

/// The value below which this share of the values lies (the nearest one); 0 of nothing.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let index = ((sorted.len() as f64 * share).ceil() as usize).max(1) - 1;
    sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// One decision with its wall-clock and processor time, ms: density, graph, best path, the beam if asked for, and the first segment simulated.
fn decide(
    forecast: &mut Forecast,
    scenario: &Scenario,
    settings: &HandheldSettings,
    beam: Option<&BeamSettings>,
) -> Result<(GantryPlan, [f64; 2]), HandheldError> {
    let (start, cpu) = (Instant::now(), ProcessTime::try_now().ok());
    let mut plan = plan_gantry(forecast, scenario.state, &settings.planner())?;
    if let Some(beam) = beam {
        refine(&mut plan, forecast, beam)?;
    }
    let _ = forecast.outcome(&plan.path()[..1]);
    let cpu = cpu.and_then(|start| start.try_elapsed().ok()).unwrap_or_default();
    Ok((plan, [start.elapsed(), cpu].map(|time| 1e3 * time.as_secs_f64())))
}

/// Runs `scenarios` scenarios of each seed; `progress` is told the share done.
///
/// # Errors
/// Settings that simulator or planner refuse.
pub fn evaluate(
    object: &PaintObject,
    faces: &[SurfaceSample],
    device: &mut dyn PaintDevice,
    settings: &HandheldSettings,
    (scenarios, seeds): (usize, std::ops::Range<u64>),
    progress: &dyn Fn(f64),
) -> Result<Evaluation, HandheldError> {
    let job = PaintJob::new(&object.surface, settings)?;
    let mut evaluation = Evaluation::default();
    let total = (scenarios as f64 * (seeds.end - seeds.start) as f64).max(1.0);
    for seed in seeds {
        for number in 0..scenarios {
            let scenario = Scenario::new(object, faces, &job, seed, number)?;
            evaluation.add(&job, device, &scenario, seed)?;
            progress(evaluation.ranks.len() as f64 / total);
        }
    }
    Ok(evaluation)
}

/// Processor time of a decision with `other` settings over that with `settings`, medians over `count` scenarios by turns.
///
/// # Errors
/// Settings that simulator or planner refuse.
pub fn time_ratio(
    object: &PaintObject,
    faces: &[SurfaceSample],
    device: &mut dyn PaintDevice,
    [other, settings]: [&HandheldSettings; 2],
    count: usize,
) -> Result<f64, HandheldError> {
    let (job, other_job) = (PaintJob::new(&object.surface, settings)?, PaintJob::new(&object.surface, other)?);
    let mut times = [Vec::new(), Vec::new()];
    for number in 0..count {
        let scenario = Scenario::new(object, faces, &job, 0, number)?;
        for (job, times) in [&other_job, &job].into_iter().zip(&mut times) {
            let mut forecast = Forecast::new(job, &scenario.coverage, device, &scenario.sweep)?;
            let (_, milliseconds) = decide(&mut forecast, &scenario, job.settings, None)?;
            forecast.check()?;
            times.push(milliseconds[1]);
        }
    }
    Ok(quantile(&times[0], 0.5) / quantile(&times[1], 0.5))
}

impl Evaluation {
    /// Ranks over the number of all paths as the curves of the paper's Fig. 5, each from best to worst, in per cent: CSV.
    pub(super) fn rank_curves(&self) -> String {
        let curve = |ranks: &Vec<f64>| {
            let mut ranks = ranks.clone();
            ranks.sort_by(f64::total_cmp);
            ranks
        };
        let [planned, greedy, random] = [&self.ranks, &self.greedy_ranks, &self.random_ranks].map(curve);
        let mut table = String::from("trial,planned_percent,greedy_percent,random_percent\n");
        for k in 0..planned.len() {
            let [a, b, c] = [planned[k], greedy[k], random[k]].map(|rank| 100.0 * rank);
            let _ = writeln!(table, "{},{a:.2},{b:.2},{c:.2}", k + 1);
        }
        table
    }

    fn add(
        &mut self,
        job: &PaintJob,
        device: &mut dyn PaintDevice,
        scenario: &Scenario,
        seed: u64,
    ) -> Result<(), HandheldError> {
        let (settings, coverage, sweep) = (job.settings, &scenario.coverage, &scenario.sweep);
        // Each planner starts without the hits that another has cast.
        let mut forecast = Forecast::new(job, coverage, device, sweep)?;
        let (plan, milliseconds) = decide(&mut forecast, scenario, settings, None)?;
        forecast.check()?;
        self.decision_ms.push(milliseconds[0]);
        self.decision_cpu_ms.push(milliseconds[1]);
        let mut forecast = Forecast::new(job, coverage, device, sweep)?;
        let beam_settings = settings.beam.unwrap_or_default();
        let (beam, milliseconds) = decide(&mut forecast, scenario, settings, Some(&beam_settings))?;
        forecast.check()?;
        self.beam_ms.push(milliseconds[0]);
        let mut forecast = Forecast::new(job, coverage, device, sweep)?;
        let start = Instant::now();
        let greedy = greedy_path(&mut forecast, &plan.lattice);
        self.greedy_ms.push(1e3 * start.elapsed().as_secs_f64());

        let all = all_paths(&mut forecast, &plan.lattice);
        let mut paint = |speeds: &[i32]| forecast.simulate(&plan.lattice.path(speeds));
        let relative = |paint: f64| rank(paint, &all) as f64 / all.len() as f64;
        let mine = paint(&plan.speeds);
        self.paths.push(all.len());
        self.ranks.push(relative(mine));
        self.beam_ranks.push(relative(paint(&beam.speeds)));
        self.greedy_ranks.push(relative(paint(&greedy)));
        self.random_ranks.push(relative(paint(&random_path(&plan.lattice, seed + self.paths.len() as u64))));
        let most = all.iter().copied().fold(0.0, f64::max);
        if most > 0.0 {
            self.paint_shares.push(mine / most);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn a_quantile_is_one_of_the_values() {
        let values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!([0.0, 0.2, 0.5, 0.95, 1.0].map(|share| quantile(&values, share)), [1.0, 1.0, 3.0, 5.0, 5.0]);
        assert_eq!(quantile(&[], 0.5), 0.0);
    }
}
