//! Strokes that cover whole regions.

mod cells;
mod spacing;

use super::fitting::{missing_ink, prune_with};
use super::placed_sprays::PlacedSprays;
use super::trace::trace;
use crate::error::{Error, require};
use crate::optimise::{StoppingRule, minimise};
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings};
use crate::problem::{PaintGrid, PaintProblem};
use cells::{cells, uncovered};
use spacing::row_spacing;

/// Share of the darkest ink below which nothing is wanted.
const BARE: f64 = 0.02;

/// Covers all that shall have paint, holes left out, with rows as far apart as the spray allows (Paper II, section 6.3, by hand there;
/// ours).
///
/// Rows run in the direction in which the regions break into the fewest runs. Runs that follow each other from row to row without a
/// branch are a cell, flown to and fro (boustrophedon decomposition, Choset 2000); a hole parts cells. Where rows end raggedly,
/// strokes along the rim cover what they leave. The volumes of all sprays are fitted together to the wanted depth (not to the ink,
/// which saturates), so that rims get as much paint as the middle. [`Painting::strokes`] holds a stroke for each cell and each rim.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct AreaFill {
    /// Largest standard deviation of the depth across rows of equal sprays, over its mean: the spacing of the rows follows from it
    /// and from the spray's profile. Default 0.005, ours: where a chart is stretched the rows lie farther apart.
    pub ripple: f64,
    /// Weight of the differences between neighbours on a stroke against the depth. Default 0.1, ours.
    pub smoothness: f64,
    /// Largest number of iterations of the fit. Default 200, ours.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row. Default 1e-5, ours.
    pub tolerance: f64,
}

impl Default for AreaFill {
    fn default() -> Self {
        Self { ripple: 0.005, smoothness: 0.1, iterations: 200, tolerance: 1e-5 }
    }
}

impl Painter for AreaFill {
    fn name(&self) -> &'static str {
        "area fill"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        let Self { ripple, smoothness, tolerance, .. } = *self;
        require("ripple", ripple, (1e-6..=0.5).contains(&ripple), "it must lie in [0.000001, 0.5]")?;
        require("smoothness", smoothness, (0.0..=1e6).contains(&smoothness), "it must lie in [0, 1000000]")?;
        require("tolerance", tolerance, tolerance >= 0.0, "it must be 0 or more")?;
        let grid = PaintGrid::new(problem)?;
        let width = problem.reference.width();
        let region = region(problem, &grid);
        let max_gap = StrokeSettings::default().max_gap;
        let along = problem.limits.spray_spacing as f64;
        let across = row_spacing(problem.kernel, ripple);
        let mut lines = cells(&region, width, across, along, max_gap);
        let left = uncovered(&lines, &region, width, across, along);
        lines.extend(trace(&left, width, across).iter().map(|line| line.sampled(along)));
        // Smoothing may have drawn a rim out of its region: such places would stay shut.
        let inside = |&[x, y]: &[f64; 2]| region[y.round() as usize * width + x.round() as usize];
        for line in &mut lines {
            line.retain(inside);
        }
        lines.retain(|line| !line.is_empty());
        let placed = PlacedSprays::new(problem, &grid, &lines, &vec![false; region.len()]);

