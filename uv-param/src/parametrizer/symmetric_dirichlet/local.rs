//! First and second derivatives of the symmetric Dirichlet energy of one triangle.

use super::penalty::Penalty;
use crate::triangle::{Frame, Jacobian, length};

/// Derivatives of `A W` of one triangle. In the bases of the singular vectors (`J = U diag(s) V^T`) the Hessian is diagonal in
/// four modes: the two stretches, the flip and the twist; only the twist can be negative.
pub(super) struct Local {
    /// Cosine and sine of U.
    turn: [f64; 2],
    /// Gradients of the hat functions in V's basis.
    hats: [[f64; 2]; 3],
    /// `A dW/ds`.
    slope: [f64; 2],
    /// `A d^2W/ds^2`.
    stretch: [f64; 2],
    /// Half the sum and half the difference of the flip and twist curvatures, times A.
    mixed: [f64; 2],
    /// `A phi''` of the penalty over the squared area in `slope`.
    rise: f64,
}

impl Local {
    pub(super) fn new(frame: &Frame, j: Jacobian, penalty: Penalty) -> Self {
        let [_, first, second] = penalty.derivatives(j.symmetric_dirichlet());
        let area = frame.area * first;
        let (sum, p) = direction(j.a + j.d, j.c - j.b);
        let (difference, r) = direction(j.a - j.d, j.c + j.b);
        let s1 = 0.5 * (p + r);
        // det / s1 keeps the digits of a small s2, which the difference would lose.
        let s2 = j.det() / s1;
        // U turns by half the sum of the two angles, V by what is left of the first.
        let [cos_u, sin_u] =
            half([sum[0] * difference[0] - sum[1] * difference[1], sum[1] * difference[0] + sum[0] * difference[1]]);
        let [cos_v, sin_v] = [sum[0] * cos_u + sum[1] * sin_u, sum[1] * cos_u - sum[0] * sin_u];
        let hats = frame.g.map(|g| [cos_v * g[0] - sin_v * g[1], sin_v * g[0] + cos_v * g[1]]);
        let cube = (s1 * s2).powi(3);
        let flip = 2.0 + 2.0 * (s1 * s1 + s1 * s2 + s2 * s2) / cube;
        let twist = (2.0 - 2.0 * (s1 * s1 - s1 * s2 + s2 * s2) / cube).max(0.0);
        Self {
            turn: [cos_u, sin_u],
            hats,
            slope: [s1, s2].map(|s| area * 2.0 * (s - 1.0 / (s * s * s))),
            stretch: [s1, s2].map(|s| area * (2.0 + 6.0 / (s * s * s * s))),
            mixed: [0.5 * area * (flip + twist), 0.5 * area * (flip - twist)],
            rise: second / (first * first * frame.area),
        }
    }

    /// Derivative by the uv of corner `k`.
    pub(super) fn gradient(&self, k: usize) -> [f64; 2] {
        let [cos, sin] = self.turn;
        let [x, y] = [self.slope[0] * self.hats[k][0], self.slope[1] * self.hats[k][1]];
        [cos * x - sin * y, sin * x + cos * y]
    }

    /// Second derivative by the uv of corner `k` (rows) and corner `l` (columns).
    pub(super) fn block(&self, k: usize, l: usize) -> [[f64; 2]; 2] {
        let (hk, hl) = (self.hats[k], self.hats[l]);
        let [even, odd] = self.mixed;
        let [gk, gl] = [hk, hl].map(|h| [self.slope[0] * h[0], self.slope[1] * h[1]]);
        let xx = self.stretch[0] * hk[0] * hl[0] + even * hk[1] * hl[1] + self.rise * gk[0] * gl[0];
        let yy = self.stretch[1] * hk[1] * hl[1] + even * hk[0] * hl[0] + self.rise * gk[1] * gl[1];
        let xy = odd * hk[1] * hl[0] + self.rise * gk[0] * gl[1];
        let yx = odd * hk[0] * hl[1] + self.rise * gk[1] * gl[0];
        // U K U^T.
        let [c, s] = self.turn;
        let [left_x, left_y] = [[c * xx - s * yx, c * xy - s * yy], [s * xx + c * yx, s * xy + c * yy]];
        let back = |row: [f64; 2]| [row[0] * c - row[1] * s, row[0] * s + row[1] * c];
        [back(left_x), back(left_y)]
    }
}

