//! The "ideal" of Paper IV.

use crate::error::{Error, require};
use crate::image::Image;

/// The papers' "ideal" result: the wanted picture under a Gaussian filter (thesis, Paper IV, section 3.2; σ is half of the spray's radius in section 3.3). Border pixels are
/// repeated by reflection (`d c b a | a b c d`), taps reach 4 σ. Not an upper bound: deconvolution does better.
pub fn ideal(reference: &Image, sigma: f64) -> Result<Image, Error> {
    require("sigma", sigma, sigma > 0.0 && sigma <= 1e4, "it must lie in (0, 10000] pixels")?;
    let radius = (4.0 * sigma + 0.5) as i64;
    let taps: Vec<f64> = (-radius..=radius).map(|d| (-((d * d) as f64) / (2.0 * sigma * sigma)).exp()).collect();
    let total: f64 = taps.iter().sum();
    let blur = |n: usize, value: &dyn Fn(usize) -> f64, at: usize| -> f64 {
        taps.iter().zip(-radius..).map(|(tap, d)| tap * value(reflect(at as i64 + d, n))).sum::<f64>() / total
    };
    let (width, height) = (reference.width(), reference.height());
    let across = Image::from_fn(width, height, |x, y| blur(width, &|i| reference.at(i, y), x));
    Ok(Image::from_fn(width, height, |x, y| blur(height, &|j| across.at(x, j), y)))
}

/// Index of the mirrored continuation.
fn reflect(index: i64, n: usize) -> usize {
    let period = 2 * n as i64;
    let k = index.rem_euclid(period);
    (if k < n as i64 { k } else { period - 1 - k }) as usize
}
