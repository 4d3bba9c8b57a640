//! A painter that paints in coats and measures the wall after each.

use crate::error::{Error, require};
use crate::image::Image;
use crate::model::Spray;
use crate::painter::{Observer, Painter};
use crate::painting::Painting;
use crate::problem::PaintProblem;

/// Closes the loop: paints in coats and measures the wall after each, so that what a valve or a gust did wrong in one coat is
/// made good by the next. Ours.
///
/// Paint cannot be taken away, so every coat but the last sprays a share of what is still missing; the flow of the nozzle
/// relative to what it is thought to be, its gain, is estimated on the way,
///
/// ```text
/// gain = Σ w Δc_measured / Σ w Δc_planned,   w = f'(c)²
/// ```
///
/// (the ratio of sums, as sprays that miss their place blur the paint but lose none), and the next coats are sprayed
/// accordingly. The wall is the observer's: [`Observer::spray`] sprays what it is told and returns the ink of the wall as it then
/// is. Ink near saturation says little about depth and has little weight. An observer without a wall leaves a plan in coats for
/// a nozzle that does what it is told, nothing ever taken back.
///
/// The result's [`Painting::layers`] are the coats, its sprays those that the nozzle was told, its canvas the wall as measured
/// last, its [`Painting::flow_gain`] the estimate. The path of a slew-limited inner painter is kept for each coat; the slew
/// limit then holds times `share / gain`.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedLoopPainter<P> {
    /// The painter that plans every coat.
    pub inner: P,
    /// Share of the missing paint that each coat sprays, in `(0, 1]`.
    pub shares: Vec<f64>,
}

impl<P: Painter> ClosedLoopPainter<P> {
    /// Three coats: 60 % of the paint, 75 % of what is then missing, and the rest (ours).
    pub fn new(inner: P) -> Self {
        Self { inner, shares: vec![0.6, 0.75, 1.0] }
    }
}

impl<P: Painter> Painter for ClosedLoopPainter<P> {
    fn name(&self) -> &'static str {
        "closed loop"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        for &share in &self.shares {
            require("shares", share, share > 0.0 && share <= 1.0, "every share must lie in (0, 1]")?;
        }
        if self.shares.is_empty() {
            return Err(Error::EmptyProblem("there are no coats"));
        }
        let mut canvas = problem.initial_canvas();
        let mut flow = FlowEstimate { gain: 1.0, measured: 0.0, planned: 0.0 };
        let mut coats = Vec::with_capacity(self.shares.len());
        for (k, &share) in self.shares.iter().enumerate() {
            observer.progress(k as f64 / self.shares.len() as f64);
            let plan = self.inner.paint(&PaintProblem { canvas: Some(&canvas), ..*problem })?;
            let coat = coat(problem, &canvas, &plan, share, &mut flow, observer)?;
            canvas.clone_from(&coat.canvas);
            coats.push(coat);
        }
        observer.progress(1.0);
        let painting = Painting::from_layers(coats, canvas, problem.saturation);
        Ok(Painting { flow_gain: flow.gain, ..painting })
    }
}

/// Sprays a share of a plan, and measures.
fn coat(
    problem: &PaintProblem,
    canvas: &Image,
    plan: &Painting,
    share: f64,
    flow: &mut FlowEstimate,
    observer: &mut dyn Observer,
) -> Result<Painting, Error> {
    let limits = problem.limits;
    let scaled = |s: &Spray| Spray { volume: (share * s.volume / flow.gain).min(limits.max_volume), ..*s };
    let sprays: Vec<Spray> = plan.sprays.iter().map(scaled).filter(|s| s.volume >= limits.min_volume).collect();
    let waypoints = plan.waypoints.iter().map(scaled).collect();
    let after = if let Some(ink) = observer.spray(&sprays)? {
        let after = depth_of(&ink, problem)?;
        flow.update(problem, share, canvas, plan, &after);
        after
    } else if sprays.len() == plan.sprays.len() {
        // Nobody measured: the share is painted as planned.
        let mut after = plan.canvas.clone();
        for (c, &before) in after.data_mut().iter_mut().zip(canvas.data()) {
            *c = before + share * (*c - before);
        }
        after
    } else {
        Painting::render(&PaintProblem { canvas: Some(canvas), ..*problem }, sprays.clone()).canvas
    };
    Ok(Painting { waypoints, ..Painting::new(sprays, after, problem.saturation) })
}

/// The gain of the nozzle: a ratio of sums over all coats.
struct FlowEstimate {
    gain: f64,
    measured: f64,
    planned: f64,
}

impl FlowEstimate {
    fn update(&mut self, problem: &PaintProblem, share: f64, canvas: &Image, plan: &Painting, after: &Image) {
        for (k, (&c, &before)) in after.data().iter().zip(canvas.data()).enumerate() {
            // What this coat would have added, had the nozzle given just what it was asked for.
            let planned = share * (plan.canvas.data()[k] - before) / self.gain;
            // Weighed by where the paint was to be: by where it is, too much of it would count for less than too little.
            let slope = problem.saturation.derivative(before + self.gain * planned);
            let weight = problem.weight(k) * slope * slope;
            self.measured += weight * (c - before);
            self.planned += weight * planned;
        }
        if self.planned > 0.0 && self.measured > 0.0 {
            // A nozzle further off than this is broken, not badly calibrated.
            self.gain = (self.measured / self.planned).clamp(0.2, 5.0);
        }
    }
}

/// Depth that shows as this ink.
fn depth_of(ink: &Image, problem: &PaintProblem) -> Result<Image, Error> {
    let (found, expected) = (ink.size(), problem.reference.size());
    if found != expected {
        return Err(Error::Mismatch { what: "measured ink", found, expected });
    }
    ink.check_range("measured ink", -1.0, 2.0, "about [0, 1]")?;
    Ok(ink.map(|a| problem.saturation.inverse(a)))
}
