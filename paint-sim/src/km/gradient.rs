//! How the reflectance of a film changes with its parameters, in closed form.

use super::domain::{domain, tanhc};

/// Partial derivatives of [`super::reflectance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gradient {
    /// With respect to the absorption, in units of thickness.
    pub absorption: f64,
    /// With respect to the scattering, in units of thickness.
    pub scattering: f64,
    /// With respect to the thickness: Riccati's equation `S - 2 (K+S) R + S R^2` of Kubelka and Munk.
    pub thickness: f64,
    /// With respect to the ground's reflectance.
    pub ground: f64,
}

/// The gradient of [`super::reflectance`] at the same arguments, moved into the domain in the same way. Derived by
/// differentiating `R(t)` and `t = tanh(g d)/g` in `u = g^2`.
pub fn gradient(k: f64, s: f64, thickness: f64, ground: f64) -> Gradient {
    let (k, s, d, rg) = domain(k, s, thickness, ground);
    let u = k * (k + 2.0 * s);
    let x = k.sqrt() * (k + 2.0 * s).sqrt() * d;
    let t = d * tanhc(x);
    let sech_squared = 1.0 - (tanhc(x) * x).powi(2);
    let scattered = s * (1.0 - rg);
    let denominator = 1.0 + t * (scattered + k);
    let r = (rg + t * (scattered - k * rg)) / denominator;
    let by_t = ((scattered - k * rg) - r * (scattered + k)) / denominator;
    let t_by_u = if x < 1e-2 {
        // The quotient cancels to fourth order in x; the series' next term is below 1e-13 of this one.
        let square = x * x;
        -d * d * d * (1.0 / 3.0 - square * (4.0 / 15.0 - square * (17.0 / 105.0 - square * (248.0 / 2835.0))))
    } else {
        (d * sech_squared - t) / (2.0 * u)
    };
    Gradient {
        absorption: -t * (rg + r) / denominator + by_t * t_by_u * 2.0 * (k + s),
        scattering: t * (1.0 - rg) * (1.0 - r) / denominator + by_t * t_by_u * 2.0 * k,
        thickness: by_t * sech_squared,
        ground: sech_squared / (denominator * denominator),
    }
}
