//! Four numbers side by side: the compiler makes instructions on several at once of them.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Numbers side by side.
pub(super) const LANES: usize = 4;

/// One number for each of four rows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Lanes(pub(super) [f64; LANES]);

impl Lanes {
    pub(super) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    pub(super) fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        Self(std::array::from_fn(value))
    }

    /// The greater of each pair. Compiles to one instruction, which `f64::max` does not.
    #[inline]
    pub(super) fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline]
    pub(super) fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }

    #[inline]
    pub(super) fn sum(self) -> f64 {
        (self.0[0] + self.0[1]) + (self.0[2] + self.0[3])
    }

    #[inline]
    pub(super) fn largest(self) -> f64 {
        self.0.into_iter().fold(f64::NEG_INFINITY, f64::max)
    }

    #[inline]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|k| f(self.0[k], other.0[k])))
    }
}

macro_rules! each {
    ($operator:ident, $method:ident) => {
        impl $operator for Lanes {
            type Output = Self;

            #[inline]
            fn $method(self, other: Self) -> Self {
                self.zip(other, f64::$method)
            }
        }

        impl $operator<f64> for Lanes {
            type Output = Self;

            #[inline]
            fn $method(self, other: f64) -> Self {
                self.zip(Self::splat(other), f64::$method)
            }
        }

        impl $operator<Lanes> for f64 {
            type Output = Lanes;

            #[inline]
            fn $method(self, other: Lanes) -> Lanes {
                Lanes::splat(self).zip(other, f64::$method)
            }
        }
    };
}

each!(Add, add);
each!(Sub, sub);
each!(Mul, mul);
each!(Div, div);

impl AddAssign for Lanes {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Lanes {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self(self.0.map(f64::neg))
    }
}
