//! Gloss: a clear dielectric coat over the matt paint.

mod albedo;
mod microfacets;

use std::f64::consts::PI;

use nalgebra::Vector3;

use self::albedo::AlbedoTable;
use self::microfacets::{LEAST_COSINE, fresnel, shadowing};
use crate::error::{Error, check_range};

/// A rough coat of refractive index 1.5 (GGX microfacets: Walter, Marschner, Li, Torrance 2007). What it reflects does not reach the
/// paint below, which is coupled to it so that no light is lost or made (Kelemen and Szirmay-Kalos 2001).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coat {
    roughness: f64,
}

impl Coat {
    /// A coat of a roughness, the α of the GGX distribution: 0.05 varnish, 0.2 semi-gloss, 0.5 eggshell.
    ///
    /// # Errors
    /// A roughness outside 0.02..=1.
    pub fn new(roughness: f64) -> Result<Self, Error> {
        check_range("roughness of the coat", roughness, 0.02, 1.0, "from 0.02 to 1")?;
        Ok(Self { roughness })
    }

    /// Its roughness.
    pub fn roughness(&self) -> f64 {
        self.roughness
    }

    /// Share of even light from everywhere that it reflects to an eye at this cosine from the normal.
    pub fn albedo(&self, cosine_of_eye: f64) -> f64 {
        AlbedoTable::shared().at(self.roughness, cosine_of_eye.clamp(LEAST_COSINE, 1.0))
    }

    /// What reaches the eye of light from one direction, in units of what a white matt surface that faces the light would show: from the paint
    /// below, to be multiplied with its albedo, and from the coat. All vectors have unit length; both are zero behind the surface.
    pub fn reflected(
        &self,
        normal: &Vector3<f64>,
        towards_eye: &Vector3<f64>,
        towards_light: &Vector3<f64>,
    ) -> [f64; 2] {
        let light = normal.dot(towards_light);
        if light <= 0.0 {
            return [0.0; 2];
        }
        let (eye, facing) = (normal.dot(towards_eye).clamp(LEAST_COSINE, 1.0), light.clamp(LEAST_COSINE, 1.0));
        let table = AlbedoTable::shared();
        let passed = |cosine: f64| 1.0 - table.at(self.roughness, cosine);
        // Kelemen and Szirmay-Kalos, Eq. (5).
        let matt = light * passed(eye) * passed(facing) / (1.0 - table.mean(self.roughness));
        let Some(half) = (towards_eye + towards_light).try_normalize(1e-9) else { return [matt, 0.0] };
        let alpha2 = self.roughness * self.roughness;
        let facets = facets(alpha2, normal.dot(&half).clamp(0.0, 1.0));
        let lobe = facets * fresnel(towards_light.dot(&half).clamp(0.0, 1.0)) * shadowing(alpha2, eye, facing);
        [matt, PI * light * lobe / (4.0 * eye * facing)]
    }
}

/// GGX distribution of the normals of facets, 1/sr.
fn facets(alpha2: f64, cosine: f64) -> f64 {
    let flat = cosine * cosine * (alpha2 - 1.0) + 1.0;
    alpha2 / (PI * flat * flat)
}
