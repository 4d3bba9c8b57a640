//! Colours of many films at once, in single precision.
//!
//! `unsafe`: a function that is compiled for AVX2 and FMA may only be called where the processor has them; that is asked before. Both versions do
//! the same operations in the same order, each rounded once, so their results are the same bits.
#![allow(unsafe_code, reason = "a function compiled for AVX2 and FMA is called where the processor has them")]

use super::{Paint, Substrate};
use crate::colour::{BANDS, Srgb8Table, linear_srgb_weights};
use crate::error::Error;

/// Films side by side, so that a loop over them becomes vector code.
const LANES: usize = 16;
/// A film of a paint that does not absorb is the limit of one that hardly does.
const LEAST_ABSORPTION: f64 = 1e-6;
/// `2^f - 1 = f (c0 + c1 f + ...)` for `f` in `-1/2..=1/2`, by interpolation at the Chebyshev nodes: within 4e-9.
const EXP2: [f32; 6] =
    [std::f32::consts::LN_2, 2.402_265_1e-1, 5.550_357_1e-2, 9.618_082_6e-3, 1.339_086_3e-3, 1.545_316_3e-4];
/// A sum with it is rounded to a whole number, which stands in its last bits.
const ROUNDING: f32 = 12_582_912.0;

/// How films on one ground look, as many as there are: of one paint, or of several paints over each other, each dry before the next.
///
/// The same as [`Paint::over`] and [`spectrum_linear_srgb`](crate::colour::spectrum_linear_srgb), within 2e-6 of linear sRGB and a step of
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
    /// From the lowest film up.
    pub(super) films: Vec<[Band; BANDS]>,
    /// Reflectance of the ground, and its share in linear red, green and blue.
    pub(super) grounds: [(f32, [f32; 3]); BANDS],
}

/// One band of a paint, as the formula needs it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Band {
    /// `-2 g / ln 2` with `g = sqrt(K (K + 2 S))`, 1/m.
    pub(super) exponent: f32,
    /// `1 + K/g` and `1 - K/g`.
    pub(super) sides: [f32; 2],
    /// `S/g`.
    pub(super) scattering: f32,
}

impl Band {
    /// Reflectance of a film, its thickness not negative, on a ground that reflects `ground`. With `e = exp(-2 g d)`:
    /// `R = (Rg (2 - l (1 + K/g)) + l S/g (1-Rg)) / (2 - l (1 - K/g) + l S/g (1-Rg))` and `l = 1-e`, Kubelka 1948 with its hyperbolic tangent
    /// written out; `l` is summed without cancellation.
    #[inline(always)]
    fn over(&self, thickness: f32, ground: f32) -> f32 {
        let power = (thickness * self.exponent).max(-126.0);
        let whole = power + ROUNDING;
        let part = power - (whole - ROUNDING);
        let scale = f32::from_bits((whole.to_bits() << 23).wrapping_add(1.0_f32.to_bits()));
        let [first @ .., last] = EXP2;
        let rest = first.iter().rev().fold(last, |sum, c| part.mul_add(sum, *c)) * part;
        let lost = (-scale).mul_add(rest, 1.0 - scale);
        let scattered = lost * self.scattering * (1.0 - ground);
        let [less, more] = self.sides.map(|side| (-lost).mul_add(side, 2.0));
        ground.mul_add(less, scattered) / (more + scattered)
    }
}

impl FilmColours {
    /// Of films of `paint` on `ground`.
    pub fn new(paint: &Paint, ground: &Substrate) -> Self {
        Self::stacked(std::slice::from_ref(paint), ground)
    }

    /// Of films of several paints over each other, from the lowest up.
    pub fn stacked(paints: &[Paint], ground: &Substrate) -> Self {
        let weights = linear_srgb_weights();
        let band = |paint: &Paint, j: usize| {
            let (k, s) = (paint.absorption()[j], paint.scattering()[j]);
            let decay = (k.sqrt() * (k + 2.0 * s).sqrt()).max(LEAST_ABSORPTION * (k + s)).max(f64::EPSILON);
            let exponent = -2.0 * std::f64::consts::LOG2_E * decay;
            let sides = [1.0 + k / decay, 1.0 - k / decay].map(|side| side as f32);
            Band { exponent: exponent as f32, sides, scattering: (s / decay) as f32 }
        };
        Self {
            films: paints.iter().map(|paint| std::array::from_fn(|j| band(paint, j))).collect(),
            grounds: std::array::from_fn(|j| (ground.reflectance()[j] as f32, weights[j].map(|weight| weight as f32))),
        }
    }

