//! Irradiance from light of all directions by nine coefficients (Ramamoorthi and Hanrahan 2001).

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

/// Rings and directions in each of them: equal parts of the sphere, with the horizon between two.
const RINGS: usize = 128;
const SECTORS: usize = 256;

/// Coefficients of the irradiance over π.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Irradiance([[f32; 3]; 9]);

impl Irradiance {
    /// Of a light that is given by direction.
    pub(super) fn of(radiance: &dyn Fn(&Vector3<f64>) -> [f32; 3]) -> Self {
        let mut sums = [[0.0_f64; 3]; 9];
        for ring in 0..RINGS {
            let z = (ring as f64 + 0.5) * 2.0 / RINGS as f64 - 1.0;
            let level = (1.0 - z * z).sqrt();
            for sector in 0..SECTORS {
                let (sine, cosine) = ((sector as f64 + 0.5) * TAU / SECTORS as f64).sin_cos();
                let direction = Vector3::new(level * cosine, level * sine, z);
                let light = radiance(&direction);
                for (sum, y) in sums.iter_mut().zip(harmonics(&direction)) {
                    *sum = std::array::from_fn(|c| sum[c] + y * f64::from(light[c]));
                }
            }
        }
        let part = 4.0 * PI / (RINGS * SECTORS) as f64;
        // The cosine lobe over π, order by order: their Eq. (8).
        let lobe = [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25];
        Self(std::array::from_fn(|k| sums[k].map(|sum| (sum * part * lobe[k]) as f32)))
    }

    /// Irradiance over π on a unit normal.
    pub(super) fn on_white(&self, normal: &Vector3<f64>) -> [f32; 3] {
        let mut light = [0.0_f32; 3];
        for (coefficients, y) in self.0.iter().zip(harmonics(normal)) {
            light = std::array::from_fn(|c| light[c] + coefficients[c] * y as f32);
        }
        // Two orders ring where a light is nearly a point.
        light.map(|c| c.max(0.0))
    }
}

/// The real spherical harmonics of orders 0 to 2.
fn harmonics(d: &Vector3<f64>) -> [f64; 9] {
    let (first, second) = ((3.0 / (4.0 * PI)).sqrt(), (15.0 / (4.0 * PI)).sqrt());
    [
        0.5 / PI.sqrt(),
        first * d.y,
        first * d.z,
        first * d.x,
        second * d.x * d.y,
        second * d.y * d.z,
        (5.0 / (16.0 * PI)).sqrt() * (3.0 * d.z * d.z - 1.0),
        second * d.x * d.z,
        0.5 * second * (d.x * d.x - d.y * d.y),
    ]
}
