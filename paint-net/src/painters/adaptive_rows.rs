//! Rows whose width and direction follow the picture.

mod blocks;
mod trials;

use super::fitting::prune_with;
use super::placed_sprays::PlacedSprays;
use crate::error::{Error, require};
use crate::model::Spray;
use crate::optimise::StoppingRule;
use crate::painter::{Observer, Painter, PartialProgress};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings};
use crate::problem::PaintProblem;
use blocks::{Blocks, Prices};
pub use trials::RowWidth;
use trials::{CONVERGED, trials};

/// Rows that are as wide as the picture allows, each block of it swept in the direction that asks for the fewest: few metres for a picture
/// that a grid of equal rows paints with many. Ours.
///
/// Along a row the flow follows the picture as fast as the spot is small; across rows it is their distance that limits what is resolved. So
/// bands are painted by wide rows that cross them. The nozzle stands farther off for a wide row: its spot grows with the
/// distance (thesis, Paper IV, Eq. 8.1). The picture is painted once with each kind of rows ([`Self::widths`], along and across) by
/// [`Deconvolution`](crate::Deconvolution); every block takes the kind for which its way, turns at the ends of rows included, and the
/// structural similarity that it loses ([`Self::tolerance`]) are least together. The volumes of all rows are then fitted together.
/// [`Painting::strokes`] holds a stroke for each row of neighbouring blocks of one kind.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct AdaptiveRows {
    /// Kinds of rows: distance of the rows in [`row_spacing`](crate::Limits::row_spacing), rounded to pixels, and spread of their sprays in
    /// deviations of the nozzle. Default (1, 0.75), (5/4, 1), (5/4, 1.2) and (2, 1.45), ours: the last is the thesis' nozzle at 14.5 of its 15 cm.
    pub widths: Vec<RowWidth>,
    /// Structural similarity that a block may lose to save all of the way over it with rows of the limits. Default 0.15, ours.
    pub tolerance: f64,
    /// Way that the turn at the end of a row costs, pixels. Default 16 (20 cm at the thesis' scale), ours.
    pub turn: f64,
    /// Largest number of iterations of the fit; the trials have half. Default 120, ours.
    pub iterations: usize,
}

impl Default for AdaptiveRows {
    fn default() -> Self {
        let widths =
            [(1.0, 0.75), (1.25, 1.0), (1.25, 1.2), (2.0, 1.45)].map(|(spacing, spread)| RowWidth { spacing, spread });
        Self { widths: widths.to_vec(), tolerance: 0.15, turn: 16.0, iterations: 120 }
    }
}

/// Share of the progress that the trials stand for.
const TRIALS: f64 = 0.6;

impl Painter for AdaptiveRows {
    fn name(&self) -> &'static str {
        "adaptive rows"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        let rows = self.rows(problem, &mut PartialProgress { observer, from: 0.0, share: TRIALS })?;
        let rows: Vec<Vec<Spray>> = rows.into_iter().map(|row| row.sprays).collect();
        let placed = PlacedSprays::along(problem, &rows);
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: CONVERGED };
        let upper_bounds = placed.upper_bounds(problem.limits.max_volume);
        let mut volumes: Vec<f64> = rows.iter().flatten().map(|spray| spray.volume).collect();
        let mut told = |share: f64| observer.progress(TRIALS + (1.0 - TRIALS) * share);
        placed.fit(problem, 0.0, &upper_bounds, &mut volumes, &stop, &mut told);
        let stop = StoppingRule { iterations: self.iterations / 4, relative_decrease: CONVERGED };
        prune_with(&upper_bounds, problem.limits, &mut volumes, &mut |upper_bounds, volumes| {
            placed.fit(problem, 0.0, upper_bounds, volumes, &stop, &mut |_| ());
        });
        observer.progress(1.0);
        let (along, _) = placed.sprays(&volumes, StrokeSettings::default().max_gap);
        let strokes: Vec<Stroke> = along.into_iter().map(|sprays| Stroke { sprays }).collect();
        let sprays: Vec<Spray> = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        Ok(Painting { strokes, ..Painting::render(problem, sprays) })
    }
}

impl AdaptiveRows {
    /// The rows alone, each spray with the volume that its kind of rows would have there by itself: for paints whose volumes are fitted together
    /// with those of others.
    ///
    /// # Errors
    /// Settings or a problem out of range.
    pub fn rows(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Vec<Stroke>, Error> {
        self.check()?;
        problem.check()?;
        let trials = trials(&self.widths, self.iterations.div_ceil(2), problem, observer)?;
        let prices = Prices { tolerance: self.tolerance, turn: self.turn };
        let rows = Blocks::new(problem, &trials, prices).rows(problem, &trials);
        Ok(rows.into_iter().map(|sprays| Stroke { sprays }).collect())
    }

    fn check(&self) -> Result<(), Error> {
        let Self { tolerance, turn, .. } = *self;
        require("widths", self.widths.len() as f64, (1..=16).contains(&self.widths.len()), "there must be 1 to 16")?;
        for width in &self.widths {
            require("spacing", width.spacing, (0.1..=100.0).contains(&width.spacing), "it must lie in [0.1, 100]")?;
            require("spread", width.spread, (0.1..=100.0).contains(&width.spread), "it must lie in [0.1, 100]")?;
        }
        require("tolerance", tolerance, tolerance > 0.0 && tolerance <= 1e6, "it must lie in (0, 1000000]")?;
        require("turn", turn, (0.0..=1e6).contains(&turn), "it must lie in [0, 1000000]")
    }
}