/// Cosine and sine of the direction of a vector, and its length; the x axis for none.
fn direction(x: f64, y: f64) -> ([f64; 2], f64) {
    let length = length(x, y);
    if length > 0.0 { ([x / length, y / length], length) } else { ([1.0, 0.0], 0.0) }
}

/// Cosine and sine of half an angle.
fn half([cos, sin]: [f64; 2]) -> [f64; 2] {
    if cos >= 0.0 {
        let half_cos = (0.5 * (1.0 + cos)).sqrt();
        [half_cos, 0.5 * sin / half_cos]
    } else {
        let half_sin = (0.5 * (1.0 - cos)).sqrt();
        [0.5 * sin / half_sin, half_sin]
    }
}

#[cfg(test)]
mod tests {
    use super::{Local, Penalty};
    use crate::triangle::Frame;

    const STEEP: Penalty = Penalty { bound: 0.3, power: 3 };

    const CORNERS: [[f64; 3]; 3] = [[0.1, 0.2, 0.0], [1.3, 0.1, 0.4], [0.4, 0.9, -0.2]];

    fn energy(frame: &Frame, uv: [[f64; 2]; 3]) -> f64 {
        frame.area * STEEP.derivatives(frame.jacobian(uv).symmetric_dirichlet())[0]
    }

    fn moved(mut uv: [[f64; 2]; 3], corner: usize, axis: usize, by: f64) -> [[f64; 2]; 3] {
        uv[corner][axis] += by;
        uv
    }

    #[test]
    fn the_gradient_is_the_difference_quotient() {
        let frame = Frame::new(CORNERS);
        for uv in [[[0.0, 0.0], [1.9, 0.3], [0.2, 1.1]], [[0.0, 0.0], [0.4, -0.2], [0.3, 0.5]]] {
            let local = Local::new(&frame, frame.jacobian(uv), STEEP);
            for k in 0..3 {
                for axis in 0..2 {
                    let h = 1e-6;
                    let slope = energy(&frame, moved(uv, k, axis, h)) - energy(&frame, moved(uv, k, axis, -h));
                    let expected = slope / (2.0 * h);
                    assert!((local.gradient(k)[axis] - expected).abs() < 1e-6 * (1.0 + expected.abs()));
                }
            }
        }
    }

    #[test]
    fn the_hessian_is_the_second_difference_where_nothing_is_clamped() {
        // Enlarged by about 2: the twist curvature is positive.
        let frame = Frame::new(CORNERS);
        let uv = [[0.0, 0.0], [2.6, 0.4], [0.3, 2.2]];
        let local = Local::new(&frame, frame.jacobian(uv), STEEP);
        let h = 1e-4;
        for (k, l) in [(0, 0), (1, 1), (2, 2), (1, 0), (2, 1), (0, 2), (0, 1)] {
            for i in 0..2 {
                for j in 0..2 {
                    let at = |a: f64, b: f64| energy(&frame, moved(moved(uv, k, i, a), l, j, b));
                    let expected = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h * h);
                    assert!((local.block(k, l)[i][j] - expected).abs() < 1e-5 * (1.0 + expected.abs()));
                }
            }
        }
    }

    #[test]
    fn the_projected_hessian_never_points_down() {
        let frame = Frame::new(CORNERS);
        // Shrunk: the twist curvature is negative before the projection.
        let uv = [[0.0, 0.0], [0.3, 0.05], [0.1, 0.2]];
        let local = Local::new(&frame, frame.jacobian(uv), STEEP);
        for n in 0..64 {
            let d: Vec<f64> = (0..6).map(|i| if n >> i & 1 == 1 { 1.0 } else { -0.7 }).collect();
            let mut along = 0.0;
            for (k, l) in (0..9).map(|i| (i / 3, i % 3)) {
                let block = local.block(k, l);
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    along += d[2 * k + i] * block[i][j] * d[2 * l + j];
                }
            }
            assert!(along > -1e-9);
        }
    }
}
