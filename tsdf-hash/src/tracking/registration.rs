//! Levenberg-Marquardt at one level of the pyramid.

use nalgebra::{Isometry3, Vector6};

use crate::tracking::directions::Directions;
use crate::tracking::pose::moved;
use crate::tracking::residuals::{Comparison, Evaluation, Scales};

/// Steps below this are not worth another iteration, radians and metres.
const LEAST_STEP: f64 = 1e-6;
/// Distances are not known better than this share of the noise model (ours).
const LEAST_DEPTH_SCALE: f64 = 0.1;
/// Intensities are not known better than this, grey levels: those of the map have six bits.
const LEAST_INTENSITY_SCALE: f64 = 1.5;

/// Where the search has come to.
#[derive(Clone)]
pub(crate) struct Registration {
    pub(crate) pose: Isometry3<f64>,
    pub(crate) scales: Scales,
    pub(crate) brightness: f32,
    pub(crate) iterations: usize,
    /// What more steps like the last ones would have added.
    pub(crate) remainder: Vector6<f64>,
}

/// Steps that shrink by less than this are taken to shrink by it.
const SLOWEST: f64 = 0.95;

impl Registration {
    pub(crate) fn new(pose: Isometry3<f64>) -> Self {
        // The median is taken before the first step; until then, what a stranger's camera may have.
        Self {
            pose,
            scales: Scales { depth: 1.0, intensity: 10.0 },
            brightness: 0.0,
            iterations: 0,
            remainder: Vector6::zeros(),
        }
    }

    /// Minimises the cost at one level, along the directions that have `least_share` of the information of the best known one, and
    /// returns what it is at the end.
    pub(crate) fn refine(&mut self, comparison: &Comparison, most: usize, least_share: f64) -> Evaluation {
        let first = comparison.evaluate(&self.pose, self.scales, self.brightness);
        self.rescale(&first);
        let mut here = comparison.evaluate(&self.pose, self.scales, self.brightness);
        // Means, because the partners change with the pose.
        let share = here.share();
        let mut damping = 1e-6;
        let mut step_before = f64::INFINITY;
        self.remainder = Vector6::zeros();
        for _ in 0..most {
            self.iterations += 1;
            let Some(delta) = solve(&here, damping, least_share) else { break };
            let candidate = moved(&self.pose, &delta);
            let there = comparison.evaluate(&candidate, self.scales, self.brightness);
            if there.mean_cost(share) <= here.mean_cost(share) {
                self.pose = candidate;
                here = there;
                damping *= 0.1;
                let shrunk = (delta.norm() / step_before).min(SLOWEST);
                step_before = delta.norm();
                self.remainder = delta * (shrunk / (1.0 - shrunk));
                if delta.amax() < LEAST_STEP {
                    break;
                }
            } else {
                damping = (damping * 100.0).max(1e-3);
                if damping > 1e6 {
                    break;
                }
            }
        }
        self.rescale(&here);
        here
    }

    fn rescale(&mut self, found: &Evaluation) {
        self.scales.depth = found.depth.deviation().max(LEAST_DEPTH_SCALE) as f32;
        if found.intensity.total > 0 {
            self.scales.intensity = found.intensity.deviation().max(LEAST_INTENSITY_SCALE) as f32;
        }
        self.brightness = found.brightness();
    }
}

/// The damped step; `None` where nothing constrains it.
fn solve(here: &Evaluation, damping: f64, least_share: f64) -> Option<Vector6<f64>> {
    let delta = Directions::new(&here.equations, here.mean_depth(), least_share)?.gauss_newton(damping);
    delta.iter().all(|x| x.is_finite()).then_some(delta)
}
