//! The films of a palette's paints, a block of pixels at a time, in single precision.

use super::palette::{MAX_PAINTS, Palette};
use crate::network::{BLOCK, Real};

/// Absorbances are told apart down to this reflectance.
const DARKEST: f32 = 1e-3;

/// What a film absorbs that makes a substrate look like a colour.
pub(super) fn absorbance(substrate: f32, colour: f32) -> f32 {
    (substrate.max(DARKEST) / colour.max(DARKEST)).ln()
}

/// One value for each pixel of a block.
pub(super) type Block = [f32; BLOCK];

/// Where the rows of a metric `M` lie in its six blocks, `M₀₀ M₀₁ M₀₂ M₁₁ M₁₂ M₂₂`.
pub(super) const ROWS: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// What unit depths of the paints absorb and scatter, band by band.
pub(super) struct Mixture {
    pub(super) paints: usize,
    absorption: [[f32; 3]; MAX_PAINTS],
    scattering: [[f32; 3]; MAX_PAINTS],
    pub(super) substrate: [f32; 3],
    /// Absorbance of unit depth of each paint over the substrate.
    pub(super) density: [[f32; 3]; MAX_PAINTS],
    /// Whether any paint scatters: glazes alone cost one exponential.
    scatters: bool,
}

/// Kubelka-Munk reflectance for a block of pixels, in one band.
struct Film {
    colour: Block,
    by_absorption: Block,
    by_scattering: Block,
}

impl Mixture {
    pub(super) fn new(palette: &Palette) -> Self {
        let (mut absorption, mut scattering) = ([[0.0; 3]; MAX_PAINTS], [[0.0; 3]; MAX_PAINTS]);
        for (p, paint) in palette.paints().iter().enumerate() {
            absorption[p] = paint.absorption.map(|v| v as f32);
            scattering[p] = paint.scattering.map(|v| v as f32);
        }
        let mut density = [[0.0; 3]; MAX_PAINTS];
        for (p, density) in density.iter_mut().enumerate().take(palette.paints().len()) {
            let mut one = [0.0; MAX_PAINTS];
            one[p] = 1.0;
            let painted = palette.colour(&one);
            *density = std::array::from_fn(|band| absorbance(palette.substrate()[band] as f32, painted[band] as f32));
        }
        let scatters = scattering.as_flattened().iter().any(|&s| s > 0.0);
        Self {
            paints: palette.paints().len(),
            absorption,
            scattering,
            density,
            substrate: palette.substrate().map(|v| v as f32),
            scatters,
        }
    }

    /// `(I - T)ᵀ M (I - T)` summed over a block of pixels; puts half its derivative in the place of the depths.
    #[inline(always)]
    pub(super) fn cost_and_gradient(
        &self,
        depths: &mut [Block; MAX_PAINTS],
        wanted: &[Block; 3],
        metric: &[Block; 6],
    ) -> f32 {
        let films = self.films(depths);
        let mut residual = [[0.0; BLOCK]; 3];
        for band in 0..3 {
            for lane in 0..BLOCK {
                residual[band][lane] = films[band].colour[lane] - wanted[band][lane];
            }
        }
        let weighted = times(metric, &residual);
        for (p, depth) in depths.iter_mut().enumerate().take(self.paints) {
            *depth = dot(&self.slopes(p, &films), &weighted);
        }
        dot(&residual, &weighted).iter().sum()
    }

    /// Puts `(∂I/∂d)ᵀ M (∂I/∂d)` in the place of the depth `d` of every paint.
    #[inline(always)]
    pub(super) fn curvature(&self, depths: &mut [Block; MAX_PAINTS], _: &[Block; 3], metric: &[Block; 6]) {
        let films = self.films(depths);
        for (p, depth) in depths.iter_mut().enumerate().take(self.paints) {
            let slopes = self.slopes(p, &films);
            *depth = dot(&slopes, &times(metric, &slopes));
        }
    }

    /// The films of given depths, band by band.
    #[inline(always)]
    fn films(&self, depths: &[Block; MAX_PAINTS]) -> [Film; 3] {
        let mut films = [Film::BARE; 3];
        for (band, film) in films.iter_mut().enumerate() {
            let absorption = self.sum(&self.absorption, band, depths);
            if self.scatters {
                film.fill(&absorption, &self.sum(&self.scattering, band, depths), self.substrate[band]);
            } else {
                film.fill_glazes(&absorption, self.substrate[band]);
            }
        }
        films
    }

