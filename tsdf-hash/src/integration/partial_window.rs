//! Slopes at a pixel beside a gap or an edge, from the part of its window that lies on its own surface.

use crate::images::Intrinsics;
use crate::integration::gap_filling::{GRANTED, STEEPEST};
use crate::integration::inverse_depth_noise::InverseDepthNoise;
use crate::integration::plane_windows::HALO;

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

    /// Slopes of the inverse depth at pixel `u` of the middle line, per pixel; `None` if too few pixels lie on its surface.
    ///
    /// First all count that a surface through the pixel can reach, then those within the noise of the plane fitted to them.
    pub(crate) fn slopes(&self, lines: [&[f32]; SIDE], u: usize) -> Option<[f32; 2]> {
        let window = lines.map(|line| &line[u + HALO - SIDE / 2..][..SIDE]);
        let own = window[SIDE / 2][SIDE / 2];
        let granted = GRANTED * self.noise.sigma_inverse(own);
        let steepest = self.steepest.map(|slope| slope * own);
        let first = fit(window, |w, x, y| (w - own).abs() <= granted + steepest[0] * x.abs() + steepest[1] * y.abs())?;
        let fine = fit(window, |w, x, y| (w - own - first.slope[0] * x - first.slope[1] * y).abs() <= granted)?;
        ((fine.middle - own).abs() <= granted).then_some(fine.slope)
    }
}

struct Fit {
    middle: f32,
    slope: [f32; 2],
}

/// Least squares over the pixels that are taken.
fn fit(window: [&[f32]; SIDE], take: impl Fn(f32, f32, f32) -> bool) -> Option<Fit> {
    let own = window[SIDE / 2][SIDE / 2];
    let (mut n, mut sx, mut sy, mut sw) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32);
    let (mut sxx, mut sxy, mut syy, mut sxw, mut syw) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32);
    for (row, line) in window.iter().enumerate() {
        for (column, &value) in line.iter().enumerate() {
            let (x, y) = (column as f32 - (SIDE / 2) as f32, row as f32 - (SIDE / 2) as f32);
            // A NaN is not taken.
            if take(value, x, y) {
                let w = value - own;
                (n, sx, sy, sw) = (n + 1.0, sx + x, sy + y, sw + w);
                (sxx, sxy, syy) = (sxx + x * x, sxy + x * y, syy + y * y);
                (sxw, syw) = (sxw + x * w, syw + y * w);
            }
        }
    }
    if n < LEAST_PIXELS {
        return None;
    }
    let (mx, my) = (sx / n, sy / n);
    let (a, b, d) = (sxx - sx * mx + RIDGE, sxy - sx * my, syy - sy * my + RIDGE);
    let (p, q) = (sxw - sw * mx, syw - sw * my);
    let determinant = a * d - b * b;
    let slope = [(d * p - b * q) / determinant, (a * q - b * p) / determinant];
    Some(Fit { middle: own + sw / n - slope[0] * mx - slope[1] * my, slope })
}
