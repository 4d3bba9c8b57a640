use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// The numbers the network computes with: `f32` to paint and to train, `f64` so that its derivatives can be checked against
/// central differences.
pub(crate) trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// Nearest number to `value`.
    fn of(value: f64) -> Self;
    /// The same number in double precision.
    fn wide(self) -> f64;

    /// The larger of the two; `other` if `self` is no number.
    fn at_least(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller of the two; `other` if `self` is no number.
    fn at_most(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

impl Real for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    fn of(value: f64) -> Self {
        value
    }

    fn wide(self) -> f64 {
        self
    }
}
