//! Rays that leave one point in nearly one direction.

use nalgebra::{Point3, Vector3};

use super::hull::Hull;
use super::projection::Projection;

/// A pyramid around rays.
#[derive(Clone, Copy)]
pub(super) struct Beam {
    origin: Vector3<f64>,
    /// Unit vectors: its axis, and two across.
    axis: Vector3<f64>,
    across: [Vector3<f64>; 2],
    /// Least and largest slopes along `across`.
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
}

impl Beam {
    /// The pyramid around rays from a point, wider by `margin` in slope, and the rays' slopes; `None` where the cosine of an angle with their mean
    /// is smaller than `least_cosine`.
    pub(super) fn around(
        origin: &Point3<f64>,
        directions: impl ExactSizeIterator<Item = Vector3<f64>> + Clone,
        least_cosine: f64,
        margin: f64,
    ) -> Option<(Self, Vec<[f64; 2]>)> {
        let axis = directions.clone().sum::<Vector3<f64>>().try_normalize(0.1)?;
        // Along the rows of the picture, as its pixels come in that order: a pyramid askew to them would be wider.
        let mut ends = directions.clone();
        let (first, second) = (ends.next()?, ends.next()?);
        let row = second - first;
        let side = (row - axis * axis.dot(&row)).try_normalize(1e-12)?;
        let (low, high) = ([f64::MAX; 2], [f64::MIN; 2]);
        let mut all = Vec::with_capacity(directions.len());
        let mut beam = Self { origin: origin.coords, axis, across: [side, axis.cross(&side)], low, high };
        for direction in directions {
            let along = direction.dot(&axis);
            if along.is_nan() || along < least_cosine {
                return None;
            }
            let inverse = 1.0 / along;
            let slopes = beam.across.map(|across| direction.dot(&across) * inverse);
            beam.widen(slopes, margin);
            all.push(slopes);
        }
        Some((beam, all))
    }

    fn widen(&mut self, slopes: [f64; 2], margin: f64) {
        for (k, slope) in slopes.into_iter().enumerate() {
            let (below, above) = (slope - margin, slope + margin);
            // Without the care for what is not a number.
            self.low[k] = if below < self.low[k] { below } else { self.low[k] };
            self.high[k] = if above > self.high[k] { above } else { self.high[k] };
        }
    }

    /// The part of it around these slopes.
    pub(super) fn around_slopes(&self, slopes: impl Iterator<Item = [f64; 2]>, margin: f64) -> Self {
        let mut part = Self { low: [f64::MAX; 2], high: [f64::MIN; 2], ..*self };
        slopes.for_each(|slopes| part.widen(slopes, margin));
        part
    }

    /// How far a vector reaches along the axis.
    pub(super) fn depth(&self, vector: &Vector3<f64>) -> f64 {
        vector.dot(&self.axis)
    }

    /// Its four sides, and the plane through the origin that it lies before.
    pub(super) fn hull(&self) -> Hull {
        let (Self { origin, axis, low, high, .. }, [side, up]) = (*self, self.across);
        let planes = [side - axis * low[0], axis * high[0] - side, up - axis * low[1], axis * high[1] - up, axis];
        Hull { origin, planes: planes.map(|plane| (plane, 0.0)) }
    }

    /// The beam as a picture of so many cells a side.
    pub(super) fn projection(&self, side: usize) -> Projection {
        let [left, up] = self.across;
        Projection::perspective(self.origin, [left, up, self.axis], [self.low, self.high], side)
    }
}
