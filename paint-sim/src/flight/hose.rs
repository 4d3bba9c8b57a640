//! The force of the hose that hangs between its base and the vehicle: a catenary.

use nalgebra::{Point3, Vector3};

use super::airframe::GRAVITY;
use crate::error::{Error, check_positive};

/// A hose filled with paint, or a power cable.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct HoseModel {
    /// Where it leaves its base, world frame, m.
    pub base: Point3<f64>,
    /// Its length, m.
    pub length: f64,
    /// Its mass per length with its content, kg/m.
    pub line_density: f64,
    /// Whether the base stands on a floor on which a slack hose can lie.
    pub base_on_floor: bool,
}

/// The forces at the two ends of a hanging hose, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Catenary {
    /// The parameter `a` of `z = a cosh(x/a)`, m; zero where the ends are above one another.
    pub parameter: f64,
    /// Horizontal tension, the same everywhere.
    pub horizontal: f64,
    /// Downward pull on the upper end.
    pub vertical_top: f64,
    /// Upward pull on the base; negative where the hose sags below its base.
    pub vertical_bottom: f64,
}

impl HoseModel {
    /// Solves `sqrt(L^2 - h^2) = 2 a sinh(l / 2a)` for a vehicle `horizontal` metres beside and `height` above the base.
    ///
    /// # Errors
    /// A hose that is shorter than the distance, or numbers out of range.
    pub fn catenary(&self, horizontal: f64, height: f64) -> Result<Catenary, Error> {
        self.check()?;
        let distance = horizontal.hypot(height);
        if !(distance < self.length && horizontal >= 0.0) {
            return Err(Error::HoseTooShort { length: self.length, distance });
        }
        let weight = self.line_density * GRAVITY;
        let (length, h) = (self.length, height);
        if horizontal < 1e-6 * length {
            let [vertical_top, vertical_bottom] = [0.5 * weight * (length + h), 0.5 * weight * (h - length)];
            return Ok(Catenary { parameter: 0.0, horizontal: 0.0, vertical_top, vertical_bottom });
        }
        // With y = l/(2a): sinh(y)/y = c, c > 1.
        let c = ((length - h) * (length + h)).sqrt() / horizontal;
        if c <= 1.0 + 1e-12 {
            return Err(Error::HoseTooShort { length, distance });
        }
        let a = horizontal / (2.0 * inverse_sinhc(c));
        let middle = a * (h / length).atanh();
        let pull = |x: f64| weight * a * (x / a).sinh();
        Ok(Catenary {
            parameter: a,
            horizontal: weight * a,
            vertical_top: pull(middle + 0.5 * horizontal),
            vertical_bottom: pull(middle - 0.5 * horizontal),
        })
    }

    /// Force on a vehicle at `position`, world frame, N.
    ///
    /// Where the hose would sag below a base that stands on a floor, it lies down instead: then the vehicle carries only
    /// the hanging part, `lambda g h`, straight down (friction on the floor is not modelled).
    ///
    /// # Errors
    /// As [`HoseModel::catenary`].
    pub fn force(&self, position: &Point3<f64>) -> Result<Vector3<f64>, Error> {
        let span = position - self.base;
        let horizontal = span.x.hypot(span.y);
        let ends = self.catenary(horizontal, span.z)?;
        if self.base_on_floor && ends.vertical_bottom < 0.0 {
            return Ok(Vector3::new(0.0, 0.0, -self.line_density * GRAVITY * span.z.max(0.0)));
        }
        let towards_base = if horizontal > 0.0 { -ends.horizontal / horizontal } else { 0.0 };
        Ok(Vector3::new(span.x * towards_base, span.y * towards_base, -ends.vertical_top))
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_positive("hose.length", self.length)?;
        check_positive("hose.line_density", self.line_density)?;
        if self.base.iter().all(|v| v.is_finite()) {
            Ok(())
        } else {
            Err(Error::NotFinite { what: "hose.base", index: 0 })
        }
    }
}

/// The positive `y` with `sinh(y)/y = c` for `c > 1`, by Newton's method.
fn inverse_sinhc(c: f64) -> f64 {
    // From above the root of a convex function Newton's method falls monotonically: the cubic's root bounds small c,
    // the logarithm large ones.
    let mut y = (6.0 * (c - 1.0)).sqrt().min(2.0 * (2.0 * c).ln() + 1.0);
    for _ in 0..60 {
        let step = (y.sinh() - c * y) / (y.cosh() - c);
        y -= step;
        if step.abs() <= 1e-15 * y {
            break;
        }
    }
    y
}
