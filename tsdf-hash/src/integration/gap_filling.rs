//! Gaps of one pixel: what the registration of a depth image to another camera leaves, in a grid.

use crate::images::Intrinsics;
use crate::integration::inverse_depth_noise::InverseDepthNoise;
use crate::settings::Settings;

/// Neighbours on one surface differ by as much as one seen at this angle from its normal, and by the noise (ours: tan 75°).
pub(crate) const STEEPEST: f32 = 3.73;
/// Standard deviations of the difference of two neighbours that are granted (ours).
pub(crate) const GRANTED: f32 = 4.0 * std::f32::consts::SQRT_2;

/// Fills a gap between two neighbours of one surface with their mean: inverse depth is linear on a plane.
#[derive(Clone, Copy)]
pub(crate) struct GapFilling {
    noise: InverseDepthNoise,
    /// Largest relative change over two pixels along a row and along a column.
    slope: [f32; 2],
}

impl GapFilling {
    pub(crate) fn new(k: &Intrinsics, settings: &Settings) -> Self {
        let slope = [k.fx, k.fy].map(|f| 2.0 * STEEPEST / f.abs() as f32);
        Self { noise: InverseDepthNoise::new(settings), slope }
    }

    /// A copy of a line, NaN where nothing was measured, with the gaps between left and right filled. The line has a pixel more
    /// on each side.
    #[inline(always)]
    pub(crate) fn along(&self, line: &[f32], out: &mut [f32]) {
        let width = out.len();
        let line = &line[..width + 2];
        for u in 0..width {
            out[u] = self.between([line[u], line[u + 2]], line[u + 1], self.slope[0]);
        }
    }

    /// Fills the gaps of a line between the one above and the one below.
    #[inline(always)]
    pub(crate) fn across(&self, [above, below]: [&[f32]; 2], line: &mut [f32]) {
        for ((here, &above), &below) in line.iter_mut().zip(above).zip(below) {
            *here = self.between([above, below], *here, self.slope[1]);
        }
    }

    #[inline(always)]
    fn between(&self, [before, after]: [f32; 2], here: f32, slope: f32) -> f32 {
        let mean = 0.5 * (before + after);
        // A NaN on either side fails.
        let one_surface = (before - after).abs() <= GRANTED * self.noise.sigma_inverse(mean) + slope * mean;
        if here.is_nan() & one_surface { mean } else { here }
    }
}
