//! A lamp near the surface.

use nalgebra::{Point3, Vector3};

use super::black_body::black_body;
use crate::error::{Error, check_not_negative};

/// A lamp that shines from one point evenly into all directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Where it hangs, m, world frame.
    pub position: Point3<f64>,
    /// Light of a white surface that faces it from 1 m, linear RGB.
    pub light: [f32; 3],
}

impl Lamp {
    /// A lamp of a luminous flux (lm: a street lamp has 3000 to 12000) and a [colour temperature](black_body) (K); its light is in cd/m².
    ///
    /// # Errors
    /// A flux that is negative or not finite, a temperature outside 1000..=25000 K.
    pub fn new(position: Point3<f64>, flux: f64, temperature: f64) -> Result<Self, Error> {
        check_not_negative("luminous flux of the lamp", flux)?;
        let candela = flux / (4.0 * std::f64::consts::PI);
        let light = black_body(temperature)?.map(|c| c * (candela / std::f64::consts::PI) as f32);
        Ok(Self { position, light })
    }

    /// Unit direction and distance (m) towards it, and the light of a white surface that faces it; `None` in the lamp itself.
    pub(super) fn seen_from(&self, point: &Point3<f64>) -> Option<(Vector3<f64>, f64, [f32; 3])> {
        let way = self.position - point;
        let distance = way.norm();
        let direction = way.try_normalize(1e-6)?;
        let falloff = (1.0 / (distance * distance)) as f32;
        Some((direction, distance, self.light.map(|c| c * falloff)))
    }

    pub(super) fn check(&self, index: usize) -> Result<(), Error> {
        let finite = self.position.iter().all(|v| v.is_finite()) && self.light.iter().all(|v| v.is_finite());
        if finite { Ok(()) } else { Err(Error::NotFinite { what: "lamp", index }) }
    }
}
