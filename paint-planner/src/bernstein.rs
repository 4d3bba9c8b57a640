//! Polynomials on [0, 1] by their Bernstein coefficients, and certified bounds of their maxima.

/// Most coefficients in use: the squared acceleration of a degree-7 curve under a quadratic time law has degree 14.
const MAX: usize = 15;
/// `BINOMIAL[n][k]`.
const BINOMIAL: [[f64; MAX]; MAX] = {
    let mut rows = [[0.0; MAX]; MAX];
    let mut n = 0;
    while n < MAX {
        rows[n][0] = 1.0;
        let mut k = 1;
        while k <= n {
            rows[n][k] = rows[n - 1][k - 1] + rows[n - 1][k];
            k += 1;
        }
        n += 1;
    }
    rows
};

/// A polynomial of degree `len - 1` on [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bernstein {
    coefficients: [f64; MAX],
    len: usize,
}

impl Bernstein {
    /// From at most 15 coefficients.
    pub(crate) fn new(coefficients: &[f64]) -> Self {
        let mut own = [0.0; MAX];
        own[..coefficients.len()].copy_from_slice(coefficients);
        Self { coefficients: own, len: coefficients.len() }
    }

    fn all(&self) -> &[f64] {
        &self.coefficients[..self.len]
    }

    /// Derivative on [0, 1].
    pub(crate) fn derivative(&self) -> Self {
        let degree = self.degree() as f64;
        let mut own = [0.0; MAX];
        for (k, pair) in self.all().windows(2).enumerate() {
            own[k] = degree * (pair[1] - pair[0]);
        }
        Self { coefficients: own, len: self.degree().max(1) }
    }

    pub(crate) fn degree(&self) -> usize {
        self.len - 1
    }

    /// Its `N` coefficients, of degree `N - 1`, which is not below its own.
    pub(crate) fn coefficients_of_degree<const N: usize>(&self) -> [f64; N] {
        let all = if self.len < N { self.elevated(N - 1) } else { *self };
        std::array::from_fn(|k| all.coefficients[k])
    }

    /// Value at `s`.
    pub(crate) fn value(&self, s: f64) -> f64 {
        let mut own = self.coefficients;
        for last in (1..self.len).rev() {
            for k in 0..last {
                own[k] += s * (own[k + 1] - own[k]);
            }
        }
        own[0]
    }

    /// The product of two polynomials whose degrees add up to at most 14.
    pub(crate) fn product(&self, other: &Self) -> Self {
        let (m, n) = (self.len - 1, other.len - 1);
        let len = m + n + 1;
        let mut own = [0.0; MAX];
        for (i, (a, of_a)) in self.all().iter().zip(&BINOMIAL[m]).enumerate() {
            for ((value, b), of_b) in own[i..].iter_mut().zip(other.all()).zip(&BINOMIAL[n]) {
                *value += a * b * of_a * of_b;
            }
        }
        own[..len].iter_mut().zip(&BINOMIAL[m + n]).for_each(|(value, of_both)| *value /= of_both);
        Self { coefficients: own, len }
    }

    /// `self - other`, of one degree.
    pub(crate) fn minus(&self, other: &Self) -> Self {
        let coefficients = std::array::from_fn(|k| self.coefficients[k] - other.coefficients[k]);
        Self { coefficients, len: self.len }
    }

    /// The sum of the squares of polynomials of one degree (at most 7).
    pub(crate) fn sum_of_squares(parts: &[Self]) -> Self {
        let mut sum = Self { coefficients: [0.0; MAX], len: 2 * parts[0].len - 1 };
        for part in parts {
            let square = part.product(part);
            sum.coefficients.iter_mut().zip(&square.coefficients).for_each(|(sum, own)| *sum += own);
        }
        sum
    }

    /// The polynomial on a part of [0, 1], as one on [0, 1].
    pub(crate) fn part(&self, from: f64, to: f64) -> Self {
        let (_, rest) = self.split(from);
        if to < 1.0 { rest.split((to - from) / (1.0 - from)).0 } else { rest }
    }

    /// The same polynomial with the coefficients of a higher degree.
    pub(crate) fn elevated(&self, degree: usize) -> Self {
        self.product(&Self { coefficients: [1.0; MAX], len: degree - self.degree() + 1 })
    }

