//! The figures of a run.

use paint_sim::droplets::CoverageFigures;
use serde::Serialize;

use super::evaluation::{Evaluation, mean, mean_and_deviation, quantile};
use super::painting::PaintingLog;

/// `report.json`: flat, SI units in the names unless they say otherwise.
#[derive(Debug, Clone, Default, Serialize)]
pub struct HandheldReport {
    /// Version of the program.
    pub version: &'static str,
    /// Where the density was computed.
    pub device: String,
    /// Threads of the density map.
    pub threads: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Scenarios of the evaluation; 0 without one.
    pub scenarios: usize,
    /// Wall-clock time of a decision, median: density, graph, path, first segment simulated; of the scenarios, else of the painting.
    pub decision_ms_median: f64,
    /// The same, 99 %.
    pub decision_ms_p99: f64,
    /// Processor time of a decision, all threads together, median; 0 without an evaluation.
    pub decision_cpu_ms_median: f64,
    /// Wall-clock time of a decision, mean and standard deviation, as Table I of the paper has them; 0 without an evaluation.
    pub decision_ms_mean: f64,
    /// See above.
    pub decision_ms_deviation: f64,
    /// The greedy planner's mean.
    pub greedy_ms_mean: f64,
    /// Its standard deviation.
    pub greedy_ms_deviation: f64,
    /// Wall-clock time with the beam, median.
    pub beam_decision_ms_median: f64,
    /// Mean over the scenarios of rank over number of all paths, by paint placed in simulation.
    pub mean_rank_fraction: f64,
    /// Share of the scenarios whose path is among the best twentieth.
    pub top5_share: f64,
    /// Mean rank of the greedy planner.
    pub greedy_mean_rank_fraction: f64,
    /// Mean rank of random paths.
    pub random_mean_rank_fraction: f64,
    /// Mean rank with the beam.
    pub beam_mean_rank_fraction: f64,
    /// Mean rank of the path that Eqs. (1), (3) and (4) as printed give.
    pub paper_literal_mean_rank_fraction: f64,
    /// Time of a decision with a horizon of 30 and 9 directions over that of the base setting, medians.
    pub long_horizon_time_ratio: f64,
    /// Length of the painting.
    pub painting_s: f64,
    /// Paint on the target, up to the target of each texel, over the target's mass; on the true object.
    pub paint_inside_fraction: f64,
    /// Paint beside the target over the target's mass.
    pub paint_outside_fraction: f64,
    /// Paint on the target above it, over the target's mass.
    pub paint_above_fraction: f64,
    /// Texels of the surface with more than their target and a tenth of a full coat, over all texels of the surface.
    pub overdosed_texels_fraction: f64,
    /// Those of them where paint is wanted, over all texels of the surface.
    pub overdosed_wanted_texels_fraction: f64,
    /// Those of them where none is wanted, over all texels of the surface.
    pub overdosed_bare_texels_fraction: f64,
    /// As the robot believes it to be.
    pub believed_inside_fraction: f64,
    /// As the robot believes it to be.
    pub believed_outside_fraction: f64,
    /// Root mean square of what the robot's books are off by where a full coat is wanted, in coats.
    pub believed_thickness_error_fraction: f64,
    /// Paint that left the nozzle.
    pub emitted_m3: f64,
    /// Decisions of the painting.
    pub decisions: usize,
    /// Those in which no paint was needed within the horizon.
    pub idle_decisions: usize,
    /// Those that fell out because the robot was not tracked.
    pub held_decisions: usize,
    /// Time without a measured pose.
    pub tracking_lost_s: f64,
    /// Measured poses so far from the expected ones that the filter started anew.
    pub pose_jumps: usize,
    /// Longest time from a loss of the markers to the command that shuts the valve.
    pub valve_shut_after_loss_s: f64,
    /// Times that the nozzle ran into a limit switch.
    pub limit_switch_hits: usize,
    /// Times that the valve was switched.
    pub valve_switches: usize,
    /// Error of the believed position of the robot, root mean square over time, all three coordinates.
    pub position_error_rms_m: f64,
    /// Error of the believed place of the object at the end.
    pub registration_error_m: f64,
}

impl HandheldReport {
    /// What the evaluation found.
    pub fn evaluated(&mut self, evaluation: &Evaluation) {
        self.scenarios = evaluation.ranks.len();
        self.decision_ms_median = quantile(&evaluation.decision_ms, 0.5);
        self.decision_ms_p99 = quantile(&evaluation.decision_ms, 0.99);
        self.decision_cpu_ms_median = quantile(&evaluation.decision_cpu_ms, 0.5);
        [self.decision_ms_mean, self.decision_ms_deviation] = mean_and_deviation(&evaluation.decision_ms);
        [self.greedy_ms_mean, self.greedy_ms_deviation] = mean_and_deviation(&evaluation.greedy_ms);
        self.beam_decision_ms_median = quantile(&evaluation.beam_ms, 0.5);
        self.mean_rank_fraction = mean(&evaluation.ranks);
        self.top5_share = evaluation.top5_share();
        self.greedy_mean_rank_fraction = mean(&evaluation.greedy_ranks);
        self.random_mean_rank_fraction = mean(&evaluation.random_ranks);
        self.beam_mean_rank_fraction = mean(&evaluation.beam_ranks);
    }

    /// What the painting left.
    pub fn painted(&mut self, log: &PaintingLog) {
        let (truth, belief): (CoverageFigures, CoverageFigures) = (log.truth.figures(), log.belief.figures());
        if self.scenarios == 0 {
            self.decision_ms_median = quantile(&log.decision_ms, 0.5);
            self.decision_ms_p99 = quantile(&log.decision_ms, 0.99);
        }
        self.painting_s = log.duration();
        self.paint_inside_fraction = truth.inside;
        self.paint_outside_fraction = truth.outside;
        self.paint_above_fraction = truth.above;
        self.overdosed_texels_fraction = truth.overdosed();
        self.overdosed_wanted_texels_fraction = truth.overdosed_wanted;
        self.overdosed_bare_texels_fraction = truth.overdosed_bare;
        self.believed_inside_fraction = belief.inside;
        self.believed_outside_fraction = belief.outside;
        self.believed_thickness_error_fraction = log.truth.difference(&log.belief);
        self.emitted_m3 = log.emitted;
        self.decisions = log.decision_ms.len();
        self.idle_decisions = log.idle_decisions;
        self.held_decisions = log.held_decisions;
        self.tracking_lost_s = log.lost_ticks as f64 * log.tick();
        self.pose_jumps = log.pose_jumps;
        self.valve_shut_after_loss_s = log.shut_after_loss;
        self.limit_switch_hits = log.limit_hits;
        self.valve_switches = log.valve_switches;
        self.position_error_rms_m = log.position_error_rms;
        self.registration_error_m = log.registration_error;
    }
}
