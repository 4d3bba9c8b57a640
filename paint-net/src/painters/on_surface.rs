//! Volumes for what sprays really leave: on a surface that is curved, stretched and cut to become a picture.

use super::fitting::ink_cost;
use crate::error::{Error, require};
use crate::model::Spray;
use crate::optimise::{StoppingRule, minimise};
use crate::painter::{Observer, Painter, PartialProgress};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings, boustrophedon};
use crate::problem::PaintProblem;

/// What a spray leaves: pixels, none of them a ghost, and the depth on each per unit of the spray's volume.
pub type SurfaceFootprint = Vec<(u32, f32)>;

/// The plan of another painter with its volumes fitted anew to what every spray leaves on the surface itself. Ours.
///
/// On the plane of a chart every spray is one round spot. On the surface a chart is stretched here and shrunk there, it bends away under the
/// cone, and goes on beyond a seam in another chart. Whoever knows the surface gives the footprint of every spray; the volumes then minimise
///
/// ```text
/// ½ Σ w (f(c₀ + S v) - y)² + ½ ρ π σ² Σ (v - v_painter)²    subject to  v_min ≤ v ≤ v_max
/// ```
///
/// with the footprints as columns of `S` and the `ρ` of [`Self::proximity`]. Places, order and strokes stay, as gaps would shut the valve on the
/// way; only a spray that leaves nothing is dropped. The canvas is that of the surface. For painters in one piece: layers are made of the result.
pub struct OnSurface<'a, P> {
    /// The painter that plans on the plane.
    pub inner: P,
    /// The footprint of each spray, stroke by stroke. Sprays of a painter without strokes are given row by row, as by [`boustrophedon`].
    pub footprints: &'a dyn Fn(&[Stroke]) -> Vec<SurfaceFootprint>,
    /// Weight of the differences from the painter's own volumes against the ink. Default 0.3, ours: what the surface does not ask to be changed
    /// stays, above all differences between neighbours that hardly show and that a flight cannot repeat.
    pub proximity: f64,
    /// Largest number of iterations. Default 25, ours.
    pub iterations: usize,
    /// Stop when the cost falls by less than this share per iteration, three times in a row. Default 1e-4, ours.
    pub tolerance: f64,
}

/// Share of the progress that the plan on the plane stands for.
const PLAN_SHARE: f64 = 0.7;

impl<'a, P: Painter> OnSurface<'a, P> {
    /// With the default fit.
    pub fn new(inner: P, footprints: &'a dyn Fn(&[Stroke]) -> Vec<SurfaceFootprint>) -> Self {
        Self { inner, footprints, proximity: 0.3, iterations: 25, tolerance: 1e-4 }
    }
}

