//! Grey images of rough stone, and their depth.

use nalgebra::{Isometry3, Matrix3, UnitQuaternion, UnitVector3, Vector3};
use paint_net::procedural::{lattice, value_noise};
use paint_sim::flight::FlightSample;
use paint_sim::render::{Frame, Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Error, TriangleSurface, render};
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
use vio_ekf::camera::Distortion;
use vio_ekf::{Camera, ImageView};

use super::painted_front::PaintedFront;

/// Images per second.
pub const FRAMES_PER_SECOND: f64 = 20.0;
/// Size of an image and its focal length, pixels: half of the EuRoC vehicle's.
const IMAGE: (usize, usize, f64) = (376, 240, 229.0);
/// Tangents of half of the angles of view, to the side and up.
pub const HALF_VIEW: [f64; 2] = [IMAGE.0 as f64 / (2.0 * IMAGE.2), IMAGE.1 as f64 / (2.0 * IMAGE.2)];
/// Standard deviation of a pixel's noise, grey levels.
const GREY_NOISE: f64 = 2.0;
/// Standard deviation of a depth at distance z: `a + b (z - 0.4)²`, metres (Nguyen, Izadi, Lovell 2012).
const DEPTH_NOISE: [f64; 2] = [0.0012, 0.0019];
/// (lattice spacing in metres, share of the contrast) of the stone's mottling, coarse to fine.
const TEXTURE_OCTAVES: [(f64, f64); 5] = [(0.35, 0.25), (0.12, 0.25), (0.05, 0.3), (0.025, 0.25), (0.012, 0.15)];

/// The robot's camera, with the depth of every pixel, before a surface.
#[derive(Clone)]
pub struct SimulatedCamera<'a> {
    /// Lens, and place on the body.
    pub camera: Camera,
    surface: &'a TriangleSurface,
    lights: Lights,
    seed: u64,
    threads: usize,
    paint: Option<PaintedFront>,
}

/// One image.
#[derive(Clone)]
pub struct SimulatedImage {
    grey: Vec<u8>,
    /// Along the optical axis, metres; 0 where there is nothing.
    depth: Vec<f32>,
}

impl SimulatedImage {
    /// Without light.
    pub fn darken(&mut self) {
        self.grey.fill(0);
    }

    /// For the odometry.
    pub fn grey(&self) -> ImageView<'_> {
        ImageView { width: IMAGE.0, height: IMAGE.1, data: &self.grey }
    }
}

/// Depth and colour as the map takes them.
pub struct RgbdViews<'a> {
    depth: &'a [f32],
    rgb: Vec<u8>,
    intrinsics: Intrinsics,
}

impl RgbdViews<'_> {
    /// Depth.
    pub fn depth(&self) -> DepthView<'_> {
        let (data, (width, height, _)) = (DepthData::F32 { data: self.depth }, IMAGE);
        DepthView { width, height, data, intrinsics: self.intrinsics }
    }

    /// Colour, registered to depth.
    pub fn colour(&self) -> ColourView<'_> {
        let (data, (width, height, _)) = (ColourData::Rgb8(&self.rgb), IMAGE);
        ColourView { width, height, data, intrinsics: self.intrinsics }
    }
}

impl<'a> SimulatedCamera<'a> {
    /// `towards`: from the robot to the surface.
    pub fn new(surface: &'a TriangleSurface, towards: Vector3<f64>, seed: u64, threads: usize) -> Self {
        // Light from everywhere; the sun is behind the surface and costs no shadows.
        let towards_sun = UnitVector3::new_normalize(towards);
        let lights =
            Lights { towards_sun, sun: [0.0; 3], ambient: [1.0; 3], background: [0.2; 3], ..Lights::default() };
        Self { camera: camera(), surface, lights, seed, threads, paint: None }
    }

    /// With paint on the surface, which it sees as it is sprayed.
    #[must_use]
    pub fn before(self, paint: PaintedFront) -> Self {
        Self { paint: Some(paint), ..self }
    }

    /// The paint that is on the surface.
    pub fn into_paint(self) -> Option<PaintedFront> {
        self.paint
    }

    /// A sample of the flight with the paint that leaves the nozzle until the next one, `interval` seconds later.
    pub fn spray(&mut self, sample: &FlightSample, interval: f64) {
        if let Some(paint) = &mut self.paint {
            paint.fly(sample, interval);
        }
    }