    /// Linear sRGB under D65 of films so thick, metres; not clipped. Of several paints: the films of the lowest everywhere, then those of the
    /// next. A thickness that is negative or not a number counts as none.
    ///
    /// # Errors
    /// Not as many thicknesses as colours, of every paint.
    pub fn linear_srgb(&self, thickness: &[f32], colours: &mut [[f32; 3]]) -> Result<(), Error> {
        self.each(thickness, colours, |linear| linear)
    }

    /// The same as sRGB bytes, clipped.
    ///
    /// # Errors
    /// Not as many thicknesses as colours, of every paint.
    pub fn srgb8(&self, thickness: &[f32], colours: &mut [[u8; 3]]) -> Result<(), Error> {
        let table = Srgb8Table::get();
        self.each(thickness, colours, |linear| linear.map(|c| table.encode(c)))
    }

    fn each<C>(&self, thickness: &[f32], colours: &mut [C], of: impl Fn([f32; 3]) -> C) -> Result<(), Error> {
        self.check(thickness, colours.len())?;
        let (linear, places) = (vectorised(), colours.len());
        let mut lanes = vec![[0.0; LANES]; self.films.len()];
        for (first, colours) in (0..).step_by(LANES).zip(colours.chunks_mut(LANES)) {
            for (film, lanes) in lanes.iter_mut().enumerate() {
                let at = film * places + first;
                for (lane, thickness) in lanes.iter_mut().zip(&thickness[at..at + colours.len()]) {
                    // `max` also takes what is not a number away.
                    *lane = thickness.max(0.0);
                }
            }
            let [red, green, blue] = linear(self, &lanes);
            for (lane, colour) in colours.iter_mut().enumerate() {
                *colour = of([red[lane], green[lane], blue[lane]]);
            }
        }
        Ok(())
    }

    /// Whether there are as many thicknesses as colours, of every paint.
    pub(super) fn check(&self, thickness: &[f32], colours: usize) -> Result<(), Error> {
        let expected = colours * self.films.len();
        if thickness.len() == expected {
            return Ok(());
        }
        Err(Error::WrongLength { what: "thicknesses", expected, found: thickness.len() })
    }
}

type Linear = fn(&FilmColours, &[[f32; LANES]]) -> [[f32; LANES]; 3];

/// The best version that this processor runs.
fn vectorised() -> Linear {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: the processor has AVX2 and FMA.
        return |stack, thickness| unsafe { linear_avx2(stack, thickness) };
    }
    linear
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn linear_avx2(stack: &FilmColours, thickness: &[[f32; LANES]]) -> [[f32; LANES]; 3] {
    linear(stack, thickness)
}

/// Red, green and blue of films. What a film reflects is the ground of the next.
#[inline(always)]
fn linear(stack: &FilmColours, thickness: &[[f32; LANES]]) -> [[f32; LANES]; 3] {
    // Two loops: the constants of the first leave no register to the sums of the second.
    let mut reflectance = stack.grounds.map(|(ground, _)| [ground; LANES]);
    for (film, thickness) in stack.films.iter().zip(thickness) {
        for (band, reflectance) in film.iter().zip(&mut reflectance) {
            for lane in 0..LANES {
                reflectance[lane] = band.over(thickness[lane], reflectance[lane]);
            }
        }
    }
    let mut colours = [[0.0; LANES]; 3];
    for ((_, weights), reflectance) in stack.grounds.iter().zip(&reflectance) {
        for (colour, weight) in colours.iter_mut().zip(weights) {
            for lane in 0..LANES {
                colour[lane] = reflectance[lane].mul_add(*weight, colour[lane]);
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
        let paints = [Paint::yellow(20e-6).unwrap(), Paint::blue(20e-6).unwrap()];
        let films = FilmColours::stacked(&paints, &Substrate::grey(0.4).unwrap());
        for round in 0_u8..40 {
            let thickness = std::array::from_fn(|lane| 1.7e-6 * f32::from(round) + 3e-7 * lane as f32);
            let [plain, vector] = [linear, vectorised()].map(|version| version(&films, &[thickness; 2]));
            assert_eq!(plain.map(|c| c.map(f32::to_bits)), vector.map(|c| c.map(f32::to_bits)));
        }
    }
}