impl<P: Painter> Painter for OnSurface<'_, P> {
    fn name(&self) -> &'static str {
        "on surface"
    }

    fn paint_observed(&self, problem: &PaintProblem, observer: &mut dyn Observer) -> Result<Painting, Error> {
        require("tolerance", self.tolerance, self.tolerance >= 0.0, "it must be 0 or more")?;
        require("proximity", self.proximity, (0.0..=1e6).contains(&self.proximity), "it must lie in [0, 1000000]")?;
        let plan =
            self.inner.paint_observed(problem, &mut PartialProgress { observer, from: 0.0, share: PLAN_SHARE })?;
        let rows;
        let strokes = if plan.strokes.is_empty() {
            rows = boustrophedon(&plan.sprays, &StrokeSettings::default())?;
            &rows
        } else {
            &plan.strokes
        };
        let sprays: Vec<Spray> = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        let footprints = self.checked_footprints(strokes, sprays.len(), problem)?;
        // A spray that the painter wants stays one that is worth opening the valve for: what is sought is how much more it gets.
        let least: Vec<f64> =
            footprints.iter().map(|f| if f.is_empty() { 0.0 } else { problem.limits.min_volume }).collect();
        let room = problem.limits.max_volume - problem.limits.min_volume;
        let most: Vec<f64> = footprints.iter().map(|f| if f.is_empty() { 0.0 } else { room }).collect();
        let initial = problem.initial_canvas();
        let mut base = initial.data().to_vec();
        deposit(&footprints, &least, &mut base);
        let planned: Vec<f64> = sprays.iter().zip(&least).map(|(spray, least)| spray.volume - least).collect();
        // In units of what the square of a volume costs on white paper.
        let stiffness = self.proximity * std::f64::consts::PI * problem.kernel.sigma().powi(2);
        let mut canvas = base.clone();
        let mut cost = |more: &[f64], gradient: &mut [f64]| {
            canvas.copy_from_slice(&base);
            deposit(&footprints, more, &mut canvas);
            let mut value = ink_cost(problem, problem.saturation, &mut canvas);
            for (k, slot) in gradient.iter_mut().enumerate() {
                let change = more[k] - planned[k];
                value += 0.5 * stiffness * change * change;
                let missed = footprints[k].iter().map(|&(pixel, depth)| f64::from(depth) * canvas[pixel as usize]);
                *slot = missed.sum::<f64>() + stiffness * change;
            }
            value
        };
        let stop = StoppingRule { iterations: self.iterations, relative_decrease: self.tolerance };
        let mut volumes = planned.clone();
        let mut progress = |share: f64| observer.progress(PLAN_SHARE + (1.0 - PLAN_SHARE) * share);
        minimise(&mut volumes, &most, &stop, &mut cost, &mut progress);
        volumes.iter_mut().zip(&least).for_each(|(volume, least)| *volume += least);
        observer.progress(1.0);

        let mut canvas = initial;
        deposit(&footprints, &volumes, canvas.data_mut());
        if let Some(ghosts) = problem.ghosts {
            ghosts.gather(canvas.data_mut());
        }
        let sprays: Vec<Spray> =
            sprays.iter().zip(&volumes).map(|(spray, &volume)| Spray { volume, ..*spray }).collect();
        let strokes = cut(&sprays, &plan.strokes);
        let sprays = sprays.into_iter().filter(|spray| spray.volume > 0.0).collect();
        Ok(Painting { strokes, ..Painting::new(sprays, canvas, problem.saturation) })
    }
}

impl<P> OnSurface<'_, P> {
    fn checked_footprints(
        &self,
        strokes: &[Stroke],
        sprays: usize,
        problem: &PaintProblem,
    ) -> Result<Vec<SurfaceFootprint>, Error> {
        let footprints = (self.footprints)(strokes);
        if footprints.len() != sprays {
            let (found, expected) = ((footprints.len(), 1), (sprays, 1));
            return Err(Error::Mismatch { what: "list of footprints", found, expected });
        }
        let (width, pixels) = (problem.reference.width(), problem.reference.data().len());
        for &(k, depth) in footprints.iter().flatten() {
            if k as usize >= pixels || !(depth >= 0.0 && depth.is_finite()) {
                let (x, y) = (k as usize % width, k as usize / width);
                let range = "pixels of the picture and a depth of 0 or more";
                return Err(Error::Pixel { what: "footprint", x, y, value: f64::from(depth), range });
            }
        }
        Ok(footprints)
    }
}

/// `canvas += S v`.
fn deposit(footprints: &[SurfaceFootprint], volumes: &[f64], canvas: &mut [f64]) {
    for (footprint, &volume) in footprints.iter().zip(volumes).filter(|(_, volume)| **volume > 0.0) {
        for &(k, depth) in footprint {
            canvas[k as usize] += volume * f64::from(depth);
        }
    }
}

/// Sprays cut as they were before, those of no volume left out.
fn cut(sprays: &[Spray], before: &[Stroke]) -> Vec<Stroke> {
    let mut rest = sprays.iter().copied();
    let open = |stroke: &Stroke| rest.by_ref().take(stroke.sprays.len()).filter(|spray| spray.volume > 0.0).collect();
    before.iter().map(open).map(|sprays| Stroke { sprays }).filter(|stroke| !stroke.sprays.is_empty()).collect()
}