    #[inline(always)]
    fn sum(&self, of: &[[f32; 3]; MAX_PAINTS], band: usize, depths: &[Block; MAX_PAINTS]) -> Block {
        let mut sum = [0.0; BLOCK];
        for (of, depth) in of.iter().zip(depths).take(self.paints) {
            for lane in 0..BLOCK {
                sum[lane] += of[band] * depth[lane];
            }
        }
        sum
    }

    /// The derivative of the colour by the depth of a paint.
    #[inline(always)]
    fn slopes(&self, paint: usize, films: &[Film; 3]) -> [Block; 3] {
        let mut slopes = [[0.0; BLOCK]; 3];
        for (band, (slopes, film)) in slopes.iter_mut().zip(films).enumerate() {
            let (k, s) = (self.absorption[paint][band], self.scattering[paint][band]);
            for ((slope, by_k), by_s) in slopes.iter_mut().zip(&film.by_absorption).zip(&film.by_scattering) {
                *slope = k * by_k + s * by_s;
            }
        }
        slopes
    }
}

/// `M a`.
#[inline(always)]
fn times(metric: &[Block; 6], a: &[Block; 3]) -> [Block; 3] {
    let mut out = [[0.0; BLOCK]; 3];
    for (out, row) in out.iter_mut().zip(ROWS) {
        for lane in 0..BLOCK {
            out[lane] = metric[row[0]][lane] * a[0][lane]
                + metric[row[1]][lane] * a[1][lane]
                + metric[row[2]][lane] * a[2][lane];
        }
    }
    out
}

/// `aᵀ b`.
#[inline(always)]
fn dot(a: &[Block; 3], b: &[Block; 3]) -> Block {
    let mut out = [0.0; BLOCK];
    for lane in 0..BLOCK {
        out[lane] = a[0][lane] * b[0][lane] + a[1][lane] * b[1][lane] + a[2][lane] * b[2][lane];
    }
    out
}

impl Film {
    const BARE: Self = Self { colour: [0.0; BLOCK], by_absorption: [0.0; BLOCK], by_scattering: [0.0; BLOCK] };

    #[inline(always)]
    fn fill(&mut self, absorption: &Block, scattering: &Block, g: f32) {
        for lane in 0..BLOCK {
            let (k, s) = (absorption[lane], scattering[lane]);
            let (t, slope) = tanhc(k * (k + 2.0 * s));
            let (above, below) = (s - g * (k + s), k + s - s * g);
            let over = 1.0 / (1.0 + t * below);
            let colour = (g + t * above) * over;
            let (by_k, by_s) = (2.0 * slope * (k + s), 2.0 * slope * k);
            self.colour[lane] = colour;
            self.by_absorption[lane] = (by_k * above - t * g - colour * (by_k * below + t)) * over;
            self.by_scattering[lane] = (by_s * above + t * (1.0 - g) * (1.0 - colour) - colour * by_s * below) * over;
        }
    }

    /// Beer-Lambert; how the colour changes by scattering is left at 0, as no paint has any.
    #[inline(always)]
    fn fill_glazes(&mut self, absorption: &Block, g: f32) {
        for ((k, colour), by_absorption) in absorption.iter().zip(&mut self.colour).zip(&mut self.by_absorption) {
            *colour = g * Real::exp(-2.0 * k);
            *by_absorption = -2.0 * *colour;
        }
    }
}

/// `tanh √q / √q` by the ninth convergent of Lambert's continued fraction, within 5e-5 of it, and its derivative by `q`.
#[inline(always)]
fn tanhc(q: f32) -> (f32, f32) {
    // Up to here the convergent is good; beyond, the hyperbolic tangent is 1.
    const LAST: f32 = 27.0;
    let c = q.min(LAST);
    let above = (((c + 990.0) * c + 135_135.0) * c + 4_729_725.0) * c + 34_459_425.0;
    let below = (((45.0 * c + 13_860.0) * c + 945_945.0) * c + 16_216_200.0) * c + 34_459_425.0;
    let t = if q > LAST { 1.0 / q.sqrt() } else { above / below };
    let small = -1.0 / 3.0 + c * (4.0 / 15.0 - c * (17.0 / 105.0));
    let large = (1.0 - q * t * t - t) / (2.0 * q.max(0.01));
    (t, if q < 0.05 { small } else { large })
}
