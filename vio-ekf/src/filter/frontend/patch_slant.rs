//! Which way the surface of a patch is turned (Molton, Davison and Reid 2004): seen from elsewhere, its far side moves less.

use nalgebra::{Matrix2, Vector2};

use super::patch::{Comparison, Patch};
use super::pyramid::Pyramid;
use crate::filter::settings::PatchSettings;
use crate::filter::state::landmark::Landmark;

/// Tangent of the angle at which surfaces are seen, one standard deviation (ours).
const USUAL: f64 = 0.7;
/// Pixels at the border of a patch by which a usual slant has to show, to be looked for (ours).
const LEAST: f64 = 0.05;
/// Images that count as one: what is wrong with a template is wrong in all of them (ours).
const ALIKE: f64 = 10.0;
/// Pixels from the middle of a patch to its border, on the coarsest level.
const BORDER: f64 = 5.0;

/// What images have told of the slope of a patch, inverse distance per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PatchSlant {
    information: Matrix2<f64>,
}

/// What an image tells of it: normal equations of its change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SlantEvidence {
    information: Matrix2<f64>,
    gradient: Vector2<f64>,
}

impl SlantEvidence {
    /// Of a patch that has been aligned at a pixel; `None` where too little would show.
    pub(crate) fn new(
        landmark: &Landmark,
        (patch, pyramid): (&Patch, &Pyramid),
        (pixel, by_bearing): (&Vector2<f64>, &Matrix2<f64>),
        comparison: &Comparison,
        settings: &PatchSettings,
    ) -> Option<Self> {
        // The patch's pixels by which its border is displaced, by its inverse distance.
        let shift = landmark.warp.try_inverse()? * landmark.by_distance.xy();
        if shift.norm() * usual_slope(landmark) * BORDER < LEAST {
            return None;
        }
        let deformation = patch.deformation(pyramid, pixel, &(by_bearing * landmark.warp))?;
        let noise = settings.intensity_sigma.powi(2).max(comparison.residual / comparison.freedom)
            + settings.pixel_sigma.powi(2) * comparison.information.trace() / (2.0 * comparison.freedom);
        let noise = ALIKE * noise;
        let block = |j: usize, l: usize| deformation.information.fixed_view::<2, 2>(2 * j, 2 * l).into_owned();
        Some(Self {
            information: Matrix2::from_fn(|j, l| shift.dot(&(block(j, l) * shift))) / noise,
            gradient: Vector2::from_fn(|j, _| shift.dot(&deformation.gradient.fixed_rows::<2>(2 * j))) / noise,
        })
    }
}

impl PatchSlant {
    /// Turns the surface of a landmark's patch to where the image shows it.
    pub(crate) fn update(&mut self, evidence: &SlantEvidence, landmark: &mut Landmark) {
        self.information += evidence.information;
        let prior = Matrix2::identity() / usual_slope(landmark).powi(2);
        if let Some(covariance) = (self.information + prior).try_inverse() {
            landmark.tilt(&(covariance * evidence.gradient));
        }
    }
}

/// Inverse distance per pixel of the patch, of a surface at the usual angle.
fn usual_slope(landmark: &Landmark) -> f64 {
    USUAL * landmark.inverse_distance.value.abs() * landmark.warp.determinant().abs().sqrt()
}
