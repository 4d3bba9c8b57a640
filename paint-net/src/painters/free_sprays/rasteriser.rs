//! A differentiable rasteriser of free sprays.

use super::free_spray::FreeSpray;
use super::plane::Plane;
use crate::network::{Response, ScaledResponse};
use crate::problem::PaintProblem;

/// Columns that one inner loop handles.
pub(super) const LANES: usize = 8;
/// Where footprints end while they are being moved about, in deviations: the rest is a thousandth of the paint.
const CUT: f64 = 3.6;
/// How far a spray may move in one round under a mask, in deviations.
const MOVE_RANGE: f32 = 3.0;

/// A differentiable rasteriser of sprays: renders a set of them over a problem's canvas, in single precision and in the units of
/// `ScaledResponse`, and gives the derivative of the cost by every pixel's depth and by every spray.
pub(super) struct Rasteriser {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Values from one row to the next: blocks may reach beyond the end of a row, where all weights are zero.
    pitch: usize,
    /// Wanted ink, and the depth that is missing where a spray may lie and would be seen.
    pub(super) ink: Plane,
    pub(super) missing: Plane,
    paintable: Option<Vec<bool>>,
    wanted: Vec<f32>,
    before: Vec<f32>,
    pub(super) weight: Vec<f32>,
    response: Response,
    reach: f32,
    /// Depth that is called 1 in here.
    pub(super) unit: f64,
    canvas: Vec<f32>,
    /// `f'(c)` and `w f'(c) (f(c) - y)` after `render`.
    pub(super) slope: Vec<f32>,
    pub(super) gradient: Vec<f32>,
    profiles: Profiles,
}

/// The derivative of the cost by one spray.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SprayGradient {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) volume: f32,
    pub(super) sigma: f32,
}

impl Rasteriser {
    pub(super) fn new(problem: &PaintProblem) -> Self {
        let scaled = ScaledResponse::new(problem.saturation);
        let (width, height) = problem.reference.size();
        let pitch = width.next_multiple_of(LANES) + LANES;
        let plane = |value: &dyn Fn(usize) -> f64| -> Vec<f32> {
            let mut out = vec![0.0; pitch * height];
            for (y, row) in out.chunks_exact_mut(pitch).enumerate() {
                row[..width].iter_mut().enumerate().for_each(|(x, v)| *v = value(y * width + x) as f32);
            }
            out
        };
        let missing = |(k, &ink): (usize, &f64)| {
            let seen = problem.weight(k) > 0.0 && problem.paintable.is_none_or(|mask| mask[k]);
            let there = problem.canvas.map_or(0.0, |c| c.data()[k]);
            if seen { ((problem.saturation.inverse(ink) - there) / scaled.depth).max(0.0) as f32 } else { 0.0 }
        };
        let data = problem.reference.data();
        Self {
            width,
            height,
            pitch,
            ink: Plane { width, values: data.iter().map(|&ink| (ink / scaled.ink) as f32).collect() },
            missing: Plane { width, values: data.iter().enumerate().map(missing).collect() },
            paintable: problem.paintable.map(<[bool]>::to_vec),
            wanted: plane(&|k| (data[k] / scaled.ink).min(1.0)),
            before: plane(&|k| problem.canvas.map_or(0.0, |c| c.data()[k] / scaled.depth)),
            weight: plane(&|k| problem.weight(k)),
            reach: problem.kernel.cut().min(CUT) as f32,
            unit: scaled.depth,
            response: scaled.response,
            canvas: vec![0.0; pitch * height],
            slope: vec![0.0; pitch * height],
            gradient: vec![0.0; pitch * height],
            profiles: Profiles::default(),
        }
    }

    /// A picture without margins.
    pub(super) fn crop(&self, value: impl Fn(usize) -> f32) -> Plane {
        let at = |k: usize| k / self.width * self.pitch + k % self.width;
        Plane { width: self.width, values: (0..self.width * self.height).map(|k| value(at(k))).collect() }
    }

    /// Whether a spray may lie over pixel `k`.
    pub(super) fn allowed(&self, k: usize) -> bool {
        self.paintable.as_ref().is_none_or(|mask| mask[k])
    }