    /// A bound of the maximum of `self / denominator`, both of one degree, `self` nowhere negative and the coefficients of the denominator
    /// positive: never below it, above it by at most the given fraction, and never below `floor`.
    ///
    /// If no coefficient is more than `c` times that of the denominator, no value is. Pieces whose bound stays below a value already
    /// attained cannot hold the maximum and are not divided further.
    pub(crate) fn greatest_ratio(&self, denominator: &Self, floor: f64, fraction: f64) -> f64 {
        let ratio = |p: &Self, d: &Self, k: usize| p.coefficients[k] / d.coefficients[k];
        let at_ends = |p: &Self, d: &Self| ratio(p, d, 0).max(ratio(p, d, p.degree()));
        let most = |p: &Self, d: &Self| (0..p.len).fold(f64::NEG_INFINITY, |most, k| most.max(ratio(p, d, k)));
        let mut attained = floor.max(at_ends(self, denominator));
        let mut bound = attained;
        // As a rule at once.
        let top = most(self, denominator);
        if top <= attained * (1.0 + fraction) {
            return bound.max(top);
        }
        // Depth 40 is beyond the resolution of f64 on [0, 1].
        let mut open = vec![(*self, *denominator, 0_u32)];
        while let Some((piece, below, depth)) = open.pop() {
            let top = most(&piece, &below);
            if top <= attained * (1.0 + fraction) || depth == 40 {
                bound = bound.max(top);
                continue;
            }
            let ((left, right), (left_below, right_below)) = (piece.split(0.5), below.split(0.5));
            attained = attained.max(at_ends(&left, &left_below));
            open.push((left, left_below, depth + 1));
            open.push((right, right_below, depth + 1));
        }
        bound.max(attained)
    }

    /// De Casteljau's split at `at`: both parts as polynomials on [0, 1].
    fn split(&self, at: f64) -> (Self, Self) {
        let (mut left, mut right) = (*self, *self);
        for round in 0..self.len {
            left.coefficients[round] = right.coefficients[0];
            for k in 0..self.len - 1 - round {
                right.coefficients[k] += at * (right.coefficients[k + 1] - right.coefficients[k]);
            }
        }
        (left, right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maxima_of_known_polynomials() {
        // s (1 - s): coefficients 0, 1/2, 0; maximum 1/4.
        let bump = Bernstein::new(&[0.0, 0.5, 0.0]);
        let one = Bernstein::new(&[1.0; 3]);
        let top = bump.greatest_ratio(&one, 0.0, 1e-12);
        assert!((0.25..0.25 + 1e-11).contains(&top));
        assert_eq!(bump.greatest_ratio(&one, 0.7, 1e-12), 0.7);
        // (s (1 - s))^2 has its maximum 1/16 there too.
        let square = Bernstein::sum_of_squares(&[bump]);
        assert!((square.greatest_ratio(&one.elevated(4), 0.0, 1e-12) - 0.0625).abs() < 1e-11);
        assert!((square.value(0.3) - 0.0441).abs() < 1e-15);
        assert!((bump.derivative().value(0.25) - 0.5).abs() < 1e-15);
        // s (1 - s) / (1 + s)^2 has its maximum 1/8 at 1/3.
        let shifted = Bernstein::new(&[1.0, 2.0]);
        assert!((bump.greatest_ratio(&shifted.product(&shifted), 0.0, 1e-12) - 0.125).abs() < 1e-11);
    }

    #[test]
    fn parts_and_products_are_those_of_the_values() {
        let (p, q) = (Bernstein::new(&[0.3, -1.0, 2.0, 0.5]), Bernstein::new(&[1.0, 0.2, -0.4]));
        for s in [0.0, 0.3, 0.8, 1.0] {
            assert!((p.product(&q).value(s) - p.value(s) * q.value(s)).abs() < 1e-14);
            assert!((p.part(0.2, 0.7).value(s) - p.value(0.2 + 0.5 * s)).abs() < 1e-14);
            assert!((p.part(0.4, 1.0).value(s) - p.value(0.4 + 0.6 * s)).abs() < 1e-14);
        }
    }
}
