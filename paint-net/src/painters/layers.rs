//! Layers by intensity.

use crate::error::{Error, require};
use crate::image::Image;
use crate::model::Spray;
use crate::painter::{Observer, Painter, PartialProgress};
use crate::painting::Painting;
use crate::path::Stroke;
use crate::problem::PaintProblem;

/// How the thresholds after the base are spaced. The print, "intervals of multiples of 50", allows both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ThresholdSpacing {
    /// Base, base + step, base + 2 step, …
    #[default]
    FromBase,
    /// Base, then the multiples of the step above it.
    Absolute,
}

/// How the layers are planned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LayerPlanning {
    /// One plan for the whole picture, cut at the thresholds' depths: the layers add up to the joint optimum (ours).
    #[default]
    Joint,
    /// Each layer is planned by itself, to what the picture clipped at its threshold still lacks on the canvas so far
    /// (Paper IV, section 3.2).
    Sequential,
}

/// Layering by intensity: a base coat first, then darker and darker detail (thesis, Paper IV, section 3.2).
///
/// The result's [`Painting::layers`] are the layers, the base first. Limits hold for the whole plan, not for each layer: a spray
/// that is cut at thresholds is several, and each may be smaller than `min_volume`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Layered<P> {
    /// The painter of each layer.
    pub inner: P,
    /// The base reaches up to this percentile of the reference's ink. Default 20 (Paper IV, section 3.3).
    pub base_percentile: f64,
    /// Ink between thresholds. Default 50/255 (Paper IV, section 3.3).
    pub step: f64,
    /// Reading of the spacing. Default from the base.
    pub spacing: ThresholdSpacing,
    /// Whether the layers are planned together or one after the other. Default joint.
    pub planning: LayerPlanning,
}

impl<P: Painter> Layered<P> {
    /// Layers over a painter with the published thresholds.
    pub fn new(inner: P) -> Self {
        Self {
            inner,
            base_percentile: 20.0,
            step: 50.0 / 255.0,
            spacing: ThresholdSpacing::default(),
            planning: LayerPlanning::default(),
        }
    }

    /// Upper ink of each layer, rising; the last is 1. Pixels of weight 0 do not count.
    pub fn thresholds(&self, problem: &PaintProblem) -> Result<Vec<f64>, Error> {
        problem.check()?;
        let percentile = self.base_percentile;
        require("base_percentile", percentile, (0.0..=100.0).contains(&percentile), "it must lie in [0, 100]")?;
        require("step", self.step, self.step >= 1e-3 && self.step <= 1.0, "it must lie in [0.001, 1]")?;
        let mut inks: Vec<f64> = (0..problem.reference.data().len())
            .filter(|&k| problem.weight(k) > 0.0)
            .map(|k| problem.reference.data()[k])
            .collect();
        inks.sort_by(f64::total_cmp);
        let darkest = inks[inks.len() - 1];
        // Linear interpolation between order statistics.
        let rank = self.base_percentile / 100.0 * (inks.len() - 1) as f64;
        let (low, share) = (rank.floor() as usize, rank.fract());
        let base = inks[low] + share * (inks[(low + 1).min(inks.len() - 1)] - inks[low]);

        let mut thresholds = if base > 0.0 { vec![base] } else { Vec::new() };
        let mut next = match self.spacing {
            ThresholdSpacing::FromBase => base + self.step,
            ThresholdSpacing::Absolute => ((base / self.step).floor() + 1.0) * self.step,
        };
        while next < darkest {
            thresholds.push(next);
            next += self.step;
        }
        thresholds.push(1.0);
        Ok(thresholds)
    }

    fn paint_in_sequence(
        &self,
        thresholds: &[f64],
        problem: &PaintProblem,
        observer: &mut dyn Observer,
    ) -> Result<Vec<Painting>, Error> {
        let mut layers: Vec<Painting> = Vec::with_capacity(thresholds.len());
        let share = 1.0 / thresholds.len() as f64;
        for (k, &upper) in thresholds.iter().enumerate() {
            let slice = problem.reference.map(|ink| ink.min(upper));
            let canvas = layers.last().map(|l| &l.canvas).or(problem.canvas);
            let layer = PaintProblem { reference: &slice, canvas, ..*problem };
            let mut part = PartialProgress { observer, from: k as f64 * share, share };
            layers.push(self.inner.paint_observed(&layer, &mut part)?);
        }
        Ok(layers)
    }
}

impl<P: Painter> Painter for Layered<P> {
    fn name(&self) -> &'static str {
        "layered"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        let thresholds = self.thresholds(problem)?;
        let layers = match self.planning {
            LayerPlanning::Joint => {
                // The plan is split before it is sprayed: the inner painter must not spray it.
                let whole = self.inner.paint_observed(problem, &mut |share: f64| observer.progress(share))?;
                split_at_thresholds(&whole, &thresholds, problem)
            }
            LayerPlanning::Sequential => self.paint_in_sequence(&thresholds, problem, observer)?,
        };
        Ok(Painting::from_layers(layers, problem.initial_canvas(), problem.saturation))
    }
}

/// Cuts every spray at the thresholds: a spray over final depth `c` gives layer `k` the share of `c` that lies between the
/// depths of its thresholds. The shares of a spray add up to it.
fn split_at_thresholds(whole: &Painting, thresholds: &[f64], problem: &PaintProblem) -> Vec<Painting> {
    let saturation = problem.saturation;
    let initial = problem.initial_canvas();
    let mut canvas = initial.clone();
    let mut lower = 0.0;
    let mut layers = Vec::with_capacity(thresholds.len());
    for (k, &top) in thresholds.iter().enumerate() {
        let last = k + 1 == thresholds.len();
        let upper = if last { f64::INFINITY } else { saturation.inverse(top) };
        let part = |spray: &Spray| {
            let depth = depth_at(&whole.canvas, spray);
            let share = (depth.min(upper) - depth.min(lower)) / depth;
            (share > 0.0).then_some(Spray { volume: spray.volume * share, ..*spray })
        };
        let sprays: Vec<Spray> = whole.sprays.iter().filter_map(part).collect();
        for spray in &sprays {
            problem.kernel.stamp(spray, &mut canvas);
        }
        let so_far = if last {
            // All together are the whole plan, whose painter knows its canvas best.
            whole.canvas.clone()
        } else {
            let mut so_far = canvas.clone();
            problem.settle(initial.data(), so_far.data_mut());
            so_far
        };
        let strokes = whole.strokes.iter().flat_map(|stroke| runs(stroke, &part)).collect();
        layers.push(Painting { strokes, ..Painting::new(sprays, so_far, saturation) });
        lower = upper;
    }
    layers
}

/// The parts of a stroke that have paint in a layer: it ends where one has none.
fn runs(stroke: &Stroke, part: &dyn Fn(&Spray) -> Option<Spray>) -> Vec<Stroke> {
    let parts: Vec<Option<Spray>> = stroke.sprays.iter().map(part).collect();
    let runs = parts.split(Option::is_none).map(|run| Stroke { sprays: run.iter().copied().flatten().collect() });
    runs.filter(|stroke| !stroke.sprays.is_empty()).collect()
}

/// Depth at the pixel nearest to a spray.
fn depth_at(canvas: &Image, spray: &Spray) -> f64 {
    let nearest = |at: f64, n: usize| (at.round().max(0.0) as usize).min(n - 1);
    canvas.at(nearest(spray.x, canvas.width()), nearest(spray.y, canvas.height()))
}
