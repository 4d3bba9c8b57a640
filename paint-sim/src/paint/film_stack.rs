//! Films of several paints over each other, each dry before the next, for programs that look at them millions of times.
//!
//! `unsafe`: a function that is compiled for AVX2 may only be called where the processor has it; that is asked before. Both versions do the
//! same operations in the same order, so their results are the same bits.
#![allow(unsafe_code, reason = "a function compiled for AVX2 is called where the processor has it")]

use std::sync::Arc;

use super::Paint;
use crate::colour::{BANDS, Spectrum, band_white, xyz};
use crate::error::{Error, check_positive, check_range};
use crate::km::tanhc;

/// Most films in a stack.
pub const MOST_FILMS: usize = 12;
/// Depths in a table: between two of them the straight line is within 5e-6 of the curve.
const SAMPLES: usize = 1024;
/// Bands that are worked on at once.
const LANES: usize = 4;

/// Reflectance per band in single precision.
pub type Bands = [f32; BANDS];

/// Films over each other in single precision: colour, and how it changes with the thickness of each film.
///
/// A film of the depth `d` on a ground that reflects `R_g` reflects `(R_g + t (S (1-R_g) - K R_g)) / (1 + t (S (1-R_g) + K))` with
/// `t = tanh(g d) / g`, `g² = K (K + 2 S)`; `t` is tabulated, and everything else follows from it without another exponential: by depth Riccati's
/// equation, by the ground `(1 - g² t²) / (..)²`. Depths are thicknesses over a unit of the caller's choice; beyond the deepest, the deepest counts.
///
/// ```
/// use paint_sim::Substrate;
/// use paint_sim::paint::{FilmStack, PaintName};
///
/// let paints = [PaintName::White.paint(20e-6)?, PaintName::Blue.paint(20e-6)?];
/// let stack = FilmStack::new(&paints, 20e-6, 4.0)?;
/// let wall = FilmStack::bands(Substrate::sandstone().reflectance());
/// let mut slopes = [[0.0; 3]; 2];
/// let [lightness, ..] = stack.lab(&[1.0, 0.5], &wall, &mut slopes);
/// // More blue above is darker.
/// assert!(lightness > 40.0 && slopes[1][0] < 0.0);
/// # Ok::<(), paint_sim::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct FilmStack {
    films: Vec<Arc<Table>>,
    /// Depths from sample to sample, over one.
    samples_per_depth: f64,
    /// What a band adds to the tristimulus values, over those of the white.
    observer: [Bands; 3],
}

/// A paint per unit of depth, and `t` at every sample.
#[derive(Debug)]
struct Table {
    absorption: Bands,
    scattering: Bands,
    /// `g²`.
    square: Bands,
    t: Vec<Bands>,
}

impl FilmStack {
    /// Paints from the lowest film up, at most [`MOST_FILMS`]; a depth of 1 is a film of `unit_thickness` metres.
    ///
    /// # Errors
    /// More paints than that; a thickness or depth that is not positive.
    pub fn new(paints: &[Paint], unit_thickness: f64, deepest: f64) -> Result<Self, Error> {
        check_range("number of films", paints.len() as f64, 1.0, MOST_FILMS as f64, "1 to 12 films")?;
        check_positive("unit thickness of a paint", unit_thickness)?;
        check_positive("deepest film of a table", deepest)?;
        let white = band_white();
        let mut observer = [[0.0; BANDS]; 3];
        for band in 0..BANDS {
            let mut only = [0.0; BANDS];
            only[band] = 1.0;
            let values = xyz(&only);
            for (c, row) in observer.iter_mut().enumerate() {
                row[band] = (values[c] / white[c]) as f32;
            }
        }
        let step = deepest / (SAMPLES - 1) as f64;
        let films = paints.iter().map(|paint| Arc::new(Table::new(paint, unit_thickness, step))).collect();
        Ok(Self { films, samples_per_depth: 1.0 / step, observer })
    }

