//! Strokes along the lines of line art, rows for the rest.

use super::distance::distances;
use super::fitting::{ink_cost, missing_ink, prune_with, uniform_volume};
use super::placed_sprays::PlacedSprays;
use super::trace::{Line, trace};
use crate::error::{Error, require};
use crate::optimise::{StoppingRule, minimise};
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings, boustrophedon};
use crate::problem::{PaintGrid, PaintProblem};

/// Share of the darkest ink below which nothing is worth a row of its own beside lines.
const LEFT_OVER: f64 = 0.02;

/// Non-negative deconvolution whose sprays lie along the lines of the picture: what is thin and dark is painted in strokes along
/// its middle, everything else in rows as by [`Deconvolution`](crate::Deconvolution). Ours.
///
/// Where more than half of the darkest ink is missing the picture is thinned to its centrelines (Zhang and Suen 1984). Those that
/// are narrow become strokes, smoothed, with a spray every [`Limits::spray_spacing`](crate::Limits::spray_spacing) pixels;
/// the cells of the grid beside them are left out. The volumes of all sprays are fitted together. [`Painting::strokes`] holds
/// the strokes. A picture without lines is painted as by `Deconvolution`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Centrelines {
    /// Half the width up to which something dark is a line, in deviations of the nozzle. Default 2, ours.
    pub max_half_width: f64,
    /// Weight of the differences between neighbours on a line against the ink: volumes that change little along a line keep the
    /// valve open. Default 0.1, ours.
    pub smoothness: f64,
    /// Largest number of iterations of the fit. Default 200, ours.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row. Default 1e-5, ours.
    pub tolerance: f64,
}

impl Default for Centrelines {
    fn default() -> Self {
        Self { max_half_width: 2.0, smoothness: 0.1, iterations: 200, tolerance: 1e-5 }
    }
}

impl Painter for Centrelines {
    fn name(&self) -> &'static str {
        "centrelines"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        let half_width = self.max_half_width;
        require("max_half_width", half_width, half_width > 0.0 && half_width <= 1e4, "it must lie in (0, 10000]")?;
        let smoothness = self.smoothness;
        require("smoothness", smoothness, (0.0..=1e6).contains(&smoothness), "it must lie in [0, 1000000]")?;
        require("tolerance", self.tolerance, self.tolerance >= 0.0, "it must be 0 or more")?;
        let grid = PaintGrid::new(problem)?;
        let reach = half_width * problem.kernel.sigma();
        let missing = missing_ink(problem, &grid);
        let darker_than = |share: f64| {
            let least = share * missing.iter().fold(0.0_f64, |most, &m| most.max(m));
            missing.iter().map(|&m| m > least).collect::<Vec<_>>()
        };
        let lines = trace(&darker_than(0.5), problem.reference.width(), reach);
        let rest = left_over(&lines, &darker_than(LEFT_OVER), problem, reach);
        let placed = PlacedSprays::new(problem, &grid, &sampled(&lines, problem), &rest);

        // In units of what the square of a volume costs on white paper.
        let stiffness = smoothness * std::f64::consts::PI * problem.kernel.sigma().powi(2);
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: self.tolerance };
        let fit = |upper_bounds: &[f64], volumes: &mut Vec<f64>, progress: &mut dyn FnMut(f64)| {
            let mut canvas = grid.initial.data().to_vec();
            let mut cost = |v: &[f64], gradient: &mut [f64]| {
                canvas.copy_from_slice(grid.initial.data());
                placed.deposit(v, &mut canvas);
                problem.settle(grid.initial.data(), &mut canvas);
                let value = ink_cost(problem, problem.saturation, &mut canvas);
                problem.settle_adjoint(&mut canvas);
                placed.adjoint(&canvas, gradient);
                value + placed.roughness(v, stiffness, gradient)
            };
            minimise(volumes, upper_bounds, &stop, &mut cost, progress);
        };
        let start = uniform_volume(problem, &grid);
        let upper_bounds = placed.upper_bounds(problem.limits.max_volume);
        let mut volumes: Vec<f64> = upper_bounds.iter().map(|upper| upper.min(start)).collect();
        fit(&upper_bounds, &mut volumes, &mut |share| observer.progress(share));
        prune_with(&upper_bounds, problem.limits, &mut volumes, &mut |upper_bounds, volumes| {
            fit(upper_bounds, volumes, &mut |_| ());
        });
        observer.progress(1.0);

        let settings = StrokeSettings::default();
        let (along, rows) = placed.sprays(&volumes, settings.max_gap);
        let mut strokes: Vec<Stroke> = along.into_iter().map(|sprays| Stroke { sprays }).collect();
        strokes.extend(boustrophedon(&rows, &settings)?);
        let sprays = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        Ok(Painting { strokes, ..Painting::render(problem, sprays) })
    }
}

/// Places of sprays along each line, as far apart as on the grid.
fn sampled(lines: &[Line], problem: &PaintProblem) -> Vec<Vec<[f64; 2]>> {
    lines.iter().map(|line| line.sampled(problem.limits.spray_spacing as f64)).collect()
}

/// The pixels from which cells of the grid may spray: those beside something dark that is farther from every line than half the
/// widest. All of them where there is no line.
fn left_over(lines: &[Line], dark: &[bool], problem: &PaintProblem, reach: f64) -> Vec<bool> {
    if lines.is_empty() {
        return vec![true; dark.len()];
    }
    let width = problem.reference.width();
    let mut on_line = vec![false; dark.len()];
    for [x, y] in lines.iter().flat_map(|line| &line.points) {
        on_line[y.round() as usize * width + x.round() as usize] = true;
    }
    let from_line = distances(&on_line, width);
    let rest: Vec<bool> = dark.iter().zip(&from_line).map(|(&dark, &from)| dark && from > reach + 0.5).collect();
    let cell = problem.limits.spray_spacing.max(problem.limits.row_spacing) as f64;
    distances(&rest, width).iter().zip(&from_line).map(|(&to, &from)| to <= cell && from > reach + 0.5).collect()
}
