//! Colours of many films at once, in single precision.
//!
//! `unsafe`: a function that is compiled for AVX2 may only be called where the processor has it; that is asked before. Both versions do the
//! same operations in the same order, so their results are the same bits.
#![allow(unsafe_code, reason = "a function compiled for AVX2 is called where the processor has it")]

use super::{Paint, Substrate};
use crate::colour::{BANDS, Srgb8Table, linear_srgb_weights};
use crate::error::Error;

/// Films side by side, so that a loop over them becomes vector code.
const LANES: usize = 16;
/// A film of a paint that does not absorb is the limit of one that hardly does.
const LEAST_ABSORPTION: f32 = 1e-6;
/// `2^f - 1 = f (c0 + c1 f + ...)` for `f` in `-1/2..=1/2`, by interpolation at the Chebyshev nodes: within 4e-9.
const EXP2: [f32; 6] =
    [std::f32::consts::LN_2, 2.402_265_1e-1, 5.550_357_1e-2, 9.618_082_6e-3, 1.339_086_3e-3, 1.545_316_3e-4];
/// A sum with it is rounded to a whole number, which stands in its last bits.
const ROUNDING: f32 = 12_582_912.0;

/// How films of one paint on one ground look, as many as there are.
///
/// The same as [`Paint::over`] and [`spectrum_linear_srgb`](crate::colour::spectrum_linear_srgb), within 3e-6 of linear sRGB and a step of
/// its bytes, an order of magnitude faster.
///
/// ```
/// use paint_sim::{Paint, Substrate};
/// use paint_sim::paint::FilmColours;
///
/// let films = FilmColours::new(&Paint::yellow(20e-6)?, &Substrate::grey(0.5)?);
/// let mut colours = [[0; 3]; 4];
/// films.srgb8(&[0.0, 10e-6, 20e-6, 40e-6], &mut colours)?;
/// assert!(colours[0][2] > colours[3][2]);
/// # Ok::<(), paint_sim::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct FilmColours {
    bands: [Band; BANDS],
}

/// One band, as the formula needs it.
#[derive(Debug, Clone, Copy)]
struct Band {
    /// `g = sqrt(K (K + 2 S))`, 1/m.
    decay: f32,
    /// `-2 g / ln 2`.
    exponent: f32,
    ground: f32,
    /// `S (1 - Rg) - K Rg`.
    gained: f32,
    /// `S (1 - Rg) + K`.
    lost: f32,
    /// Share of its reflectance in linear red, green and blue.
    weights: [f32; 3],
}

impl FilmColours {
    /// Of films of `paint` on `ground`.
    pub fn new(paint: &Paint, ground: &Substrate) -> Self {
        let weights = linear_srgb_weights();
        let bands = std::array::from_fn(|j| {
            let (k, s, rg) = (paint.absorption()[j], paint.scattering()[j], ground.reflectance()[j]);
            let decay = (k.sqrt() * (k + 2.0 * s).sqrt()) as f32;
            let decay = decay.max(LEAST_ABSORPTION * (k + s) as f32).max(f32::EPSILON);
            Band {
                decay,
                exponent: -2.0 * std::f32::consts::LOG2_E * decay,
                ground: rg as f32,
                gained: (s * (1.0 - rg) - k * rg) as f32,
                lost: (s * (1.0 - rg) + k) as f32,
                weights: weights[j].map(|weight| weight as f32),
            }
        });
        Self { bands }
    }

    /// Linear sRGB under D65 of films so thick, metres; not clipped. A thickness that is negative or not a number counts as none.
    ///
    /// # Errors
    /// Not as many colours as films.
    pub fn linear_srgb(&self, thickness: &[f32], colours: &mut [[f32; 3]]) -> Result<(), Error> {
        self.each(thickness, colours, |linear| linear)
    }

    /// The same as sRGB bytes, clipped.
    ///
    /// # Errors
    /// Not as many colours as films.
    pub fn srgb8(&self, thickness: &[f32], colours: &mut [[u8; 3]]) -> Result<(), Error> {
        let table = Srgb8Table::get();
        self.each(thickness, colours, |linear| linear.map(|c| table.encode(c)))
    }

    fn each<C>(&self, thickness: &[f32], colours: &mut [C], of: impl Fn([f32; 3]) -> C) -> Result<(), Error> {
        if thickness.len() != colours.len() {
            return Err(Error::WrongLength { what: "colours", expected: thickness.len(), found: colours.len() });
        }
        let linear = vectorised();
        for (films, colours) in thickness.chunks(LANES).zip(colours.chunks_mut(LANES)) {
            let mut lanes = [0.0; LANES];
            lanes[..films.len()].copy_from_slice(films);
            let [red, green, blue] = linear(&self.bands, &lanes);
            for (lane, colour) in colours.iter_mut().enumerate() {
                *colour = of([red[lane], green[lane], blue[lane]]);
            }
        }
        Ok(())
    }
}

type Linear = fn(&[Band; BANDS], &[f32; LANES]) -> [[f32; LANES]; 3];

/// The best version that this processor runs.
fn vectorised() -> Linear {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return |bands, films| unsafe { linear_avx2(bands, films) };
    }
    linear
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn linear_avx2(bands: &[Band; BANDS], films: &[f32; LANES]) -> [[f32; LANES]; 3] {
    linear(bands, films)
}

/// Red, green and blue of films. With `e = exp(-2 g d)`:
/// `R = (Rg g (1+e) + (1-e) (S (1-Rg) - K Rg)) / (g (1+e) + (1-e) (S (1-Rg) + K))`, Kubelka 1948 with its hyperbolic tangent written out;
/// `1-e` is summed without cancellation.
#[inline(always)]
fn linear(bands: &[Band; BANDS], films: &[f32; LANES]) -> [[f32; LANES]; 3] {
    let mut colours = [[0.0; LANES]; 3];
    for band in bands {
        for lane in 0..LANES {
            // `max` also takes what is not a number away.
            let power = (films[lane].max(0.0) * band.exponent).max(-126.0);
            let whole = power + ROUNDING;
            let part = power - (whole - ROUNDING);
            let scale = f32::from_bits((whole.to_bits() << 23).wrapping_add(1.0_f32.to_bits()));
            let [c0, c1, c2, c3, c4, c5] = EXP2;
            let rest = scale * (part * (c0 + part * (c1 + part * (c2 + part * (c3 + part * (c4 + part * c5))))));
            let absorbed = (1.0 - scale) - rest;
            let passed = band.decay * (1.0 + (scale + rest));
            let reflectance = (band.ground * passed + absorbed * band.gained) / (passed + absorbed * band.lost);
            for (colour, weight) in colours.iter_mut().zip(band.weights) {
                colour[lane] += reflectance * weight;
            }
        }
    }
    colours
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the processor's own vectors compute is what any computes.
    #[test]
    fn all_versions_give_the_same_bits() {
        let films = FilmColours::new(&Paint::yellow(20e-6).unwrap(), &Substrate::grey(0.4).unwrap());
        for round in 0_u8..40 {
            let thickness = std::array::from_fn(|lane| 1.7e-6 * f32::from(round) + 3e-7 * lane as f32);
            let [plain, vector] = [linear, vectorised()].map(|version| version(&films.bands, &thickness));
            assert_eq!(plain.map(|c| c.map(f32::to_bits)), vector.map(|c| c.map(f32::to_bits)));
        }
    }
}
