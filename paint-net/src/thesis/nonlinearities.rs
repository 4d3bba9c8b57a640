//! The curves between the layers.

use crate::network::Real;

pub(crate) fn sigmoid<T: Real>(x: T) -> T {
    T::of(1.0) / (T::of(1.0) + (-x).exp())
}

pub(crate) fn tanh<T: Real>(x: T) -> T {
    T::of(1.0) - T::of(2.0) / (T::of(1.0) + (x + x).exp())
}

/// `ln(1 + eˣ)`, exact in both tails.
pub(crate) fn softplus<T: Real>(x: T) -> T {
    let x = x.to_f64();
    T::of(x.max(0.0) + (-x.abs()).exp().ln_1p())
}
