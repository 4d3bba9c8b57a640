//! The texels that paint lands on.

use nalgebra::{Point3, UnitVector3};

use crate::error::{Error, check_range};

/// A piece of the painted surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texel {
    /// Its centre in the world frame, m.
    pub point: Point3<f64>,
    /// Unit normal of the painted side.
    pub normal: UnitVector3<f64>,
    /// Area of real surface that it stands for, m^2.
    pub area: f64,
}

/// Unit vectors can be built unchecked, and a wrong length would silently scale the paint.
pub(super) fn check_unit(what: &'static str, vector: &UnitVector3<f64>) -> Result<(), Error> {
    check_range(what, vector.norm(), 1.0 - 1e-6, 1.0 + 1e-6, "1 within 1e-6")
}