    /// Columns and rows between which a spray may move: the picture or, under a mask, a rectangle of paintable pixels about
    /// it that grows to all sides in turn.
    pub(super) fn position_bounds(&self, spray: &FreeSpray) -> ([f64; 2], [f64; 2]) {
        // A little less than the pixel, as its border rounds to the next.
        let span = |first: usize, last: usize| [first as f64 - 0.499, last as f64 + 0.499];
        if self.paintable.is_none() {
            return (span(0, self.width - 1), span(0, self.height - 1));
        }
        let at = |v: f32, n: usize| (v.round().max(0.0) as usize).min(n - 1);
        let (x, y) = (at(spray.x, self.width), at(spray.y, self.height));
        let (mut left, mut right, mut top, mut bottom) = (x, x, y, y);
        let free = |mut xs: std::ops::RangeInclusive<usize>, ys: std::ops::RangeInclusive<usize>| {
            xs.all(|x| ys.clone().all(|y| self.allowed(y * self.width + x)))
        };
        let reach = (MOVE_RANGE * spray.sigma).ceil() as usize;
        for _ in 0..reach {
            let before = (left, right, top, bottom);
            if left > 0 && free(left - 1..=left - 1, top..=bottom) {
                left -= 1;
            }
            if right + 1 < self.width && free(right + 1..=right + 1, top..=bottom) {
                right += 1;
            }
            if top > 0 && free(left..=right, top - 1..=top - 1) {
                top -= 1;
            }
            if bottom + 1 < self.height && free(left..=right, bottom + 1..=bottom + 1) {
                bottom += 1;
            }
            if before == (left, right, top, bottom) {
                break;
            }
        }
        (span(left, right), span(top, bottom))
    }

    /// Renders the sprays and returns the cost `½ Σ w (f(c) - y)²`; leaves its derivative by depth in `gradient`.
    pub(super) fn render(&mut self, sprays: &[FreeSpray]) -> f64 {
        self.canvas.copy_from_slice(&self.before);
        for spray in sprays {
            let window = self.profiles.of(spray, self.reach, self.width, self.height);
            for (block, across) in self.profiles.across.chunks_exact(LANES).enumerate() {
                let mut at = window.0 + block * LANES + window.1 * self.pitch;
                for &down in &self.profiles.down {
                    let share = spray.volume * down;
                    for (c, a) in self.canvas[at..at + LANES].iter_mut().zip(across) {
                        *c += share * a;
                    }
                    at += self.pitch;
                }
            }
        }
        self.gradient.copy_from_slice(&self.canvas);
        let mut cost = 0.0;
        for y in 0..self.height {
            let row = y * self.pitch..(y + 1) * self.pitch;
            let (ink, slope) = (&mut self.gradient[row.clone()], &mut self.slope[row.clone()]);
            self.response.apply(ink, slope);
            let mut sums = [0.0_f32; LANES];
            let blocks = ink.chunks_exact_mut(LANES).zip(slope.chunks_exact(LANES));
            let given = self.wanted[row.clone()].chunks_exact(LANES).zip(self.weight[row].chunks_exact(LANES));
            for ((a, s), (y, w)) in blocks.zip(given) {
                for k in 0..LANES {
                    let miss = a[k] - y[k];
                    sums[k] += w[k] * miss * miss;
                    a[k] = w[k] * miss * s[k];
                }
            }
            cost += f64::from(sums.iter().sum::<f32>());
        }
        0.5 * cost
    }

    /// The derivative of the cost by every spray, after `render` at the same sprays.
    pub(super) fn backward(&mut self, sprays: &[FreeSpray], gradients: &mut [SprayGradient]) {
        for (spray, out) in sprays.iter().zip(gradients) {
            let window = self.profiles.of(spray, self.reach, self.width, self.height);
            let centre = (spray.x - window.0 as f32, spray.y - window.1 as f32);
            // Σ D gx gy times 1, dx, dy, dx² + dy².
            let mut total = [0.0_f32; 4];
            for (block, across) in self.profiles.across.chunks_exact(LANES).enumerate() {
                let mut at = window.0 + block * LANES + window.1 * self.pitch;
                let (mut plain, mut first, mut second) = ([0.0_f32; LANES], [0.0_f32; LANES], [0.0_f32; LANES]);
                for (j, &down) in self.profiles.down.iter().enumerate() {
                    let dy = j as f32 - centre.1;
                    let gradient = &self.gradient[at..at + LANES];
                    for k in 0..LANES {
                        let one = down * gradient[k];
                        let two = dy * one;
                        plain[k] += one;
                        first[k] += two;
                        second[k] += dy * two;
                    }
                    at += self.pitch;
                }
                let mut sums = [[0.0_f32; LANES]; 4];
                for k in 0..LANES {
                    let dx = (block * LANES + k) as f32 - centre.0;
                    sums[0][k] = across[k] * plain[k];
                    sums[1][k] = dx * sums[0][k];
                    sums[2][k] = across[k] * first[k];
                    sums[3][k] = across[k] * second[k] + dx * sums[1][k];
                }
                for (t, s) in total.iter_mut().zip(sums) {
                    *t += s.iter().sum::<f32>();
                }
            }
            let over = spray.volume / (spray.sigma * spray.sigma);
            *out = SprayGradient {
                volume: total[0],
                x: over * total[1],
                y: over * total[2],
                sigma: over / spray.sigma * total[3],
            };
        }
    }
}

