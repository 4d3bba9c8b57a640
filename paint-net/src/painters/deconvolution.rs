//! Non-negative deconvolution on the grid.

use super::fitting::{fit, prune, uniform_volume};
use crate::error::{Error, require};
use crate::optimise::StoppingRule;
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::problem::{PaintGrid, PaintProblem};

/// Non-negative deconvolution with the spray kernel: the volumes of all cells at once, optimal in ink.
///
/// Minimises `½ Σ w (f(c₀ + G v) - y)²` over `0 ≤ v ≤ v_max` by projected L-BFGS, from the flat start
/// `mean(f⁻¹(y)) · cell area / footprint mass`. Ours; the papers' painter is a network, and their "ideal" a Gaussian filter.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Deconvolution {
    /// Largest number of iterations. Default 200, ours.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row. Default 1e-5, ours.
    pub tolerance: f64,
}

impl Default for Deconvolution {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-5 }
    }
}

impl Painter for Deconvolution {
    fn name(&self) -> &'static str {
        "deconvolution"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        require("tolerance", self.tolerance, self.tolerance >= 0.0, "it must be 0 or more")?;
        let grid = PaintGrid::new(problem)?;
        let start = uniform_volume(problem, &grid);
        let mut volumes: Vec<f64> = grid.upper_bounds.iter().map(|&upper| start.min(upper)).collect();
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: self.tolerance };
        fit(problem, &grid, &grid.upper_bounds, &mut volumes, &stop, &mut |share| observer.progress(share));
        prune(problem, &grid, &mut volumes, &stop);
        observer.progress(1.0);
        Ok(Painting::new(grid.sprays(&volumes), grid.canvas(problem, &volumes), problem.saturation))
    }
}
