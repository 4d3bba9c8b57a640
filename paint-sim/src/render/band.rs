//! The rays of a picture, tile by tile: neighbours search for what they hit together.

use nalgebra::{Point3, Vector3};

use super::camera::Camera;
use super::lights::Lights;
use super::seen::{MAX_RAY_LENGTH, Seen};
use super::shading::Shading;
use crate::colour::encode_srgb8;
use crate::surface::{Hit, Surface};

/// Rays along the edge of a tile: few triangles are in so narrow a pyramid, and many rays share them.
const TILE: u32 = 8;

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
    /// Pixels along the edge of a tile, rows of a band.
    pub(super) fn tile_edge(&self) -> usize {
        (TILE / self.supersampling).max(1) as usize
    }

    pub(super) fn fill(&self, band: &mut Band) {
        let rows = band.colour.len() / band.width;
        let (mut centres, mut samples) = (Rays::default(), Rays::default());
        let mut cosines = Vec::new();
        for left in (0..band.width).step_by(self.tile_edge()) {
            let right = (left + self.tile_edge()).min(band.width);
            let pixels = || (0..rows).flat_map(|row| (left..right).map(move |column| (row, column)));
            centres.directions.clear();
            cosines.clear();
            for (row, column) in pixels() {
                let (direction, cosine) = self.camera.ray(column as f64, (band.top + row) as f64);
                centres.directions.push(direction);
                cosines.push(cosine);
            }
            self.cast(&mut centres);
            if self.supersampling > 1 {
                samples.directions.clear();
                for (row, column) in pixels() {
                    let (u, v) = (column as f64, (band.top + row) as f64);
                    samples.directions.extend(self.grid().map(|(du, dv)| self.camera.ray(u + du, v + dv).0));
                }
                self.cast(&mut samples);
            }
            for (k, (row, column)) in pixels().enumerate() {
                let at = row * band.width + column;
                let (hit, direction) = (&centres.hits[k], &centres.directions[k]);
                if let Some(hit) = hit {
                    band.depth[at] = (hit.distance * cosines[k]) as f32;
                    band.faces[at] = hit.face;
                    band.normals[at] = facing(hit, direction).map(|v| v as f32).into();
                }
                let linear =
                    if self.supersampling == 1 { self.light(hit.as_ref(), direction) } else { self.mean(&samples, k) };
                band.colour[at] = linear.map(|v| encode_srgb8(f64::from(v)).0);
                band.clipped += usize::from(linear.iter().any(|v| *v > 1.0));
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

    /// Mean light over the grid of a tile's pixel.
    fn mean(&self, samples: &Rays, pixel: usize) -> [f32; 3] {
        let count = (self.supersampling * self.supersampling) as usize;
        let of_pixel = pixel * count..(pixel + 1) * count;
        let mut sum = [0.0_f32; 3];
        for (direction, hit) in samples.directions[of_pixel.clone()].iter().zip(&samples.hits[of_pixel]) {
            let light = self.light(hit.as_ref(), direction);
            sum = std::array::from_fn(|c| sum[c] + light[c]);
        }
        sum.map(|total| total / count as f32)
    }

    fn light(&self, hit: Option<&Hit>, direction: &Vector3<f64>) -> [f32; 3] {
        let Some(hit) = hit else { return self.lights.background(direction) };
        let eye = self.camera.world_from_camera.translation.vector;
        let normal = facing(hit, direction);
        // Off the surface by more than the rounding of the hit, or it would shade itself.
        let point = Point3::from(eye + direction * hit.distance + normal * (1e-6 * (1.0 + hit.distance)));
        let seen = Seen { point, normal, towards_eye: -direction, shading: (self.shade)(hit) };
        seen.light(self.surface, self.lights)
    }
}

/// The normal of the hit on the side from which the ray came.
fn facing(hit: &Hit, direction: &Vector3<f64>) -> Vector3<f64> {
    if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal }
}
