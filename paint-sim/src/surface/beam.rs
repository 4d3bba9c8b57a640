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
    /// The pyramid around rays from a point, wider by `margin` in slope; `None` where the cosine of an angle with their mean is smaller than
    /// `least_cosine`.
    pub(super) fn around(
        origin: &Point3<f64>,
        directions: impl Iterator<Item = Vector3<f64>> + Clone,
        least_cosine: f64,
        margin: f64,
    ) -> Option<Self> {
        let axis = directions.clone().sum::<Vector3<f64>>().try_normalize(0.1)?;
        // Along the rows of the picture, as its pixels come in that order: a pyramid askew to them would be wider.
        let mut ends = directions.clone();
        let (first, second) = (ends.next()?, ends.next()?);
        let row = second - first;
        let side = (row - axis * axis.dot(&row)).try_normalize(1e-12)?;
        let (low, high) = ([f64::MAX; 2], [f64::MIN; 2]);
        let mut beam = Self { origin: origin.coords, axis, across: [side, axis.cross(&side)], low, high };
        for direction in directions {
            let along = direction.dot(&axis);
            if along.is_nan() || along < least_cosine {
                return None;
            }
            let slopes = beam.slopes(&direction);
            beam.widen(slopes, margin);
        }
        Some(beam)
    }

    fn widen(&mut self, slopes: [f64; 2], margin: f64) {
        for (k, slope) in slopes.into_iter().enumerate() {
            (self.low[k], self.high[k]) = (self.low[k].min(slope - margin), self.high[k].max(slope + margin));
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

    /// How steeply a vector leaves the axis along the two directions across.
    pub(super) fn slopes(&self, vector: &Vector3<f64>) -> [f64; 2] {
        let inverse = 1.0 / self.depth(vector);
        self.across.map(|across| vector.dot(&across) * inverse)
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