    /// Some of these films in another order, the lowest first. Numbers beyond the last are left out.
    #[must_use]
    pub fn select(&self, order: &[usize]) -> Self {
        let films = order.iter().filter_map(|&k| self.films.get(k).cloned()).collect();
        Self { films, ..self.clone() }
    }

    /// The films of other stacks of one unit and depth, the lowest first.
    pub fn stacked<'a>(stacks: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut stacks = stacks.into_iter();
        let mut all = stacks.next().cloned().unwrap_or_else(|| Self {
            films: Vec::new(),
            samples_per_depth: 0.0,
            observer: [[0.0; BANDS]; 3],
        });
        all.films.extend(stacks.flat_map(|stack| stack.films.iter().cloned()));
        all
    }

    /// How many films there are.
    pub fn films(&self) -> usize {
        self.films.len()
    }

    /// A ground as a stack takes it.
    pub fn bands(reflectance: &Spectrum) -> Bands {
        reflectance.map(|r| r as f32)
    }

    /// CIELAB under D65 of films of these depths on a ground, those missing count as 0, and its derivative by as many of the depths as `slopes` has room
    /// for.
    pub fn lab(&self, depths: &[f64], ground: &Bands, slopes: &mut [[f64; 3]]) -> [f64; 3] {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.lab_avx2(depths, ground, slopes) };
        }
        self.lab_anywhere(depths, ground, slopes)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn lab_avx2(&self, depths: &[f64], ground: &Bands, slopes: &mut [[f64; 3]]) -> [f64; 3] {
        self.lab_anywhere(depths, ground, slopes)
    }

    #[inline(always)]
    fn lab_anywhere(&self, depths: &[f64], ground: &Bands, slopes: &mut [[f64; 3]]) -> [f64; 3] {
        let mut reflectance = *ground;
        let mut by_depth = [[0.0; BANDS]; MOST_FILMS];
        let mut by_ground = [[0.0; BANDS]; MOST_FILMS];
        let count = depths.len().min(self.films.len());
        for (k, (film, &depth)) in self.films.iter().zip(depths).enumerate() {
            let t = film.at(depth * self.samples_per_depth);
            film.cover(&t, &mut reflectance, &mut by_depth[k], &mut by_ground[k]);
        }
        let white = self.tristimulus(&reflectance);
        let (lab, by_white) = lab_and_slopes(white);
        let mut through = [1.0; BANDS];
        for k in (0..count).rev() {
            for band in 0..BANDS {
                by_depth[k][band] *= through[band];
                through[band] *= by_ground[k][band];
            }
            if let Some(slope) = slopes.get_mut(k) {
                let by = self.tristimulus(&by_depth[k]);
                *slope = by_white.map(|row| row[0] * by[0] + row[1] * by[1] + row[2] * by[2]);
            }
        }
        lab
    }

    /// Tristimulus values over those of the white.
    #[inline(always)]
    fn tristimulus(&self, bands: &Bands) -> [f64; 3] {
        self.observer.each_ref().map(|weights| {
            let mut sums = [0.0_f32; LANES];
            for (bands, weights) in bands.chunks_exact(LANES).zip(weights.chunks_exact(LANES)) {
                for lane in 0..LANES {
                    sums[lane] += bands[lane] * weights[lane];
                }
            }
            f64::from((sums[0] + sums[1]) + (sums[2] + sums[3]))
        })
    }
}

impl Table {
    fn new(paint: &Paint, unit_thickness: f64, step: f64) -> Self {
        let unit = |spectrum: &Spectrum| spectrum.map(|v| v * unit_thickness);
        let (k, s) = (unit(paint.absorption()), unit(paint.scattering()));
        let sample = |i: usize| {
            let depth = step * i as f64;
            std::array::from_fn(|b| {
                let g = (k[b] * (k[b] + 2.0 * s[b])).sqrt();
                (depth * tanhc(g * depth)) as f32
            })
        };
        Self {
            absorption: k.map(|v| v as f32),
            scattering: s.map(|v| v as f32),
            square: std::array::from_fn(|b| (k[b] * (k[b] + 2.0 * s[b])) as f32),
            t: (0..SAMPLES).map(sample).collect(),
        }
    }

