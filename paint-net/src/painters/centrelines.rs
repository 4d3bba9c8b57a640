//! Strokes along the lines of line art, rows for the rest.

use super::drawn_lines::DrawnLines;
use super::fitting::{prune_with, uniform_volume};
use super::placed_sprays::PlacedSprays;
use super::trace::{Line, trace};
use crate::error::{Error, require};
use crate::optimise::StoppingRule;
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings, boustrophedon};
use crate::problem::{PaintGrid, PaintProblem};

/// How often the volumes are fitted. In the last round, what is still bare has strokes of its own.
const ROUNDS: u32 = 8;
/// How many times as much missing ink counts in the next round, where a line was left bare.
const MORE: f64 = 2.0;

/// Non-negative deconvolution whose sprays lie along the lines of the picture: what is thin and dark is painted in strokes along
/// its middle, everything else in rows as by [`Deconvolution`](crate::Deconvolution). Ours.
///
/// Where more than half of the darkest ink is missing the picture is thinned to its centrelines (Zhang and Suen 1984). Those that
/// are narrow become strokes, smoothed, with a spray every [`Limits::spray_spacing`](crate::Limits::spray_spacing) pixels;
/// the cells of the grid beside them are left out. The volumes of all sprays are fitted together, several times: where the core of a
/// line is left pale, missing ink counts more the next time. [`Painting::strokes`] holds the strokes. A picture without lines is painted as by
/// `Deconvolution`.
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
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: self.tolerance };
        let grid = PaintGrid::new(problem)?;
        let reach = self.max_half_width * problem.kernel.sigma();
        let drawn = DrawnLines::find(problem, &grid, reach);
        let mut places = sampled(&drawn.lines, problem);
        let mut placed = PlacedSprays::new(problem, &grid, &places, &drawn.rest);
        let mut volumes = vec![uniform_volume(problem, &grid); placed.len()];
        let given = problem.missing_weight.or(problem.weight);
        let mut weight = given.cloned().unwrap_or_else(|| problem.reference.map(|_| 1.0));
        for round in 0..ROUNDS {
            let share = f64::from(round) / f64::from(ROUNDS);
            let mut told = |part: f64| observer.progress(share + part / f64::from(ROUNDS));
            let heeding = problem.with_missing_weight(&weight);
            let upper_bounds = placed.upper_bounds(problem.limits.max_volume);
            let canvas = placed.fit(&heeding, smoothness, &upper_bounds, &mut volumes, &stop, &mut told);
            let bare = drawn.bare(problem, &canvas);
            if round + 1 == ROUNDS || !bare.contains(&true) {
                break;
            }
            if round + 2 < ROUNDS {
                let bare = weight.data_mut().iter_mut().zip(&bare).filter(|(_, bare)| **bare);
                bare.for_each(|(weight, _)| *weight *= MORE);
            } else {
                // What no weight helps gets strokes of its own.
                let added = sampled(&trace(&bare, problem.reference.width(), reach), problem);
                volumes = placed.with_more(&volumes, added.iter().map(Vec::len).sum());
                places.extend(added);
                placed = PlacedSprays::new(problem, &grid, &places, &drawn.rest);
            }
        }
        let problem = problem.with_missing_weight(&weight);
        let upper_bounds = placed.upper_bounds(problem.limits.max_volume);
        prune_with(&upper_bounds, problem.limits, &mut volumes, &mut |upper_bounds, volumes| {
            placed.fit(&problem, smoothness, upper_bounds, volumes, &stop, &mut |_| ());
        });
        observer.progress(1.0);

        let settings = StrokeSettings::default();
        let (along, rows) = placed.sprays(&volumes, settings.max_gap);
        let mut strokes: Vec<Stroke> = along.into_iter().map(|sprays| Stroke { sprays }).collect();
        strokes.extend(boustrophedon(&rows, &settings)?);
        let sprays = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        let painting = Painting::render(&problem, sprays);
        Ok(Painting { strokes, missing_weight: (!drawn.lines.is_empty()).then_some(weight), ..painting })
    }
}

/// Places of sprays along each line, as far apart as on the grid.
fn sampled(lines: &[Line], problem: &PaintProblem) -> Vec<Vec<[f64; 2]>> {
    lines.iter().map(|line| line.sampled(problem.limits.spray_spacing as f64)).collect()
}
