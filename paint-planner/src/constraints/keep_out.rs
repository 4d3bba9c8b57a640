//! Volumes that the vehicle must not enter: a crane, a balcony with people, a neighbour's ground.

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::error::{Error, ensure};
use crate::world::{Hit, Surface};

/// A solid that no part of the vehicle may enter. World frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum KeepOutVolume {
    /// A box along the axes of the world.
    Box {
        /// Least coordinates.
        min: Point3<f64>,
        /// Greatest coordinates.
        max: Point3<f64>,
    },
    /// A ball.
    Sphere {
        /// Its middle.
        centre: Point3<f64>,
        /// Its radius.
        radius: f64,
    },
    /// Everything on one side of a plane.
    HalfSpace {
        /// A point of the plane.
        point: Point3<f64>,
        /// Points out of the volume, to where the vehicle may be; of any length.
        normal: Vector3<f64>,
    },
}

impl KeepOutVolume {
    /// Distance from a point to the solid, m; 0 inside.
    ///
    /// ```
    /// # use paint_planner::{constraints::KeepOutVolume, nalgebra::{Point3, Vector3}};
    /// let ground = KeepOutVolume::HalfSpace { point: Point3::origin(), normal: Vector3::z() * 2.0 };
    /// assert_eq!(ground.distance(&Point3::new(4.0, 0.0, 3.0)), 3.0);
    /// assert_eq!(ground.distance(&Point3::new(4.0, 0.0, -3.0)), 0.0);
    /// ```
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        match self {
            Self::Box { min, max } => (min - point).sup(&(point - max)).map(|beside| beside.max(0.0)).norm(),
            Self::Sphere { centre, radius } => ((point - centre).norm() - radius).max(0.0),
            Self::HalfSpace { point: border, normal } => (point - border).dot(&normal.normalize()).max(0.0),
        }
    }

    /// Refuses volumes that are none.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn check(&self) -> Result<(), Error> {
        match self {
            Self::Box { min, max } => {
                let (least, sum) = ((max - min).min(), (max - min).sum());
                ensure("keep_out.box", least, least >= 0.0 && sum.is_finite(), "finite, with no min above its max")
            }
            Self::Sphere { centre, radius } => {
                let sum = centre.coords.sum() + radius;
                ensure("keep_out.sphere", *radius, *radius > 0.0 && sum.is_finite(), "finite, its radius above 0")
            }
            Self::HalfSpace { point, normal } => {
                let (length, sum) = (normal.norm(), point.coords.sum());
                let sound = length > 1e-9 && (length + sum).is_finite();
                ensure("keep_out.half_space", length, sound, "finite, with a normal that is not zero")
            }
        }
    }
}

/// A surface with volumes about it that the vehicle keeps out of, with the same clearance as from the surface. The spray may pass
/// through them.
#[derive(Clone, Copy)]
pub struct WithKeepOut<'a> {
    /// The surface to paint.
    pub surface: &'a dyn Surface,
    /// The volumes.
    pub volumes: &'a [KeepOutVolume],
}

impl Surface for WithKeepOut<'_> {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max_distance: f64) -> Option<Hit> {
        self.surface.cast(origin, direction, max_distance)
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.volumes.iter().fold(self.surface.distance(point, max), |least, volume| least.min(volume.distance(point)))
    }

    fn facet(&self, point: &Point3<f64>) -> Option<[Point3<f64>; 3]> {
        self.surface.facet(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_solids() {
        let cube = KeepOutVolume::Box { min: Point3::new(-1.0, -1.0, 0.0), max: Point3::new(1.0, 1.0, 2.0) };
        assert_eq!(cube.distance(&Point3::new(0.2, -0.3, 1.9)), 0.0);
        assert_eq!(cube.distance(&Point3::new(4.0, 5.0, 2.0)), 5.0);
        assert!((cube.distance(&Point3::new(-2.0, 0.0, -1.0)) - 2.0_f64.sqrt()).abs() < 1e-15);
        let ball = KeepOutVolume::Sphere { centre: Point3::new(0.0, 0.0, 1.0), radius: 0.5 };
        assert_eq!(ball.distance(&Point3::new(0.0, 2.0, 1.0)), 1.5);
        assert_eq!(ball.distance(&Point3::new(0.0, 0.2, 1.0)), 0.0);
    }

    #[test]
    fn what_is_no_volume_is_refused() {
        let (low, high) = (Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, -0.1, 1.0));
        assert!(KeepOutVolume::Box { min: low, max: high }.check().is_err());
        assert!(KeepOutVolume::Sphere { centre: low, radius: 0.0 }.check().is_err());
        assert!(KeepOutVolume::Sphere { centre: Point3::new(f64::NAN, 0.0, 0.0), radius: 1.0 }.check().is_err());
        assert!(KeepOutVolume::HalfSpace { point: low, normal: Vector3::zeros() }.check().is_err());
        assert!(KeepOutVolume::HalfSpace { point: low, normal: Vector3::z() }.check().is_ok());
    }
}
