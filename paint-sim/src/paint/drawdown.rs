//! A paint from a drawdown: one film over the black and the white of a contrast card.

use super::Paint;
use crate::colour::{BANDS, Spectrum};
use crate::error::{Error, check_positive, check_range};

/// Difference of the two reflectances, over that of the card, below which a film hides the card.
const HIDDEN: f64 = 1e-4;
/// `(K + S) / S` from which on nothing is scattered.
const CLEAR: f64 = 1e6;

/// A film of one thickness over two grounds, reflectances per band without the air's interface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawdown {
    /// Reflectance of the bare dark ground.
    pub black: Spectrum,
    /// Of the bare light one.
    pub white: Spectrum,
    /// Of the film on the dark ground.
    pub over_black: Spectrum,
    /// Of the film on the light one.
    pub over_white: Spectrum,
    /// Thickness of the dry film, metres.
    pub thickness: f64,
}

impl Paint {
    /// The paint of a drawdown. Both readings give `b coth(b S d) = (1 + R R_g - a (R + R_g)) / (R - R_g)` (Kubelka 1948, solved for it), which
    /// two grounds solve for `a = (K + S) / S`, `b² = a² - 1`.
    ///
    /// # Errors
    /// Reflectances outside 0..=1, a thickness that is not positive, a film that hides the card or is lighter over black than over white.
    pub fn from_drawdown(drawdown: &Drawdown) -> Result<Self, Error> {
        check_positive("thickness of a drawdown", drawdown.thickness)?;
        let (mut absorption, mut scattering) = ([0.0; BANDS], [0.0; BANDS]);
        for band in 0..BANDS {
            (absorption[band], scattering[band]) = band_of(drawdown, band)?;
        }
        Self::new(&absorption, &scattering, drawdown.thickness)
    }
}

/// `K d` and `S d` of one band.
fn band_of(drawdown: &Drawdown, band: usize) -> Result<(f64, f64), Error> {
    let (dark, light) = (drawdown.black[band], drawdown.white[band]);
    let (r, q) = (drawdown.over_black[band], drawdown.over_white[band]);
    for value in [dark, light, r, q] {
        check_range("reflectance of a drawdown", value, 0.0, 1.0, "between 0 and 1")?;
    }
    let card = light - dark;
    check_range("contrast of a drawdown's card", card, HIDDEN, 1.0, "a light ground beside a dark one")?;
    check_range(
        "difference of a film over white and black",
        (q - r) / card,
        HIDDEN,
        1.0,
        "above 0.0001 of the card's",
    )?;
    let below = (r + dark) * (q - light) - (q + light) * (r - dark);
    let a = ((1.0 + r * dark) * (q - light) - (1.0 + q * light) * (r - dark)) / below;
    if a.is_nan() || a >= CLEAR {
        return Ok((-0.5 * (q / light).ln(), 0.0));
    }
    // Rounding may lead just below the film that absorbs nothing.
    let a = a.max(1.0);
    let b = (a * a - 1.0).sqrt();
    let c = (1.0 + q * light - a * (q + light)) / (q - light);
    let s = if b < 1e-6 { 1.0 / c } else { (b / c).atanh() / b };
    check_range("scattering of a drawdown's film", s, 0.0, f64::MAX, "finite: the readings do not belong to one film")?;
    Ok((s * (a - 1.0), s))
}
