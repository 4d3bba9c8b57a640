//! Random numbers of unit tests.

use nalgebra::Vector3;

use crate::sim::Rng;

/// In `[-1, 1)`.
pub(crate) fn signed(rng: &mut Rng) -> f64 {
    rng.between(-1.0, 1.0)
}

/// Three of [`signed`].
pub(crate) fn vector(rng: &mut Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| signed(rng))
}