    /// `t` at a place between samples.
    #[inline(always)]
    fn at(&self, place: f64) -> Bands {
        let place = place.clamp(0.0, (SAMPLES - 1) as f64);
        let k = (place as usize).min(SAMPLES - 2);
        let share = (place - k as f64) as f32;
        let (a, b) = (&self.t[k], &self.t[k + 1]);
        let mut t = [0.0; BANDS];
        for band in 0..BANDS {
            t[band] = a[band] + share * (b[band] - a[band]);
        }
        t
    }

    /// The film on a ground of this reflectance, which becomes that of the ground of the next.
    #[inline(always)]
    fn cover(&self, t: &Bands, reflectance: &mut Bands, by_depth: &mut Bands, by_ground: &mut Bands) {
        for band in 0..BANDS {
            let (k, s, t, below) = (self.absorption[band], self.scattering[band], t[band], reflectance[band]);
            let scattered = s * (1.0 - below);
            let over = 1.0 / (1.0 + t * (scattered + k));
            let above = (below + t * (scattered - k * below)) * over;
            by_depth[band] = s - 2.0 * (k + s) * above + s * above * above;
            by_ground[band] = (1.0 - self.square[band] * t * t) * over * over;
            reflectance[band] = above;
        }
    }
}

/// Cube root of a positive number, within 1e-14 of it: two steps of Halley's from a third of the exponent.
fn cube_root(t: f64) -> f64 {
    let mut root = f64::from(f32::from_bits((t as f32).to_bits() / 3 + 0x2A51_19F2));
    for _ in 0..2 {
        let cube = root * root * root;
        root *= (cube + 2.0 * t) / (2.0 * cube + t);
    }
    root
}

/// CIELAB of tristimulus values over those of the white, and its derivatives by them.
fn lab_and_slopes(white: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let f = white.map(|t| {
        if t > (6.0_f64 / 29.0).powi(3) {
            let root = cube_root(t);
            (root, 1.0 / (3.0 * root * root))
        } else {
            let slope = (29.0_f64 / 6.0).powi(2) / 3.0;
            (t * slope + 4.0 / 29.0, slope)
        }
    });
    let [(x, dx), (y, dy), (z, dz)] = f;
    let lab = [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)];
    (lab, [[0.0, 116.0 * dy, 0.0], [500.0 * dx, -500.0 * dy, 0.0], [0.0, 200.0 * dy, -200.0 * dz]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::PIGMENTS;

    #[test]
    fn cube_roots_are_those_of_the_standard_library() {
        let worst = (0..10_000).map(|k| 0.008 * 1.0007_f64.powi(k)).map(|t| (cube_root(t) / t.cbrt() - 1.0).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-14);
    }

    #[test]
    fn both_versions_give_the_same_bits() {
        let paints: Vec<Paint> = PIGMENTS[..5].iter().map(|pigment| pigment.paint(20e-6).unwrap()).collect();
        let stack = FilmStack::new(&paints, 20e-6, 4.0).unwrap();
        for k in 0..200_u32 {
            let depths: Vec<f64> = (0..5).map(|p| f64::from(k * (p + 3) % 17) * 0.3).collect();
            let ground = std::array::from_fn(|band| 0.02 + 0.02 * (band as f32 + 0.01 * k as f32));
            let (mut slopes, mut same) = ([[0.0; 3]; 5], [[0.0; 3]; 5]);
            let lab = stack.lab(&depths, &ground, &mut slopes);
            assert_eq!((lab, slopes), (stack.lab_anywhere(&depths, &ground, &mut same), same));
        }
    }
}
