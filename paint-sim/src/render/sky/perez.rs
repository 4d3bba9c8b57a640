//! The clear sky of Preetham, Shirley and Smits (1999): luminance and chromaticity in the form of Perez, Seals and Michalsky (1993).

use std::f64::consts::PI;

use nalgebra::{UnitVector3, Vector3};

use crate::colour::linear_srgb;

/// The directions next to the horizon look like this one: the form divides by the cosine.
const LEAST_COSINE: f64 = 1e-3;

/// Their Appendix: `A` to `E` of luminance, x and y as `slope * turbidity + offset`.
const DISTRIBUTIONS: [[[f64; 2]; 5]; 3] = [
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
    [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
    [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
];
/// Chromaticity x and y of the zenith: rows by falling powers of the turbidity, columns by falling powers of the sun's zenith angle.
const ZENITH: [[[f64; 4]; 3]; 2] = [
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]],
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]],
];

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ClearSky {
    towards_sun: Vector3<f64>,
    distributions: [[f64; 5]; 3],
    /// Luminance (cd/m²), x and y of the zenith, over the distribution there.
    scales: [f64; 3],
}

impl ClearSky {
    /// With a sun above the horizon.
    pub(super) fn new(towards_sun: &UnitVector3<f64>, turbidity: f64) -> Self {
        let distributions = DISTRIBUTIONS.map(|of| of.map(|[slope, offset]| slope * turbidity + offset));
        let from_zenith = towards_sun.z.clamp(0.0, 1.0).acos();
        let chi = (4.0 / 9.0 - turbidity / 120.0) * (PI - 2.0 * from_zenith);
        let luminance = 1e3 * ((4.0453 * turbidity - 4.9710) * chi.tan() - 0.2155 * turbidity + 2.4192);
        let horner = |row: &[f64]| row.iter().fold(0.0, |sum, c| sum * from_zenith + c);
        let chromaticity = |rows: &[[f64; 4]; 3]| rows.iter().fold(0.0, |sum, row| sum * turbidity + horner(row));
        let zenith = [luminance, chromaticity(&ZENITH[0]), chromaticity(&ZENITH[1])];
        let scales = std::array::from_fn(|k| zenith[k] / perez(&distributions[k], 1.0, from_zenith));
        Self { towards_sun: towards_sun.into_inner(), distributions, scales }
    }

    /// Linear sRGB, cd/m², above the horizon.
    pub(super) fn radiance(&self, direction: &Vector3<f64>) -> [f32; 3] {
        let from_sun = direction.dot(&self.towards_sun).clamp(-1.0, 1.0).acos();
        let [luminance, x, y] = std::array::from_fn(|k| {
            self.scales[k] * perez(&self.distributions[k], direction.z.max(LEAST_COSINE), from_sun)
        });
        let y = y.max(1e-3);
        let xyz = [luminance * x / y, luminance, luminance * (1.0 - x - y) / y];
        linear_srgb(xyz).map(|c| c.max(0.0) as f32)
    }
}

/// Their Eq. (3), by the cosine of the angle from the zenith and the angle from the sun.
fn perez([a, b, c, d, e]: &[f64; 5], cosine: f64, from_sun: f64) -> f64 {
    (1.0 + a * (b / cosine).exp()) * (1.0 + c * (d * from_sun).exp() + e * from_sun.cos().powi(2))
}
