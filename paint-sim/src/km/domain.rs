//! Arguments moved into their domain, and a quotient without cancellation.

/// Values beyond this bound mean the same as the bound and keep every product below overflow.
pub(super) const LARGEST: f64 = 1e100;

/// `tanh(x)/x`, one at zero.
pub(crate) fn tanhc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-2.0 * x).exp_m1() / (x * (1.0 + (-2.0 * x).exp())) }
}

/// Moves the arguments into the domain.
pub(super) fn domain(k: f64, s: f64, d: f64, ground: f64) -> (f64, f64, f64, f64) {
    (bounded(k, LARGEST), bounded(s, LARGEST), bounded(d, LARGEST), bounded(ground, 1.0))
}

/// The value moved into `0..=largest`, zero for NaN.
pub(super) fn bounded(value: f64, largest: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, largest) }
}
