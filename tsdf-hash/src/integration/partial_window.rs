//! Slopes at a pixel beside a gap or an edge, from the part of its window that lies on its own surface.

use crate::images::Intrinsics;
use crate::integration::gap_filling::{GRANTED, STEEPEST};
use crate::integration::inverse_depth_noise::InverseDepthNoise;
use crate::integration::plane_windows::HALO;

/// Pixels whose windows are fitted side by side: the widest vector register.
pub(crate) const LANES: usize = 8;

/// Pixels of the window along a row and a column.
const SIDE: usize = 5;
/// Pixels that a surface must have in the window, its own included (ours): what is only one pixel wide over less than
/// the window is taken for an invented depth between two surfaces.
const LEAST_PIXELS: f32 = 5.0;
/// Added to the spread of the pixels along each axis, squared pixels (ours): across a line of single pixels the slope is zero.
const RIDGE: f32 = 0.01;

/// The fit to what is left of a window.
#[derive(Clone, Copy)]
pub(crate) struct PartialWindow {
    noise: InverseDepthNoise,
    /// Largest relative change per pixel along a row and along a column.
    steepest: [f32; 2],
}

impl PartialWindow {
    pub(crate) fn new(k: &Intrinsics, noise: InverseDepthNoise) -> Self {
        Self { noise, steepest: [k.fx, k.fy].map(|f| STEEPEST / f.abs() as f32) }
    }

    /// Slopes of the inverse depth at some pixels `u` of the middle line, per pixel; NaN if too few pixels lie on the surface
    /// of one.
    ///
    /// First all count that a surface through the pixel can reach, then those within the noise of the plane fitted to them.
    #[inline(always)]
    pub(crate) fn slopes(&self, lines: [&[f32]; SIDE], u: [usize; LANES]) -> [Lanes; 2] {
        let mut window = [[[0.0; LANES]; SIDE]; SIDE];
        for (line, columns) in lines.iter().zip(&mut window) {
            for k in 0..LANES {
                let line = &line[u[k] + HALO - SIDE / 2..][..SIDE];
                for x in 0..SIDE {
                    columns[x][k] = line[x];
                }
            }
        }
        let own = window[SIDE / 2][SIDE / 2];
        let granted = lanes(|k| GRANTED * self.noise.sigma_inverse(own[k]));
        let steepest = self.steepest.map(|slope| lanes(|k| slope * own[k]));
        let first = fit(&window, [[0.0; LANES]; 2], granted, steepest);
        let fine = fit(&window, first.slope, granted, [[0.0; LANES]; 2]);
        let is_good =
            |k: usize| first.n[k] >= LEAST_PIXELS && fine.n[k] >= LEAST_PIXELS && fine.middle[k].abs() <= granted[k];
        fine.slope.map(|slope| lanes(|k| if is_good(k) { slope[k] } else { f32::NAN }))
    }
}

type Lanes = [f32; LANES];

#[inline(always)]
fn lanes(value: impl Fn(usize) -> f32) -> Lanes {
    let mut all = [0.0; LANES];
    for (k, one) in all.iter_mut().enumerate() {
        *one = value(k);
    }
    all
}

#[inline(always)]
fn sum(a: Lanes, b: Lanes) -> Lanes {
    lanes(|k| a[k] + b[k])
}

#[inline(always)]
fn scaled(factor: f32, a: Lanes) -> Lanes {
    lanes(|k| factor * a[k])
}

/// `Σ i x_i` for `i = -2..=2`.
#[inline(always)]
fn moment(x: [Lanes; SIDE]) -> Lanes {
    lanes(|k| 2.0 * (x[4][k] - x[0][k]) + (x[3][k] - x[1][k]))
}

struct Fit {
    /// Pixels on the surface.
    n: Lanes,
    /// From the pixel's own inverse depth.
    middle: Lanes,
    slope: [Lanes; 2],
}

/// Least squares over the pixels that are no farther from a plane through the middle one than is granted.
#[inline(always)]
fn fit(window: &[[Lanes; SIDE]; SIDE], tilt: [Lanes; 2], granted: Lanes, steepest: [Lanes; 2]) -> Fit {
    let own = window[SIDE / 2][SIDE / 2];
    let zero = [0.0; LANES];
    let [mut n, mut sx, mut sy, mut sw] = [zero; 4];
    let [mut sxx, mut sxy, mut syy, mut sxw, mut syw] = [zero; 5];
    for (row, line) in window.iter().enumerate() {
        let y = row as f32 - (SIDE / 2) as f32;
        // Ones and inverse depths of the pixels that are taken.
        let (mut ones, mut values) = ([zero; SIDE], [zero; SIDE]);
        for (column, w) in line.iter().enumerate() {
            let x = column as f32 - (SIDE / 2) as f32;
            for k in 0..LANES {
                let value = w[k] - own[k];
                let off = (value - tilt[0][k] * x - tilt[1][k] * y).abs();
                // A NaN is not taken.
                let taken = off <= granted[k] + steepest[0][k] * x.abs() + steepest[1][k] * y.abs();
                let taken = u32::from(taken).wrapping_neg();
                ones[column][k] = f32::from_bits(1.0_f32.to_bits() & taken);
                values[column][k] = f32::from_bits(value.to_bits() & taken);
            }
        }
        let total = |x: [Lanes; SIDE]| lanes(|k| ((x[0][k] + x[4][k]) + (x[1][k] + x[3][k])) + x[2][k]);
        let (count, value, along) = (total(ones), total(values), moment(ones));
        let squares = lanes(|k| 4.0 * (ones[0][k] + ones[4][k]) + (ones[1][k] + ones[3][k]));
        (n, sx, sy, sw) = (sum(n, count), sum(sx, along), sum(sy, scaled(y, count)), sum(sw, value));
        (sxx, sxy, syy) = (sum(sxx, squares), sum(sxy, scaled(y, along)), sum(syy, scaled(y * y, count)));
        (sxw, syw) = (sum(sxw, moment(values)), sum(syw, scaled(y, value)));
    }
    let (mut middle, mut slope) = (zero, [zero; 2]);
    for k in 0..LANES {
        let (mx, my) = (sx[k] / n[k], sy[k] / n[k]);
        let (a, b, d) = (sxx[k] - sx[k] * mx + RIDGE, sxy[k] - sx[k] * my, syy[k] - sy[k] * my + RIDGE);
        let (p, q) = (sxw[k] - sw[k] * mx, syw[k] - sw[k] * my);
        let determinant = a * d - b * b;
        (slope[0][k], slope[1][k]) = ((d * p - b * q) / determinant, (a * q - b * p) / determinant);
        middle[k] = sw[k] / n[k] - slope[0][k] * mx - slope[1][k] * my;
    }
    Fit { n, middle, slope }
}
