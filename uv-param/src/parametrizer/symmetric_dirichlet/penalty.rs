//! What makes a minimiser care for the worst faces.

/// The density `phi(W) = W + 4 b e^p / p` with `e = (W / 4 - 1) / b`: the symmetric Dirichlet energy W where a face is nearer to
/// an isometry than the bound b, and rising with the power p of its distance beyond. The more, the evener the distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Penalty {
    /// `W / 4 - 1` from which the power rules; infinite for W alone.
    pub(crate) bound: f64,
    /// The power, above 2.
    pub(crate) power: i32,
}

impl Penalty {
    /// W alone.
    pub(crate) const NONE: Self = Self { bound: f64::INFINITY, power: 3 };

    /// For faces that are not to be stretched by more than `stretch` in one direction.
    pub(crate) fn beyond(stretch: f64, power: i32) -> Self {
        let square = stretch * stretch;
        Self { bound: (square + 1.0 / square + 2.0) / 4.0 - 1.0, power }
    }

    /// `phi`, `phi'` and `phi''` at W.
    pub(super) fn derivatives(&self, w: f64) -> [f64; 3] {
        if self.bound.is_infinite() || w.is_infinite() {
            return [w, 1.0, 0.0];
        }
        let e = ((w / 4.0 - 1.0) / self.bound).max(0.0);
        let low = e.powi(self.power - 2);
        [
            w + 4.0 * self.bound * low * e * e / f64::from(self.power),
            1.0 + low * e,
            f64::from(self.power - 1) * low / (4.0 * self.bound),
        ]
    }
}
