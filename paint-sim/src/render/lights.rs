//! The light on a surface.

use nalgebra::{Point3, UnitVector3, Vector3};

use super::lamp::Lamp;
use super::sky::Sky;
use super::sunlight::sunlight;
use crate::error::{Error, check_not_negative, check_positive};

/// The light in the scene, linear RGB. A white matt surface that faces the sun appears as `exposure * (sun + ambient)` and what the sky and the
/// lamps add.
#[derive(Debug, Clone, PartialEq)]
pub struct Lights {
    /// Unit vector towards the sun, world frame.
    pub towards_sun: UnitVector3<f64>,
    /// Light of the sun, linear RGB.
    pub sun: [f32; 3],
    /// Light from everywhere, linear RGB.
    pub ambient: [f32; 3],
    /// What is seen where there is neither a surface nor a sky, linear RGB.
    pub background: [f32; 3],
    /// The sky with the ground below it.
    pub sky: Option<Sky>,
    /// Lamps, which throw shadows as the sun does.
    pub lamps: Vec<Lamp>,
    /// Times all the light: how the camera is set. See [`exposed_at`](Self::exposed_at).
    pub exposure: f32,
}

impl Default for Lights {
    /// A high sun from the front right.
    fn default() -> Self {
        let towards_sun = UnitVector3::new_normalize(Vector3::new(0.3, -0.4, 0.87));
        Self {
            towards_sun,
            sun: [0.7; 3],
            ambient: [0.3; 3],
            background: [0.85, 0.9, 1.0],
            sky: None,
            lamps: Vec::new(),
            exposure: 1.0,
        }
    }
}

impl Lights {
    /// A clear day: [`sunlight`] and [`Sky::clear`], in cd/m²; to be [exposed](Self::exposed_at).
    ///
    /// # Errors
    /// A sun below the horizon, a turbidity outside 1.7..=10, an albedo outside 0..=1.
    pub fn daylight(towards_sun: UnitVector3<f64>, turbidity: f64, ground_albedo: f64) -> Result<Self, Error> {
        let sun = sunlight(&towards_sun, turbidity)?;
        let sky = Sky::clear(&towards_sun, turbidity, ground_albedo)?;
        Ok(Self { towards_sun, sun, ..Self::without_sun(sky, Vec::new()) })
    }

    /// No sun: a sky, and lamps.
    pub fn without_sun(sky: Sky, lamps: Vec<Lamp>) -> Self {
        Self { sun: [0.0; 3], ambient: [0.0; 3], background: [0.0; 3], sky: Some(sky), lamps, ..Self::default() }
    }

    /// What a white matt card shows that nothing shades, at a place with a unit normal, linear RGB.
    pub fn on_card(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> [f32; 3] {
        let mut light = self.around(normal);
        let mut add = |of: [f32; 3], towards: &Vector3<f64>| {
            let cosine = normal.dot(towards).max(0.0) as f32;
            light = std::array::from_fn(|c| light[c] + of[c] * cosine);
        };
        add(self.sun, &self.towards_sun);
        for (towards, _, of) in self.lamps.iter().filter_map(|lamp| lamp.seen_from(point)) {
            add(of, &towards);
        }
        light.map(|c| self.exposure * c)
    }

    /// The same light, exposed so that the brightest channel of a white card at `point` becomes `level` (usually 0.9). The card faces the sun, a
    /// lamp, or up, wherever it is brightest: what is nearer to a lamp may be brighter, see [`Frame::clipped`](super::Frame::clipped).
    ///
    /// # Errors
    /// A level that is not positive, no light at all.
    pub fn exposed_at(self, point: &Point3<f64>, level: f32) -> Result<Self, Error> {
        check_positive("level of a white card", f64::from(level))?;
        let lamps = self.lamps.iter().filter_map(|lamp| lamp.seen_from(point)).map(|(towards, ..)| towards);
        let cards = lamps.chain([self.towards_sun.into_inner(), Vector3::z()]);
        let brightest = cards.flat_map(|normal| self.on_card(point, &normal)).fold(0.0_f32, f32::max);
        check_positive("light on a white card", f64::from(brightest))?;
        Ok(Self { exposure: self.exposure * level / brightest, ..self })
    }

    /// What is seen in a direction without a surface.
    pub(super) fn background(&self, direction: &Vector3<f64>) -> [f32; 3] {
        let light = self.sky.as_ref().map_or(self.background, |sky| sky.radiance(direction));
        light.map(|c| self.exposure * c)
    }

    /// Light without a direct source from one direction, before exposure.
    pub(super) fn from(&self, direction: &Vector3<f64>) -> [f32; 3] {
        let Some(sky) = &self.sky else { return self.ambient };
        let sky = sky.radiance(direction);
        std::array::from_fn(|c| self.ambient[c] + sky[c])
    }

    /// The same from all directions on a white matt surface.
    pub(super) fn around(&self, normal: &Vector3<f64>) -> [f32; 3] {
        let Some(sky) = &self.sky else { return self.ambient };
        let sky = sky.on_white(normal);
        std::array::from_fn(|c| self.ambient[c] + sky[c])
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let light = self.sun.iter().chain(&self.ambient).chain(&self.background);
        if !(light.into_iter().all(|v| v.is_finite()) && self.towards_sun.iter().all(|v| v.is_finite())) {
            return Err(Error::NotFinite { what: "light", index: 0 });
        }
        check_not_negative("exposure", f64::from(self.exposure))?;
        self.lamps.iter().enumerate().try_for_each(|(index, lamp)| lamp.check(index))
    }
}
