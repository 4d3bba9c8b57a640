//! Polynomials on [0, 1] by their Bernstein coefficients, and certified bounds of their maxima.

/// Most coefficients in use: the squared speed of a degree-7 curve has degree 12.
const MAX: usize = 13;

/// A polynomial of degree `len - 1` on [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bernstein {
    coefficients: [f64; MAX],
    len: usize,
}

impl Bernstein {
    /// From at most 13 coefficients.
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
        let degree = (self.len - 1) as f64;
        let mut own = [0.0; MAX];
        for (k, pair) in self.all().windows(2).enumerate() {
            own[k] = degree * (pair[1] - pair[0]);
        }
        Self { coefficients: own, len: self.len - 1 }
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

    /// The sum of the squares of polynomials of one degree (at most 6).
    pub(crate) fn sum_of_squares(parts: &[Self]) -> Self {
        let degree = parts[0].len - 1;
        let mut own = [0.0; MAX];
        for part in parts {
            for (i, a) in part.all().iter().enumerate() {
                for (j, b) in part.all().iter().enumerate() {
                    own[i + j] += a * b * binomial(degree, i) * binomial(degree, j);
                }
            }
        }
        for (k, value) in own.iter_mut().enumerate().take(2 * degree + 1) {
            *value /= binomial(2 * degree, k);
        }
        Self { coefficients: own, len: 2 * degree + 1 }
    }

    /// A bound of the maximum of a polynomial that is nowhere negative: never below it, above it by at most the given
    /// fraction, and never below `floor`.
    ///
    /// The largest coefficient bounds a piece, so pieces whose coefficients stay below a value already attained cannot
    /// hold the maximum and are not divided further.
    pub(crate) fn maximum(&self, floor: f64, fraction: f64) -> f64 {
        let ends = |p: &Self| p.coefficients[0].max(p.coefficients[p.len - 1]);
        let mut attained = floor.max(ends(self));
        let mut bound = attained;
        // Depth 40 is beyond the resolution of f64 on [0, 1].
        let mut open = vec![(*self, 0_u32)];
        while let Some((piece, depth)) = open.pop() {
            let top = piece.all().iter().fold(f64::NEG_INFINITY, |most, c| most.max(*c));
            if top <= attained * (1.0 + fraction) || depth == 40 {
                bound = bound.max(top);
                continue;
            }
            let (left, right) = piece.halves();
            attained = attained.max(ends(&left));
            open.push((left, depth + 1));
            open.push((right, depth + 1));
        }
        bound.max(attained)
    }

    /// De Casteljau's split at 1/2.
    fn halves(&self) -> (Self, Self) {
        let (mut left, mut right) = (*self, *self);
        for round in 0..self.len {
            left.coefficients[round] = right.coefficients[0];
            for k in 0..self.len - 1 - round {
                right.coefficients[k] = 0.5 * (right.coefficients[k] + right.coefficients[k + 1]);
            }
        }
        (left, right)
    }
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |value, i| value * (n - i) as f64 / (i + 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maxima_of_known_polynomials() {
        // s (1 - s): coefficients 0, 1/2, 0; maximum 1/4.
        let bump = Bernstein::new(&[0.0, 0.5, 0.0]);
        let top = bump.maximum(0.0, 1e-12);
        assert!((0.25..0.25 + 1e-11).contains(&top));
        assert_eq!(bump.maximum(0.7, 1e-12), 0.7);
        // (s (1 - s))^2 has its maximum 1/16 there too.
        let square = Bernstein::sum_of_squares(&[bump]);
        assert!((square.maximum(0.0, 1e-12) - 0.0625).abs() < 1e-11);
        assert!((square.value(0.3) - 0.0441).abs() < 1e-15);
        assert!((bump.derivative().value(0.25) - 0.5).abs() < 1e-15);
    }
}
