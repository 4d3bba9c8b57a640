//! The footprint of one spray.

use super::spray::Spray;
use crate::error::{Error, require};
use crate::image::Image;

/// The footprint of one spray: a round Gaussian of depth, cut to a square of `±cut·σ` (thesis, Paper IV, section 3.3: σ is
/// half the spray radius). Lengths in pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct SprayKernel {
    sigma: f64,
    cut: f64,
    taps: Vec<f64>,
}

impl Default for SprayKernel {
    /// The thesis' nozzle, a spray radius of 4 px: `new(2.0, 2.0)`.
    fn default() -> Self {
        Self::gaussian(2.0, 2.0)
    }
}

impl SprayKernel {
    /// `sigma` in pixels, `cut` in sigmas. The thesis' radius of 4 px is `new(2.0, 2.0)`; a real nozzle has tails, and
    /// 4 sigmas keep all but 6e-5 of each profile.
    pub fn new(sigma: f64, cut: f64) -> Result<Self, Error> {
        require("sigma", sigma, sigma > 0.0 && sigma <= 1e4, "it must lie in (0, 10000] pixels")?;
        require("cut", cut, cut > 0.0 && cut <= 100.0, "it must lie in (0, 100] sigmas")?;
        Ok(Self::gaussian(sigma, cut))
    }

    fn gaussian(sigma: f64, cut: f64) -> Self {
        let radius = (cut * sigma).floor() as i64;
        let taps = (-radius..=radius).map(|d| (-((d * d) as f64) / (2.0 * sigma * sigma)).exp()).collect();
        Self { sigma, cut, taps }
    }

    /// Standard deviation in pixels.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Where a spray ends along each axis, in sigmas.
    pub fn cut(&self) -> f64 {
        self.cut
    }

    /// Largest pixel distance along one axis that a spray reaches.
    pub fn radius(&self) -> usize {
        self.taps.len() / 2
    }

    /// One-dimensional profile from `-radius` to `radius`, 1 at the centre; the footprint is its outer product.
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// Sum of the footprint over all pixels: depth times this is paint volume in px² times depth units.
    pub fn mass(&self) -> f64 {
        self.taps.iter().sum::<f64>().powi(2)
    }

    /// Adds a spray to a canvas: `v exp(-|p - μ|²/2σ²)` with the spray's own `σ`, wherever it lies, cut at `±cut·σ`. What
    /// falls beside the canvas is lost.
    pub fn stamp(&self, spray: &Spray, canvas: &mut Image) {
        let (x0, across) = self.profile(spray.x, spray.sigma, canvas.width());
        let (y0, down) = self.profile(spray.y, spray.sigma, canvas.height());
        let width = canvas.width();
        for (y, tap) in (y0..).zip(down) {
            for (depth, t) in canvas.data_mut()[y * width..].iter_mut().skip(x0).zip(&across) {
                *depth += spray.volume * tap * t;
            }
        }
    }

    /// Profile along an axis of `n` pixels of a spray of deviation `sigma`: its first pixel, and its value there and on.
    pub(crate) fn profile(&self, centre: f64, sigma: f64, n: usize) -> (usize, Vec<f64>) {
        let reach = self.cut * sigma;
        let first = (centre - reach).ceil().max(0.0) as usize;
        let end = ((centre + reach).floor() + 1.0).clamp(0.0, n as f64) as usize;
        let tap = |p: usize| (-(p as f64 - centre).powi(2) / (2.0 * sigma * sigma)).exp();
        (first, (first..end).map(tap).collect())
    }

    /// The profile squared, for sums over squared footprints.
    pub(crate) fn squared(&self) -> Self {
        Self { taps: self.taps.iter().map(|t| t * t).collect(), ..self.clone() }
    }
}
