//! The rays of a picture, tile by tile: neighbours search for what they hit together.

use nalgebra::{Point3, Vector3};

use super::camera::Camera;
use super::lamp::Lamp;
use super::lights::Lights;
use super::seen::{MAX_RAY_LENGTH, Seen};
use super::shading::Shading;
use crate::colour::Srgb8Table;
use crate::surface::{Hit, ShadowRay, Surface};

/// Some whole rows of the frame, so that threads can own what they write.
pub(super) struct Band<'a> {
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) colour: &'a mut [[u8; 3]],
    pub(super) depth: &'a mut [f32],
    pub(super) faces: &'a mut [u32],
    pub(super) normals: &'a mut [[f32; 3]],
    /// Pixels with more light than they can show.
    pub(super) clipped: usize,
}

pub(super) struct BandRenderer<'a> {
    pub(super) surface: &'a dyn Surface,
    pub(super) camera: &'a Camera,
    pub(super) shade: &'a (dyn Fn(&Hit) -> Shading + Sync),
    pub(super) lights: &'a Lights,
    pub(super) supersampling: u32,
}

/// Rays and what they hit.
#[derive(Default)]
struct Rays {
    directions: Vec<Vector3<f64>>,
    hits: Vec<Option<Hit>>,
}

impl BandRenderer<'_> {
    /// Pixels along the edge of a tile, rows of a band: so many that the surface is asked for as many rays as it likes to be.
    pub(super) fn tile_edge(&self) -> usize {
        (self.surface.rays_at_once().isqrt() / self.supersampling as usize).max(1)
    }

    pub(super) fn fill(&self, band: &mut Band) {
        let rows = band.colour.len() / band.width;
        let (mut centres, mut samples) = (Rays::default(), Rays::default());
        let mut cosines = Vec::new();
        let table = Srgb8Table::get();
        // Much of a picture is as bright as the pixel before it.
        let mut last = ([0.0; 3], [0; 3]);
        for left in (0..band.width).step_by(self.tile_edge()) {
            let columns = left..(left + self.tile_edge()).min(band.width);
            centres.directions.clear();
            samples.directions.clear();
            cosines.clear();
            for v in band.top..band.top + rows {
                for u in columns.clone() {
                    let (u, v) = (u as f64, v as f64);
                    let (direction, cosine) = self.camera.ray(u, v);
                    centres.directions.push(direction);
                    cosines.push(cosine);
                    if self.supersampling > 1 {
                        samples.directions.extend(self.grid().map(|(du, dv)| self.camera.ray(u + du, v + dv).0));
                    }
                }
            }
            self.cast(&mut centres);
            if self.supersampling > 1 {
                self.cast(&mut samples);
            }
            let light = self.light(if self.supersampling == 1 { &centres } else { &samples });
            let rays = centres.hits.iter().zip(&centres.directions).zip(&cosines);
            let mut pixels = rays.zip(light.chunks_exact((self.supersampling * self.supersampling) as usize));
            for row in 0..rows {
                let places = row * band.width + columns.start..row * band.width + columns.end;
                for (at, (((hit, direction), cosine), light)) in places.zip(pixels.by_ref()) {
                    if let Some(hit) = hit {
                        band.depth[at] = (hit.distance * cosine) as f32;
                        band.faces[at] = hit.face;
                        band.normals[at] = facing(hit, direction).map(|v| v as f32).into();
                    }
                    let linear = mean(light);
                    if linear != last.0 {
                        last = (linear, linear.map(|v| table.encode(v)));
                    }
                    band.colour[at] = last.1;
                    band.clipped += usize::from(linear.iter().any(|v| *v > 1.0));
                }
            }
        }
    }

    fn cast(&self, rays: &mut Rays) {
        let eye = Point3::from(self.camera.world_from_camera.translation.vector);
        rays.hits = self.surface.cast_beam(&eye, &rays.directions, MAX_RAY_LENGTH);
    }

    /// Places of a regular grid of rays inside a pixel, from its centre.
    fn grid(&self) -> impl Iterator<Item = (f64, f64)> {
        let n = self.supersampling;
        let offset = move |i: u32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
        (0..n * n).map(move |i| (offset(i % n), offset(i / n)))
    }

    /// The light that each ray brings to the eye.
    fn light(&self, rays: &Rays) -> Vec<[f32; 3]> {
        let eye = self.camera.world_from_camera.translation.vector;
        let seen = |(hit, direction): (&Option<Hit>, &Vector3<f64>)| {
            let hit = hit.as_ref()?;
            let normal = facing(hit, direction);
            // Off the surface by more than the rounding of the hit, or it would shade itself.
            let point = Point3::from(eye + direction * hit.distance + normal * (1e-6 * (1.0 + hit.distance)));
            Some(Seen { point, normal, towards_eye: -direction, shading: (self.shade)(hit) })
        };
        let seen: Vec<Option<Seen>> = rays.hits.iter().zip(&rays.directions).map(seen).collect();
        let faces_sun = |seen: &&Seen| seen.faces_sun(self.lights);
        let facing_sun: Vec<Point3<f64>> = seen.iter().flatten().filter(faces_sun).map(|seen| seen.point).collect();
        let dark = self.surface.occluded_parallel(&facing_sun, &self.lights.towards_sun, MAX_RAY_LENGTH);
        let mut dark = dark.into_iter();
        let lit: Vec<Vec<bool>> = self.lights.lamps.iter().map(|lamp| self.lit(lamp, &seen)).collect();
        let light = |(k, (seen, direction)): (usize, (&Option<Seen>, &Vector3<f64>))| match seen {
            None => self.lights.background(direction),
            Some(seen) => {
                let sunny = seen.faces_sun(self.lights) && dark.next() == Some(false);
                seen.light(self.lights, sunny, |lamp| lit[lamp][k])
            }
        };
        seen.iter().zip(&rays.directions).enumerate().map(light).collect()
    }

    /// Which points a lamp lights.
    fn lit(&self, lamp: &Lamp, seen: &[Option<Seen>]) -> Vec<bool> {
        let towards = |seen: &Option<Seen>| seen.as_ref().and_then(|seen| seen.towards_lamp(lamp));
        let rays: Vec<Option<ShadowRay>> = seen.iter().map(towards).collect();
        let mut dark = self.surface.occluded_each(&rays.iter().flatten().copied().collect::<Vec<_>>()).into_iter();
        rays.iter().map(|ray| ray.is_some() && dark.next() == Some(false)).collect()
    }
}

/// Mean of the light of a pixel's rays.
fn mean(light: &[[f32; 3]]) -> [f32; 3] {
    if let [only] = light {
        return *only;
    }
    let sum = light.iter().fold([0.0_f32; 3], |sum, light| std::array::from_fn(|c| sum[c] + light[c]));
    sum.map(|total| total / light.len() as f32)
}

/// The normal of the hit on the side from which the ray came.
fn facing(hit: &Hit, direction: &Vector3<f64>) -> Vector3<f64> {
    if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal }
}
