use crate::error::{Error, require};

/// The footprint of one spray: a round Gaussian of depth, cut to a square of `±cut·σ` (thesis, Paper IV, section 3.3: σ is
/// half the spray radius). Lengths in pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct SprayKernel {
    sigma: f64,
    taps: Vec<f64>,
}

impl SprayKernel {
    /// `sigma` in pixels, `cut` in sigmas. The thesis' radius of 4 px is `new(2.0, 2.0)`; a real nozzle has tails, and
    /// 4 sigmas keep all but 6e-5 of each profile.
    pub fn new(sigma: f64, cut: f64) -> Result<Self, Error> {
        require("sigma", sigma, sigma > 0.0 && sigma <= 1e4, "it must lie in (0, 10000] pixels")?;
        require("cut", cut, cut > 0.0 && cut <= 100.0, "it must lie in (0, 100] sigmas")?;
        let radius = (cut * sigma).floor() as i64;
        let taps = (-radius..=radius).map(|d| (-((d * d) as f64) / (2.0 * sigma * sigma)).exp()).collect();
        Ok(Self { sigma, taps })
    }

    /// Standard deviation in pixels.
    pub fn sigma(&self) -> f64 {
        self.sigma
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

    /// The profile squared, for sums over squared footprints.
    pub(crate) fn squared(&self) -> Self {
        Self { sigma: self.sigma, taps: self.taps.iter().map(|t| t * t).collect() }
    }
}