        let wanted: Vec<f64> = problem.reference.data().iter().map(|&ink| problem.saturation.inverse(ink)).collect();
        // In units of what the square of a volume costs.
        let stiffness = smoothness * std::f64::consts::PI * problem.kernel.sigma().powi(2);
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: tolerance };
        let fit = |upper_bounds: &[f64], volumes: &mut Vec<f64>, progress: &mut dyn FnMut(f64)| {
            let mut canvas = grid.initial.data().to_vec();
            let mut cost = |v: &[f64], gradient: &mut [f64]| {
                canvas.copy_from_slice(grid.initial.data());
                placed.deposit(v, &mut canvas);
                problem.settle(grid.initial.data(), &mut canvas);
                let value = depth_cost(problem, &wanted, &mut canvas);
                problem.settle_adjoint(&mut canvas);
                placed.adjoint(&canvas, gradient);
                value + placed.roughness(v, stiffness, gradient)
            };
            minimise(volumes, upper_bounds, &stop, &mut cost, progress);
        };
        let upper_bounds = placed.upper_bounds(problem.limits.max_volume);
        let start = mean_depth(&wanted, &region) * along * across / problem.kernel.mass();
        let mut volumes: Vec<f64> = upper_bounds.iter().map(|upper| upper.min(start)).collect();
        fit(&upper_bounds, &mut volumes, &mut |share| observer.progress(share));
        prune_with(&upper_bounds, problem.limits, &mut volumes, &mut |upper_bounds, volumes| {
            fit(upper_bounds, volumes, &mut |_| ());
        });
        observer.progress(1.0);

        let (strokes, _) = placed.sprays(&volumes, max_gap);
        let strokes: Vec<Stroke> = strokes.into_iter().map(|sprays| Stroke { sprays }).collect();
        let sprays = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        Ok(Painting { strokes, ..Painting::render(problem, sprays) })
    }
}

/// Pixels that shall have more paint and over which the nozzle may spray.
fn region(problem: &PaintProblem, grid: &PaintGrid) -> Vec<bool> {
    let missing = missing_ink(problem, grid);
    let least = BARE * missing.iter().fold(0.0_f64, |most, &m| most.max(m));
    let may = |k: usize| problem.paintable.is_none_or(|mask| mask[k]) && problem.weight(k) > 0.0;
    missing.iter().enumerate().map(|(k, &m)| m > least && may(k)).collect()
}

/// `½ Σ w (c - d)²`; replaces the canvas by its derivative with respect to each pixel's depth.
fn depth_cost(problem: &PaintProblem, wanted: &[f64], canvas: &mut [f64]) -> f64 {
    let mut value = 0.0;
    for (k, (depth, wanted)) in canvas.iter_mut().zip(wanted).enumerate() {
        let (weight, residual) = (problem.weight(k), *depth - wanted);
        value += 0.5 * weight * residual * residual;
        *depth = weight * residual;
    }
    value
}

fn mean_depth(wanted: &[f64], region: &[bool]) -> f64 {
    let (sum, count) =
        wanted.iter().zip(region).filter(|(_, inside)| **inside).fold((0.0, 0.0), |(s, n), (d, _)| (s + d, n + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    /// What replaces the canvas is the derivative of the cost, by differences, each pixel by its own weight.
    #[test]
    fn the_depth_that_is_missing_is_weighed() {
        let wanted = [0.4, 0.1, 0.9, 0.0, 0.7, 0.3];
        let weight = Image::from_fn(3, 2, |x, y| 0.25 * (x + 3 * y) as f64);
        let reference = Image::from_fn(3, 2, |_, _| 0.5);
        let problem = PaintProblem { weight: Some(&weight), ..PaintProblem::new(&reference) };
        let depths = [0.1, 0.6, 0.2, 0.5, 0.0, 0.3];
        let cost = |depths: [f64; 6]| {
            let mut canvas = depths;
            (depth_cost(&problem, &wanted, &mut canvas), canvas)
        };
        let by_hand: f64 = (0..6).map(|k| 0.5 * 0.25 * k as f64 * (depths[k] - wanted[k]).powi(2)).sum();
        assert!((cost(depths).0 - by_hand).abs() < 1e-15);
        for k in 0..6 {
            let moved = |h: f64| {
                let mut depths = depths;
                depths[k] += h;
                cost(depths).0
            };
            let slope = (moved(1e-4) - moved(-1e-4)) / 2e-4;
            assert!((cost(depths).1[k] - slope).abs() < 1e-9, "pixel {k}: {slope}");
        }
    }
}
