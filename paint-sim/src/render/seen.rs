//! The light that leaves a point of the surface towards the eye.

use nalgebra::{Point3, Vector3};

use super::coat::Coat;
use super::lamp::Lamp;
use super::lights::Lights;
use super::shading::Shading;
use crate::surface::ShadowRay;

/// Rays end here, m: beyond it there is only background.
pub(super) const MAX_RAY_LENGTH: f64 = 1e4;

/// A point that the camera sees.
pub(super) struct Seen {
    /// A little off the surface, where its shadow rays begin.
    pub(super) point: Point3<f64>,
    /// Of the geometry, on the side of the eye.
    pub(super) normal: Vector3<f64>,
    pub(super) towards_eye: Vector3<f64>,
    pub(super) shading: Shading,
}

impl Seen {
    /// The shading's normal, on the side of the eye.
    fn shading_normal(&self) -> Vector3<f64> {
        let normal = self.shading.normal;
        if normal.dot(&self.normal) < 0.0 { -normal } else { normal }
    }

    /// Whether the sun lights it if nothing stands before it; a sun without light does not.
    pub(super) fn faces_sun(&self, lights: &Lights) -> bool {
        lights.sun.iter().any(|c| *c != 0.0) && self.shading_normal().dot(&lights.towards_sun) > 0.0
    }

    /// The ray that must be free for a lamp to light it; `None` where it is behind the surface.
    pub(super) fn towards_lamp(&self, lamp: &Lamp) -> Option<ShadowRay> {
        let (direction, length, _) = lamp.seen_from(&self.point)?;
        let faces = self.shading_normal().dot(&direction) > 0.0;
        faces.then_some(ShadowRay { origin: self.point, direction, from: 0.0, length })
    }

    /// The sun where it is `sunny`, the lamps that are `lit` by number, sky and ambient light as if nothing stood before them.
    pub(super) fn light(&self, lights: &Lights, sunny: bool, lit: impl Fn(usize) -> bool) -> [f32; 3] {
        let Shading { albedo, coat, .. } = &self.shading;
        let normal = self.shading_normal();
        // Of one light that reaches it: the shares that paint and coat send to the eye.
        let shares = |towards: &Vector3<f64>| match coat {
            None => [normal.dot(towards) as f32, 0.0],
            Some(coat) => coat.reflected(&normal, &self.towards_eye, towards).map(|share| share as f32),
        };
        let [matt, gloss] = if sunny { shares(&lights.towards_sun) } else { [0.0; 2] };
        let mut on_paint: [f32; 3] = std::array::from_fn(|c| lights.sun[c] * matt);
        let mut off_coat = lights.sun.map(|sun| sun * gloss);
        for (number, lamp) in lights.lamps.iter().enumerate() {
            let Some((towards, _, light)) = lamp.seen_from(&self.point) else { continue };
            let [matt, gloss] = if lit(number) { shares(&towards) } else { [0.0; 2] };
            on_paint = std::array::from_fn(|c| on_paint[c] + light[c] * matt);
            off_coat = std::array::from_fn(|c| off_coat[c] + light[c] * gloss);
        }
        let mut around = lights.around(&normal);
        if let Some(coat) = coat {
            let share = coat.albedo(normal.dot(&self.towards_eye)) as f32;
            let mirrored = self.mirrored(*coat, &normal, lights);
            around = around.map(|light| (1.0 - share) * light);
            off_coat = std::array::from_fn(|c| off_coat[c] + share * mirrored[c]);
        }
        std::array::from_fn(|c| lights.exposure * (albedo[c] * (on_paint[c] + around[c]) + off_coat[c]))
    }

    /// What a coat mirrors of the surroundings: the rougher it is, the more of their mean about that direction.
    fn mirrored(&self, coat: Coat, normal: &Vector3<f64>, lights: &Lights) -> [f32; 3] {
        let direction = 2.0 * normal.dot(&self.towards_eye) * normal - self.towards_eye;
        let (sharp, even) = (lights.from(&direction), lights.around(&direction));
        let roughness = coat.roughness() as f32;
        std::array::from_fn(|c| sharp[c] + roughness * (even[c] - sharp[c]))
    }
}
