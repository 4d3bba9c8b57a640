//! Volumes for what sprays really leave: on a surface that is curved, stretched and cut to become a picture.

use super::volume_fit::{SurfaceFootprint, VolumeFit};
use crate::error::Error;
use crate::model::Spray;
use crate::painter::{Observer, Painter, PartialProgress};
use crate::painting::Painting;
use crate::path::{Stroke, StrokeSettings, boustrophedon};
use crate::problem::PaintProblem;

/// The plan of another painter with its volumes fitted anew to what every spray leaves on the surface itself. Ours.
///
/// On the plane of a chart every spray is one round spot. On the surface a chart is stretched here and shrunk there, it bends away under the
/// cone, and goes on beyond a seam in another chart. Whoever knows the surface gives the footprint of every spray; the volumes then minimise
///
/// ```text
/// ½ Σ w (f(c₀ + S v) - y)² + ½ ρ π σ² Σ (v - v_painter)²    subject to  v_min ≤ v ≤ v_max
/// ```
///
/// with the footprints as columns of `S`, the `ρ` of [`Self::proximity`] and the weights that the painter fitted by
/// ([`Painting::missing_weight`]). Places, order and strokes stay, as gaps would shut the valve on the
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
        let plan =
            self.inner.paint_observed(problem, &mut PartialProgress { observer, from: 0.0, share: PLAN_SHARE })?;
        let heeded = plan.missing_weight.as_ref().or(problem.missing_weight);
        let problem = &PaintProblem { missing_weight: heeded, ..*problem };
        let rows;
        let strokes = if plan.strokes.is_empty() {
            rows = boustrophedon(&plan.sprays, &StrokeSettings::default())?;
            &rows
        } else {
            &plan.strokes
        };
        let sprays: Vec<Spray> = strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
        let footprints = (self.footprints)(strokes);
        let mut volumes: Vec<f64> = sprays.iter().map(|spray| spray.volume).collect();
        let fit = VolumeFit {
            problem,
            footprints: &footprints,
            proximity: self.proximity,
            iterations: self.iterations,
            tolerance: self.tolerance,
        };
        let canvas =
            fit.solve(&mut volumes, &mut |share| observer.progress(PLAN_SHARE + (1.0 - PLAN_SHARE) * share))?;
        observer.progress(1.0);
        let sprays: Vec<Spray> =
            sprays.iter().zip(&volumes).map(|(spray, &volume)| Spray { volume, ..*spray }).collect();
        let strokes = cut(&sprays, &plan.strokes);
        let sprays = sprays.into_iter().filter(|spray| spray.volume > 0.0).collect();
        Ok(Painting { strokes, ..Painting::new(sprays, canvas, problem.saturation) })
    }
}

/// Sprays cut as they were before, those of no volume left out.
fn cut(sprays: &[Spray], before: &[Stroke]) -> Vec<Stroke> {
    let mut rest = sprays.iter().copied();
    let open = |stroke: &Stroke| rest.by_ref().take(stroke.sprays.len()).filter(|spray| spray.volume > 0.0).collect();
    before.iter().map(open).map(|sprays| Stroke { sprays }).filter(|stroke| !stroke.sprays.is_empty()).collect()
}
