//! How an image shows a patch deformed besides its shift.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use super::{AREA, Patch, PatchLevel, SIDE, dot};
use crate::filter::frontend::pyramid::{Level, Pyramid};

/// The normal equations of `D` where the pixel `x` of the patch, from its middle, is seen displaced by `D x`, in its own pixels; by the columns
/// of `D`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Deformation {
    pub(crate) information: Matrix4<f64>,
    pub(crate) gradient: Vector4<f64>,
}

impl Patch {
    /// How the patch is deformed in an image where it has been aligned.
    pub(crate) fn deformation(
        &self,
        pyramid: &Pyramid,
        pixel: &Vector2<f64>,
        warp: &Matrix2<f64>,
    ) -> Option<Deformation> {
        let [fine, coarse] = [0, 1].map(|k| self.levels[k].deformation(&pyramid.patch_levels()[k], pixel, warp));
        let (fine, coarse) = (fine?, coarse?);
        Some(Deformation {
            information: fine.information + coarse.information,
            gradient: fine.gradient + coarse.gradient,
        })
    }
}

impl PatchLevel {
    fn deformation(&self, level: &Level, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> Option<Deformation> {
        let (samples, gain) = self.sample(level, pixel, warp)?;
        let shift = self.information.try_inverse()?;
        let half = 0.5 * (SIDE - 1) as f32;
        let mut modes = [[0.0; AREA]; 4];
        for (number, mode) in modes.iter_mut().enumerate() {
            let (gradient, axis) = (number % 2, number / 2);
            let [mean, along] = self.taken[gradient];
            for (k, value) in mode.iter_mut().enumerate() {
                let place = if axis == 0 { k % SIDE } else { k / SIDE } as f32 - half;
                *value = (self.gradients[gradient][k] + mean + along * self.values[k]) * (place / level.scale as f32);
            }
            // Gain, offset and shift are free.
            let mean = mode.iter().sum::<f32>() / AREA as f32;
            let along = dot(mode, &self.values) / self.energy;
            let shifted = Vector2::new(dot(mode, &self.gradients[0]), dot(mode, &self.gradients[1]));
            let shifted = (shift * shifted.cast::<f64>()).cast::<f32>();
            for (k, value) in mode.iter_mut().enumerate() {
                let by_shift = shifted[0] * self.gradients[0][k] + shifted[1] * self.gradients[1][k];
                *value -= mean + along * self.values[k] + by_shift;
            }
        }
        Some(Deformation {
            information: Matrix4::from_fn(|a, b| f64::from(dot(&modes[a], &modes[b]))),
            gradient: Vector4::from_fn(|a, _| f64::from(dot(&modes[a], &samples)) / -gain),
        })
    }
}
