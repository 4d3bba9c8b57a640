//! Images in several paints: colour separation and deconvolution in one.

use super::colour_image::ColourImage;
use super::colour_metric::ColourMetric;
use super::colour_problem::ColourProblem;
use super::cost::MixtureCost;
use super::palette::MAX_PAINTS;
use crate::error::{Error, require};
use crate::image::Image;
use crate::model::Spray;
use crate::optimise::{StoppingRule, minimise};
use crate::painter::Observer;
use crate::problem::{Limits, PaintGrid, PaintProblem};
use crate::trace::span;

/// Colour separation and deconvolution in one: the volumes of all paints on all cells at once. Ours.
///
/// Minimises `½ Σ w |B (I(d) - T)|²` over volumes `0 ≤ v ≤ v_max`, where `d_p = G v_p` are the depths of the paints, `I` the
/// colour of the mixed film, `T` the wanted colour and `B` the metric at it ([`ColourMetric`]). Every pixel is unmixed first, as if it could be
/// painted alone; the mean depth under each footprint is the start. Each volume is scaled by the root
/// of its Gauss-Newton curvature there, `Σ g² |B ∂I/∂d_p|²`, which makes weak and strong paints, and light and dark places, alike:
/// without it projected L-BFGS needs several times as many iterations.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ColourSeparation {
    /// Largest number of iterations. Default 60, ours.
    pub iterations: usize,
    /// What differences are measured by. Default: CIEDE2000.
    pub metric: ColourMetric,
}

impl Default for ColourSeparation {
    fn default() -> Self {
        Self { iterations: 60, metric: ColourMetric::Ciede2000 }
    }
}

/// What is painted in several colours.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourPainting {
    /// The sprays of each paint.
    pub sprays: Vec<Vec<Spray>>,
    /// Depth of each paint.
    pub canvases: Vec<Image>,
    /// What it looks like; values in `[0, 1]`.
    pub image: ColourImage,
}

impl ColourSeparation {
    /// Solves a problem that nobody watches.
    pub fn paint(&self, problem: &ColourProblem) -> Result<ColourPainting, Error> {
        self.paint_observed(problem, &mut ())
    }

    /// Decides the sprays of every paint; the observer is told the progress.
    pub fn paint_observed(
        &self,
        problem: &ColourProblem,
        observer: &mut dyn Observer,
    ) -> Result<ColourPainting, Error> {
        span!("separate_colours");
        require("iterations", self.iterations as f64, self.iterations <= 100_000, "it must be at most 100,000")?;
        let ColourProblem { wanted, palette, weight, paintable, kernel, limits } = *problem;
        let (width, height) = (wanted.width(), wanted.height());
        // What is wanted does not matter for where the cells are.
        let blank = Image::filled(width, height, 0.0);
        let places = PaintProblem { weight, paintable, kernel, limits, ..PaintProblem::new(&blank) };
        let grid = PaintGrid::new(&places)?;
        let depth_per_volume = kernel.mass() / (limits.spray_spacing * limits.row_spacing) as f64;
        let mut model = MixtureCost::new(problem, self.metric);
        let (depths, curvatures) = model.start(limits.max_volume, kernel.squared().mass());
        let mut volumes: Vec<f64> = depths.iter().map(|depth| depth / depth_per_volume).collect();
        // Values of the fit are alike in curvature: `unit` of depth each, where all cells have the same.
        let unit: Vec<f64> = curvatures.iter().map(|curvature| depth_per_volume / curvature.sqrt()).collect();
        let paints = palette.paints().len();
        let mut fit = |volumes: &mut Vec<f64>, upper_bounds: &[f64], progress: &mut dyn FnMut(f64)| {
            let values_of = |v: &[f64]| v.iter().zip(&unit).map(|(v, unit)| v * depth_per_volume / unit).collect();
            let (mut values, upper): (Vec<f64>, Vec<f64>) = (values_of(volumes), values_of(upper_bounds));
            let mut cost = |values: &[f64], gradient: &mut [f64]| model.cost(values, &unit, gradient);
            let stop = StoppingRule { iterations: self.iterations, relative_decrease: 1e-5 };
            minimise(&mut values, &upper, &stop, &mut cost, progress);
            let back = values.iter().zip(&unit).zip(upper_bounds);
            volumes.clear();
            volumes.extend(back.map(|((v, unit), &upper)| (v * unit / depth_per_volume).min(upper)));
        };
        let mut upper_bounds = grid.upper_bounds.repeat(paints);
        fit(&mut volumes, &upper_bounds, &mut |share| observer.progress(share));
        if keep_most(&volumes, &mut upper_bounds, paints, limits) {
            fit(&mut volumes, &upper_bounds, &mut |_| ());
        }
        volumes.iter_mut().filter(|v| **v < limits.min_volume).for_each(|v| *v = 0.0);
        let each = || volumes.chunks_exact(grid.footprints.cells());
        let canvases: Vec<Image> = each().map(|volumes| grid.canvas(&places, volumes)).collect();
        let colour_at = |k: usize| {
            let mut depths = [0.0; MAX_PAINTS];
            depths.iter_mut().zip(&canvases).for_each(|(depth, canvas)| *depth = canvas.data()[k]);
            palette.colour(&depths).map(|v| v.clamp(0.0, 1.0))
        };
        let image = ColourImage::from_clamped(width, height, (0..width * height).map(colour_at).collect());
        observer.progress(1.0);
        Ok(ColourPainting { image, sprays: each().map(|volumes| grid.sprays(volumes)).collect(), canvases })
    }
}

/// Sets the upper bounds to 0 of what is smaller than the smallest volume or beyond the largest number; whether there was any.
fn keep_most(volumes: &[f64], upper_bounds: &mut [f64], paints: usize, limits: &Limits) -> bool {
    let cells = volumes.len() / paints;
    let mut dropped = false;
    for (volumes, upper_bounds) in volumes.chunks_exact(cells).zip(upper_bounds.chunks_exact_mut(cells)) {
        let mut order: Vec<usize> = (0..cells).filter(|&k| volumes[k] > 0.0).collect();
        order.sort_by(|&a, &b| volumes[b].total_cmp(&volumes[a]).then(a.cmp(&b)));
        let mut keep = vec![false; cells];
        let large = order.iter().take_while(|&&k| volumes[k] >= limits.min_volume);
        large.take(limits.max_sprays.unwrap_or(cells)).for_each(|&k| keep[k] = true);
        if order.iter().any(|&k| !keep[k]) {
            dropped = true;
            upper_bounds.iter_mut().zip(keep).filter(|(_, kept)| !kept).for_each(|(upper, _)| *upper = 0.0);
        }
    }
    dropped
}
