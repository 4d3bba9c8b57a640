//! How two charts have to lie for a seam between them to close.

use crate::atlas::charts::Charts;

/// How the right side of a seam has to be moved to meet the left one: turned (cosine, sine), then shifted.
#[derive(Debug, Clone, Copy)]
pub(in crate::atlas) struct RigidMotion {
    turn: [f64; 2],
    shift: [f64; 2],
    /// Root mean square of what is left, metres.
    pub(in crate::atlas) residual: f64,
}

impl RigidMotion {
    pub(in crate::atlas) fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turn;
        [c * x - s * y + self.shift[0], s * x + c * y + self.shift[1]]
    }

    /// From the left side to the right one.
    pub(in crate::atlas) fn undo(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turn;
        let [x, y] = [x - self.shift[0], y - self.shift[1]];
        [c * x + s * y, c * y - s * x]
    }
}

/// The rigid motion that brings the right side of a seam nearest to the left one (least squares); none within one chart,
/// whose sides cannot move on their own.
pub(in crate::atlas) fn seam_alignment(charts: &Charts, half_edges: &[u32], same: bool) -> RigidMotion {
    let surface = charts.surface;
    let next = |h: usize| h / 3 * 3 + (h + 1) % 3;
    let mut pairs = Vec::with_capacity(2 * half_edges.len());
    for &h in half_edges {
        let h = h as usize;
        let Some(twin) = surface.twin(h) else { continue };
        let weight = surface.edge(h).norm();
        for (left, right) in [(h, next(twin)), (next(h), twin)] {
            pairs.push((weight, charts.corner_uv[left], charts.corner_uv[right]));
        }
    }
    procrustes(&pairs, same)
}

/// The rigid motion that brings the second points nearest to the first ones, by their weights; none if they are `same`.
pub(in crate::atlas) fn procrustes(pairs: &[(f64, [f64; 2], [f64; 2])], same: bool) -> RigidMotion {
    let mut sums = [0.0; 5];
    for &(w, p, q) in pairs {
        for (sum, value) in sums.iter_mut().zip([w, w * p[0], w * p[1], w * q[0], w * q[1]]) {
            *sum += value;
        }
    }
    let [weight, px, py, qx, qy] = sums;
    let (p0, q0) = ([px / weight, py / weight], [qx / weight, qy / weight]);
    let (mut cos, mut sin) = (0.0, 0.0);
    for &(w, p, q) in pairs {
        let (a, b) = ([p[0] - p0[0], p[1] - p0[1]], [q[0] - q0[0], q[1] - q0[1]]);
        cos += w * (a[0] * b[0] + a[1] * b[1]);
        sin += w * (a[1] * b[0] - a[0] * b[1]);
    }
    let length = f64::hypot(cos, sin);
    let turn = if length > 0.0 && !same { [cos / length, sin / length] } else { [1.0, 0.0] };
    let shift = if same {
        [0.0; 2]
    } else {
        [p0[0] - turn[0] * q0[0] + turn[1] * q0[1], p0[1] - turn[1] * q0[0] - turn[0] * q0[1]]
    };
    let mut motion = RigidMotion { turn, shift, residual: 0.0 };
    let left_over = pairs.iter().map(|&(w, p, q)| {
        let at = motion.apply(q);
        w * ((p[0] - at[0]).powi(2) + (p[1] - at[1]).powi(2))
    });
    motion.residual = (left_over.sum::<f64>() / weight).sqrt();
    motion
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_motion_is_found_and_undone() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let moved = |[x, y]: [f64; 2]| [cos * x - sin * y + 3.0, sin * x + cos * y - 2.0];
        let right = [[0.0, 0.0], [2.0, 0.5], [-1.0, 1.0]];
        let pairs = [1.0, 4.0, 0.5].iter().zip(right).map(|(&weight, p)| (weight, moved(p), p)).collect::<Vec<_>>();
        let motion = procrustes(&pairs, false);
        let near = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]) < 1e-12;
        for p in [[0.3, -0.8], [5.0, 1.0]] {
            assert!(near(motion.apply(p), moved(p)) && near(motion.undo(moved(p)), p));
        }
        assert!(motion.residual < 1e-12);
    }
}
