//! Levenberg-Marquardt on a pose graph.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::pose_graph::factors::{BetweenFactor, PriorFactor};
use crate::pose_graph::normal_equations::NormalEquations;
use crate::pose_graph::se3::exp;

/// Damping at the start, as a share of the diagonal.
const FIRST_DAMPING: f64 = 1e-6;
/// Damping below this has no effect, above this no step is left.
const DAMPING: [f64; 2] = [1e-12, 1e9];

/// How a pose graph is optimised.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct PoseGraphSettings {
    /// Most factorisations (100).
    pub max_iterations: usize,
    /// Done when a step lowers the cost by less than this share (1e-8).
    pub least_decrease: f64,
}

impl Default for PoseGraphSettings {
    fn default() -> Self {
        Self { max_iterations: 100, least_decrease: 1e-8 }
    }
}

/// What optimising a pose graph gave. Costs are `½ Σ ρ(χ²)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGraphReport {
    /// Before.
    pub initial_cost: f64,
    /// After.
    pub cost: f64,
    /// Factorisations.
    pub iterations: usize,
    /// Whether the last step changed the cost as little as was asked for; if not, `max_iterations` came first.
    pub converged: bool,
}

/// `½ Σ ρ(χ²)`.
pub(crate) fn cost(poses: &[Isometry3<f64>], betweens: &[BetweenFactor], priors: &[PriorFactor]) -> f64 {
    let between = |f: &BetweenFactor| {
        let residual = f.residual(&poses[f.first], &poses[f.second]);
        f.kernel.evaluate(residual.dot(&(f.information * residual))).0
    };
    let prior = |f: &PriorFactor| {
        let residual = f.residual(&poses[f.pose]);
        residual.dot(&(f.information * residual))
    };
    0.5 * (betweens.iter().map(between).sum::<f64>() + priors.iter().map(prior).sum::<f64>())
}

/// Minimises the cost over the poses that are not fixed.
pub(crate) fn minimise(
    poses: &mut [Isometry3<f64>],
    fixed: &[bool],
    betweens: &[BetweenFactor],
    priors: &[PriorFactor],
    settings: &PoseGraphSettings,
) -> Result<PoseGraphReport, Error> {
    let mut equations = NormalEquations::new(fixed, betweens, &[])?;
    let initial_cost = cost(poses, betweens, priors);
    let mut report = PoseGraphReport { initial_cost, cost: initial_cost, iterations: 0, converged: false };
    if equations.b.is_empty() {
        return Ok(PoseGraphReport { converged: true, ..report });
    }
    let diagonal: Vec<usize> = equations.h.diagonal().collect();
    let (mut damping, mut growth) = (FIRST_DAMPING, 2.0);
    let mut candidate = poses.to_vec();
    'outer: while report.iterations < settings.max_iterations {
        equations.assemble(poses, betweens, priors);
        let own: Vec<f64> = diagonal.iter().map(|&at| equations.h.values[at]).collect();
        while report.iterations < settings.max_iterations {
            for (&at, own) in diagonal.iter().zip(&own) {
                equations.h.values[at] = own * (1.0 + damping);
            }
            report.iterations += 1;
            let mut step = -&equations.b;
            let solved = equations.h.factorise();
            if solved.is_ok() {
                equations.h.solve(step.as_mut_slice());
                for ((new, old), block) in candidate.iter_mut().zip(poses.iter()).zip(&equations.blocks) {
                    if let Some(block) = block {
                        *new = old * exp(&step.fixed_rows::<6>(6 * block).into_owned());
                        new.rotation.renormalize();
                    }
                }
                let there = cost(&candidate, betweens, priors);
                let decrease = report.cost - there;
                if decrease >= 0.0 {
                    // What the quadratic model says: ½ δᵀ (λ D δ − b).
                    let pulls = diagonal.iter().zip(&own).zip(step.iter()).map(|((_, own), s)| damping * own * s * s);
                    let expected = 0.5 * (pulls.sum::<f64>() - step.dot(&equations.b));
                    poses.copy_from_slice(&candidate);
                    let least = settings.least_decrease * report.cost;
                    report.cost = there;
                    // Nielsen 1999.
                    let gain = decrease / expected.max(f64::MIN_POSITIVE);
                    damping = (damping * (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.1, 0.5)).max(DAMPING[0]);
                    growth = 2.0;
                    if decrease <= least || there == 0.0 {
                        report.converged = true;
                        break 'outer;
                    }
                    continue 'outer;
                }
                if expected_is_noise(report.cost, decrease) {
                    report.converged = true;
                    break 'outer;
                }
            }
            damping *= growth;
            growth *= 2.0;
            if damping > DAMPING[1] {
                // Nothing lowers the cost; or nothing could be solved.
                solved?;
                report.converged = true;
                break 'outer;
            }
        }
    }
    Ok(report)
}

/// Whether a step that made it worse did so by rounding only.
fn expected_is_noise(cost: f64, decrease: f64) -> bool {
    -decrease <= 1e-13 * cost
}