/// The profiles of one spray along its window, `across` in whole blocks.
#[derive(Default)]
struct Profiles {
    across: Vec<f32>,
    down: Vec<f32>,
}

impl Profiles {
    /// Fills in the profiles; column and row of the window's first pixel.
    fn of(&mut self, spray: &FreeSpray, reach: f32, width: usize, height: usize) -> (usize, usize) {
        let reach = reach * spray.sigma;
        let window = |centre: f32, n: usize| {
            let first = (centre - reach).ceil().max(0.0) as usize;
            let end = ((centre + reach).floor() + 1.0).max(0.0) as usize;
            (first.min(n), end.clamp(first.min(n), n))
        };
        let (x0, x1) = window(spray.x, width);
        let (y0, y1) = window(spray.y, height);
        let fall = -0.5 / (spray.sigma * spray.sigma);
        self.across.resize((x1 - x0).next_multiple_of(LANES), 0.0);
        for (k, out) in self.across.iter_mut().enumerate() {
            let d = (x0 + k) as f32 - spray.x;
            *out = exp(fall * d * d);
        }
        self.across[x1 - x0..].fill(0.0);
        self.down.resize(y1 - y0, 0.0);
        for (k, out) in self.down.iter_mut().enumerate() {
            let d = (y0 + k) as f32 - spray.y;
            *out = exp(fall * d * d);
        }
        (x0, y0)
    }
}

/// `exp` of a negative number, within 2e-6 of it: without branches, so that whole blocks are computed at once.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Adding this rounds to the nearest integer and leaves it in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let y = (x * std::f32::consts::LOG2_E).max(-80.0);
    let rounded = y + ROUND;
    let f = (y - (rounded - ROUND)) * std::f32::consts::LN_2;
    // e^f for |f| <= ln 2 / 2 by its series.
    let series = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0)))));
    series * f32::from_bits((rounded.to_bits() << 23).wrapping_add(127 << 23))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::model::SprayKernel;

    #[test]
    fn exp_is_exp() {
        for k in 0..4000 {
            let x = -0.005 * k as f32;
            assert!((exp(x) / x.exp() - 1.0).abs() < 4e-6, "exp({x})");
        }
        assert!(exp(-1e9) < 1e-20);
    }

    /// One spray over 3 x 4 pixels of ink one half: mean squared error and its derivatives, computed in double precision by
    /// another program (`paint_baselines.py check`).
    #[test]
    fn cost_and_derivatives_are_those_of_the_reference() {
        let wanted = Image::filled(4, 3, 0.5);
        let kernel = SprayKernel::new(1.0, 9.0).unwrap();
        let mut rasteriser = Rasteriser::new(&PaintProblem::new(&wanted).with_kernel(&kernel));
        let spray = [FreeSpray { x: 1.25, y: 0.5, volume: 0.8, sigma: 1.5 }];
        let cost = rasteriser.render(&spray);
        let mut slope = [SprayGradient::default()];
        rasteriser.backward(&spray, &mut slope);
        let near =
            |found: f64, expected: f64| assert!((found / 6.0 - expected).abs() < 2e-5, "{} {expected}", found / 6.0);
        near(cost, 0.0161719841564);
        near(slope[0].x.into(), -0.0133571458169);
        near(slope[0].y.into(), -0.0186052217846);
        near(slope[0].volume.into(), -0.0152426822073);
        near(slope[0].sigma.into(), -0.0433283841556);
    }
}