    /// An image of it for the map.
    pub fn views<'i>(&self, image: &'i SimulatedImage) -> RgbdViews<'i> {
        let Camera { fx, fy, cx, cy, .. } = self.camera;
        let rgb = image.grey.iter().flat_map(|grey| [*grey; 3]).collect();
        RgbdViews { depth: &image.depth, rgb, intrinsics: Intrinsics { fx, fy, cx, cy } }
    }

    /// Image `index`, taken from a pose.
    pub fn capture(&mut self, index: usize, world_from_camera: &Isometry3<f64>) -> Result<SimulatedImage, Error> {
        if let Some(paint) = &mut self.paint {
            paint.land(self.surface, self.threads)?;
        }
        let shade = |hit: &Hit| Shading::matt([self.albedo(hit) as f32; 3], hit.normal);
        let mut frame = self.render(world_from_camera, &shade)?;
        let grey = frame.colour.iter().enumerate().map(|(pixel, colour)| {
            let noisy = f64::from(colour[0]) + GREY_NOISE * self.noise(2 * index, pixel);
            noisy.round().clamp(0.0, 255.0) as u8
        });
        let grey = grey.collect();
        for (pixel, depth) in frame.depth.iter_mut().enumerate().filter(|(_, depth)| **depth > 0.0) {
            let z = f64::from(*depth);
            let sigma = DEPTH_NOISE[0] + DEPTH_NOISE[1] * (z - 0.4) * (z - 0.4);
            *depth = (z + sigma * self.noise(2 * index + 1, pixel)) as f32;
        }
        Ok(SimulatedImage { grey, depth: frame.depth })
    }

    fn render(
        &self,
        world_from_camera: &Isometry3<f64>,
        shade: &(dyn Fn(&Hit) -> Shading + Sync),
    ) -> Result<Frame, Error> {
        let Camera { width, height, fx, fy, cx, cy, .. } = self.camera;
        let (width, height) = (width as u32, height as u32);
        let camera = paint_sim::Camera { fx, fy, cx, cy, width, height, world_from_camera: *world_from_camera };
        render(self.surface, &camera, shade, &self.lights, 1, self.threads)
    }

    /// Albedo of the stone, noise in the plane that the surface is most nearly in, with the paint that is on it.
    fn albedo(&self, hit: &Hit) -> f64 {
        let p = self.surface.point(hit).unwrap_or_default();
        let (u, v) = match hit.normal.abs().imax() {
            0 => (p.y, p.z),
            1 => (p.x, p.z),
            _ => (p.x, p.y),
        };
        let octave = |(k, (spacing, share)): (usize, (f64, f64))| {
            share * (value_noise(self.seed.wrapping_add(101 * k as u64), u / spacing, v / spacing) - 0.5)
        };
        let stone = (0.35 + TEXTURE_OCTAVES.into_iter().enumerate().map(octave).sum::<f64>()).clamp(0.02, 0.9);
        self.paint.as_ref().map_or(stone, |paint| paint.albedo(&p, stone))
    }

    /// A number of the standard normal distribution for a pixel of an image.
    fn noise(&self, image: usize, pixel: usize) -> f64 {
        let uniform = |half: i64| lattice(self.seed ^ 0x5EE5, image as i64, 2 * pixel as i64 + half);
        (-2.0 * (1.0 - uniform(0)).ln()).sqrt() * (std::f64::consts::TAU * uniform(1)).cos()
    }
}

/// Looks ahead along the body's x axis, z up.
fn camera() -> Camera {
    let (width, height, focal) = IMAGE;
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = UnitQuaternion::from_matrix(&axes);
    Camera {
        width,
        height,
        fx: focal,
        fy: focal,
        cx: (width as f64 - 1.0) / 2.0,
        cy: (height as f64 - 1.0) / 2.0,
        distortion: Distortion::None,
        body_from_camera: Isometry3::from_parts(Vector3::new(0.12, 0.0, 0.02).into(), rotation),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector2};

    use super::*;

    #[test]
    fn the_camera_looks_ahead_with_the_sky_above() {
        let camera = camera();
        let see = |point_in_body: Point3<f64>| {
            camera.project(&(camera.body_from_camera.inverse() * point_in_body).coords).unwrap_or(Vector2::repeat(-1.0))
        };
        let ahead = see(Point3::new(3.0, 0.0, 0.02));
        assert!((ahead - Vector2::new(187.5, 119.5)).norm() < 1e-9);
        assert!(see(Point3::new(3.0, 0.5, 0.02)).x < ahead.x, "what is on the left is on the left");
        assert!(see(Point3::new(3.0, 0.0, 0.5)).y < ahead.y, "what is above is above");
    }
}
