//! The sky as a light: what is seen of it, and what a surface gets from it.

mod irradiance;
mod perez;

use nalgebra::{UnitVector3, Vector3};

use self::irradiance::Irradiance;
use self::perez::ClearSky;
use super::black_body::black_body;
use super::sunlight::{check_elevation, check_turbidity, sunlight};
use crate::error::{Error, check_not_negative, check_range};

/// Colour temperature of a covered sky, K.
const OVERCAST: f64 = 6500.0;

/// Light from all directions, linear RGB: above the horizon (z up) a sky, below it a matt ground in its light.
#[derive(Debug, Clone, PartialEq)]
pub struct Sky {
    model: Model,
    ground: [f32; 3],
    irradiance: Irradiance,
}

#[derive(Debug, Clone, PartialEq)]
enum Model {
    Uniform([f32; 3]),
    Overcast([f32; 3]),
    Clear(Box<ClearSky>),
}

impl Sky {
    /// The same light from everywhere, also from below.
    ///
    /// # Errors
    /// Light that is negative or not finite.
    pub fn uniform(radiance: [f32; 3]) -> Result<Self, Error> {
        radiance.iter().try_for_each(|c| check_not_negative("light of the sky", f64::from(*c)))?;
        Ok(Self::new(Model::Uniform(radiance), [0.0; 3]))
    }

    /// The sky of Preetham, Shirley and Smits (1999), cd/m²: Perez' form for luminance and chromaticity, by the sun's place (z up) and the
    /// turbidity of the air. The ground, of `ground_albedo`, has the light of sun and sky. Its luminance is too high by some times where the sun
    /// is within a few degrees of the horizon.
    ///
    /// # Errors
    /// A sun below the horizon, a turbidity outside 1.7..=10, an albedo outside 0..=1.
    pub fn clear(towards_sun: &UnitVector3<f64>, turbidity: f64, ground_albedo: f64) -> Result<Self, Error> {
        check_turbidity(turbidity)?;
        check_albedo(ground_albedo)?;
        let elevation = check_elevation(towards_sun)?;
        let on_ground = sunlight(towards_sun, turbidity)?.map(|c| c * elevation.sin() as f32);
        let model = Model::Clear(Box::new(ClearSky::new(towards_sun, turbidity)));
        Ok(Self::on_ground(model, on_ground, ground_albedo))
    }

    /// The covered sky of Moon and Spencer (CIE S 011, type 16): `zenith` (cd/m², 2000 dark, 10000 bright) above, a third of it at the horizon,
    /// with the colour of 6500 K.
    ///
    /// # Errors
    /// A luminance that is negative or not finite, an albedo outside 0..=1.
    pub fn overcast(zenith: f64, ground_albedo: f64) -> Result<Self, Error> {
        check_not_negative("luminance of the zenith", zenith)?;
        check_albedo(ground_albedo)?;
        let colour = black_body(OVERCAST)?.map(|c| c * zenith as f32);
        Ok(Self::on_ground(Model::Overcast(colour), [0.0; 3], ground_albedo))
    }

    /// A sky above a ground that has its light and that of `sun`.
    fn on_ground(model: Model, sun: [f32; 3], albedo: f64) -> Self {
        let black = Self::new(model, [0.0; 3]);
        let above = black.on_white(&Vector3::z());
        let ground = std::array::from_fn(|c| albedo as f32 * (above[c] + sun[c]));
        Self::new(black.model, ground)
    }

    fn new(model: Model, ground: [f32; 3]) -> Self {
        let dark = Self { model, ground, irradiance: Irradiance::default() };
        let irradiance = Irradiance::of(&|direction| dark.radiance(direction));
        Self { irradiance, ..dark }
    }

    /// What is seen in a direction (unit length).
    pub fn radiance(&self, direction: &Vector3<f64>) -> [f32; 3] {
        match &self.model {
            Model::Uniform(radiance) => *radiance,
            _ if direction.z < 0.0 => self.ground,
            Model::Overcast(zenith) => zenith.map(|c| c * ((1.0 + 2.0 * direction.z) / 3.0) as f32),
            Model::Clear(sky) => sky.radiance(direction),
        }
    }

    /// What a white matt surface with this unit normal shows of it, nothing else in its way: the irradiance over π, from nine coefficients
    /// (Ramamoorthi and Hanrahan 2001).
    pub fn on_white(&self, normal: &Vector3<f64>) -> [f32; 3] {
        self.irradiance.on_white(normal)
    }
}

fn check_albedo(albedo: f64) -> Result<(), Error> {
    check_range("albedo of the ground", albedo, 0.0, 1.0, "from 0 to 1")
}
