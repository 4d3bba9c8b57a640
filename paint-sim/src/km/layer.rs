//! Layers stacked on one another, and the interface with the air.

use super::domain::{domain, tanhc};
use crate::error::{Error, check_not_negative, check_range};

/// What one layer does to diffuse light by itself, seen from above (1) and from below (2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// Reflectance from above, R12.
    pub reflectance: f64,
    /// Transmittance, the same in both directions.
    pub transmittance: f64,
    /// Reflectance from below, R21; equal to `reflectance` for a single film.
    pub reflectance_below: f64,
}

impl Layer {
    /// A film with absorption and scattering per unit of thickness: `R = S t/(1 + A t)`, `T = sech(g d)/(1 + A t)`.
    ///
    /// # Errors
    /// Arguments that are negative or not finite.
    pub fn new(absorption: f64, scattering: f64, thickness: f64) -> Result<Self, Error> {
        check_not_negative("absorption", absorption)?;
        check_not_negative("scattering", scattering)?;
        check_not_negative("thickness", thickness)?;
        let (k, s, d, _) = domain(absorption, scattering, thickness, 0.0);
        let x = k.sqrt() * (k + 2.0 * s).sqrt() * d;
        let t = d * tanhc(x);
        let down = 1.0 + (k + s) * t;
        let reflectance = s * t / down;
        // 1/cosh without overflow.
        let sech = 2.0 * (-x).exp() / (1.0 + (-2.0 * x).exp());
        Ok(Self { reflectance, transmittance: sech / down, reflectance_below: reflectance })
    }

    /// This layer on top of another (Kubelka 1954): `R12 = R1 + T1^2 R2 / (1 - R1 R2)`.
    #[must_use]
    pub fn over(&self, below: &Self) -> Self {
        let bounces = 1.0 - self.reflectance_below * below.reflectance;
        if bounces <= 0.0 {
            // Two perfect mirrors face each other: no light gets between them.
            return Self {
                reflectance: self.reflectance,
                transmittance: 0.0,
                reflectance_below: below.reflectance_below,
            };
        }
        let through = |t: f64, r: f64| t * t * r / bounces;
        Self {
            reflectance: self.reflectance + through(self.transmittance, below.reflectance),
            transmittance: self.transmittance * below.transmittance / bounces,
            reflectance_below: below.reflectance_below + through(below.transmittance, self.reflectance_below),
        }
    }

    /// Reflectance of the layer on an opaque ground.
    ///
    /// # Errors
    /// A ground outside 0..=1.
    pub fn on_ground(&self, ground: f64) -> Result<f64, Error> {
        check_range("ground reflectance", ground, 0.0, 1.0, "between 0 and 1")?;
        let opaque = Self { reflectance: ground, transmittance: 0.0, reflectance_below: ground };
        Ok(self.over(&opaque).reflectance)
    }
}

/// What is measured above the surface of a paint whose inner reflectance is `inner`: part of the light is reflected
/// before it enters (`k1`) and part is kept inside (`k2`) (Saunderson 1942). Apply it once, at the top of the stack.
///
/// For a binder of index 1.5: `k1` = 0.0400 at normal incidence (0 with the gloss excluded), `k2` = 0.59635.
///
/// # Errors
/// `inner` outside 0..=1, `k1` or `k2` outside 0..=0.999.
pub fn saunderson(inner: f64, k1: f64, k2: f64) -> Result<f64, Error> {
    check_interface(k1, k2)?;
    check_range("inner reflectance", inner, 0.0, 1.0, "between 0 and 1")?;
    Ok(k1 + (1.0 - k1) * (1.0 - k2) * inner / (1.0 - k2 * inner))
}

/// The inner reflectance that [`saunderson`] turns into `measured`.
///
/// # Errors
/// `measured` outside `k1..=1`, `k1` or `k2` outside 0..=0.999.
pub fn saunderson_inverse(measured: f64, k1: f64, k2: f64) -> Result<f64, Error> {
    check_interface(k1, k2)?;
    check_range("measured reflectance", measured, k1, 1.0, "between k1 and 1")?;
    Ok((measured - k1) / (1.0 - k1 - k2 * (1.0 - measured)))
}

fn check_interface(k1: f64, k2: f64) -> Result<(), Error> {
    check_range("k1", k1, 0.0, 0.999, "between 0 and 0.999")?;
    check_range("k2", k2, 0.0, 0.999, "between 0 and 0.999")
}
