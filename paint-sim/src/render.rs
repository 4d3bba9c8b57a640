//! A small ray caster: colour, depth, face ids and normals of a painted surface from any pinhole camera.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use crate::colour::encode_srgb8;
use crate::error::{Error, check_positive, check_range};
use crate::surface::{Hit, Surface};
use crate::trace::span;

/// Rays end here, m: beyond it there is only background.
const MAX_RAY_LENGTH: f64 = 1e4;

/// A pinhole camera with `OpenCV` axes: x right, y down, z forward. The centre of pixel (0, 0) has the image
/// coordinates (0, 0), so that a camera in the middle has `cx = (width - 1) / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Focal length in pixels along x.
    pub fx: f64,
    /// Focal length in pixels along y.
    pub fy: f64,
    /// Principal point, x, pixels.
    pub cx: f64,
    /// Principal point, y, pixels.
    pub cy: f64,
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Pose of the camera.
    pub world_from_camera: Isometry3<f64>,
}

impl Camera {
    /// A camera at `eye` that looks at `target`, with `up` upwards in the picture and the given horizontal opening angle.
    ///
    /// # Errors
    /// Numbers that are not finite, `target` at `eye`, a renderer along `up`, an angle outside 0..pi or an empty image.
    pub fn looking_at(
        eye: &Point3<f64>,
        target: &Point3<f64>,
        up: &Vector3<f64>,
        horizontal_angle: f64,
        (width, height): (u32, u32),
    ) -> Result<Self, Error> {
        check_range("horizontal angle of a camera", horizontal_angle, 1e-6, 3.1, "between 0 and 3.1 rad")?;
        let forward = target - eye;
        check_positive("distance from the eye to the target", forward.norm())?;
        check_positive("angle between the renderer and `up`", forward.cross(up).norm())?;
        // In OpenCV axes the picture's "up" is -y.
        let world_from_camera = Isometry3::face_towards(eye, target, &-up);
        let f = 0.5 * f64::from(width) / (0.5 * horizontal_angle).tan();
        let (cx, cy) = (0.5 * (f64::from(width) - 1.0), 0.5 * (f64::from(height) - 1.0));
        let camera = Self { fx: f, fy: f, cx, cy, width, height, world_from_camera };
        camera.check()?;
        Ok(camera)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_positive("camera.width", f64::from(self.width))?;
        check_positive("camera.height", f64::from(self.height))?;
        for (what, f) in [("camera.fx", self.fx), ("camera.fy", self.fy)] {
            // Some published calibrations mirror an axis by a negative focal length.
            check_positive(what, f.abs())?;
        }
        let pose = self.world_from_camera.to_homogeneous();
        if pose.iter().chain([self.cx, self.cy].iter()).all(|v| v.is_finite()) {
            Ok(())
        } else {
            Err(Error::NotFinite { what: "camera", index: 0 })
        }
    }

    /// Unit direction of the ray through image point (u, v) in the world, and its component along the optical axis.
    fn ray(&self, u: f64, v: f64) -> (Vector3<f64>, f64) {
        let direction = Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0);
        let norm = direction.norm();
        (self.world_from_camera.rotation * (direction / norm), 1.0 / norm)
    }
}

/// The light in the scene, linear RGB. A white surface that faces the sun appears as `sun + ambient`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lights {
    /// Unit vector towards the sun, world frame.
    pub towards_sun: UnitVector3<f64>,
    /// Light of the sun, linear RGB.
    pub sun: [f32; 3],
    /// Light from everywhere, linear RGB.
    pub ambient: [f32; 3],
    /// What is seen where there is no surface, linear RGB.
    pub background: [f32; 3],
}

impl Default for Lights {
    /// A high sun from the front right.
    fn default() -> Self {
        let towards_sun = UnitVector3::new_normalize(Vector3::new(0.3, -0.4, 0.87));
        Self { towards_sun, sun: [0.7; 3], ambient: [0.3; 3], background: [0.85, 0.9, 1.0] }
    }
}

/// How a point of the surface is shaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shading {
    /// Albedo, linear RGB.
    pub albedo: [f32; 3],
    /// Unit normal for the light, either side: the hit's own for facets, an interpolated one for smooth shading. Shadows and
    /// [`Frame::normals`] follow the geometry.
    pub normal: Vector3<f64>,
}

/// What a camera sees, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// sRGB, 0..=255.
    pub colour: Vec<[u8; 3]>,
    /// Depth along the optical axis (z, not the length of the ray) of the pixel's centre, m; 0 where there is nothing.
    pub depth: Vec<f32>,
    /// Triangle at the pixel's centre; `u32::MAX` where there is nothing.
    pub faces: Vec<u32>,
    /// Unit normal at the pixel's centre, world frame, turned towards the camera; zero where there is nothing.
    pub normals: Vec<[f32; 3]>,
}

/// Renders `surface`; `shade` gives the shading of a hit, surfaces are matt and two-sided.
///
/// Each pixel's colour is the mean of `supersampling`^2 rays on a regular grid, each with a shadow ray towards the sun;
/// depth, face and normal belong to the pixel's centre. The picture does not depend on `threads`.
///
/// # Errors
/// A camera or lights with numbers that are not finite, no pixels, `supersampling` outside 1..=16, no threads.
pub fn render(
    surface: &dyn Surface,
    camera: &Camera,
    shade: &(dyn Fn(&Hit) -> Shading + Sync),
    lights: &Lights,
    supersampling: u32,
    threads: usize,
) -> Result<Frame, Error> {
    span!("render");
    camera.check()?;
    check_range("supersampling", f64::from(supersampling), 1.0, 16.0, "between 1 and 16")?;
    check_range("threads", threads as f64, 1.0, 1024.0, "between 1 and 1024")?;
    let light = lights.sun.iter().chain(&lights.ambient).chain(&lights.background);
    if !(light.into_iter().all(|v| v.is_finite()) && lights.towards_sun.iter().all(|v| v.is_finite())) {
        return Err(Error::NotFinite { what: "light", index: 0 });
    }
    let renderer = RowRenderer { surface, camera, shade, lights, supersampling };
    let pixels = camera.width as usize * camera.height as usize;
    let mut frame = Frame {
        width: camera.width,
        height: camera.height,
        colour: vec![[0; 3]; pixels],
        depth: vec![0.0; pixels],
        faces: vec![u32::MAX; pixels],
        normals: vec![[0.0; 3]; pixels],
    };
    let width = camera.width as usize;
    let mut rows: Vec<Row> = (0..camera.height)
        .zip(frame.colour.chunks_mut(width))
        .zip(frame.depth.chunks_mut(width))
        .zip(frame.faces.chunks_mut(width))
        .zip(frame.normals.chunks_mut(width))
        .map(|((((v, colour), depth), faces), normals)| Row { v, colour, depth, faces, normals })
        .collect();
    if threads == 1 {
        for row in &mut rows {
            renderer.fill(row);
        }
    } else {
        let share = rows.len().div_ceil(threads);
        std::thread::scope(|scope| {
            for chunk in rows.chunks_mut(share) {
                scope.spawn(|| chunk.iter_mut().for_each(|row| renderer.fill(row)));
            }
        });
    }
    Ok(frame)
}

/// One row of the frame, so that threads can own what they write.
struct Row<'a> {
    v: u32,
    colour: &'a mut [[u8; 3]],
    depth: &'a mut [f32],
    faces: &'a mut [u32],
    normals: &'a mut [[f32; 3]],
}

struct RowRenderer<'a> {
    surface: &'a dyn Surface,
    camera: &'a Camera,
    shade: &'a (dyn Fn(&Hit) -> Shading + Sync),
    lights: &'a Lights,
    supersampling: u32,
}

impl RowRenderer<'_> {
    fn fill(&self, row: &mut Row) {
        for column in 0..row.colour.len() {
            let (u, v) = (column as f64, f64::from(row.v));
            let (direction, cosine) = self.camera.ray(u, v);
            let hit = self.cast(&direction);
            if let Some(hit) = &hit {
                row.depth[column] = (hit.distance * cosine) as f32;
                row.faces[column] = hit.face;
                row.normals[column] = facing(hit, &direction).map(|v| v as f32).into();
            }
            let linear = if self.supersampling == 1 { self.light(hit.as_ref(), &direction) } else { self.mean(u, v) };
            row.colour[column] = linear.map(|v| encode_srgb8(f64::from(v)).0);
        }
    }

    fn cast(&self, direction: &Vector3<f64>) -> Option<Hit> {
        let eye = Point3::from(self.camera.world_from_camera.translation.vector);
        self.surface.cast(&eye, direction, MAX_RAY_LENGTH)
    }

    /// Mean light over a regular grid of rays inside the pixel.
    fn mean(&self, u: f64, v: f64) -> [f32; 3] {
        let n = self.supersampling;
        let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
        let mut sum = [0.0_f32; 3];
        for i in 0..n * n {
            let (direction, _) = self.camera.ray(u + offset(i % n), v + offset(i / n));
            let light = self.light(self.cast(&direction).as_ref(), &direction);
            sum = std::array::from_fn(|c| sum[c] + light[c]);
        }
        sum.map(|total| total / (n * n) as f32)
    }

    fn light(&self, hit: Option<&Hit>, direction: &Vector3<f64>) -> [f32; 3] {
        let Some(hit) = hit else { return self.lights.background };
        let Shading { albedo, normal: shading } = (self.shade)(hit);
        let normal = facing(hit, direction);
        let towards_sun = self.lights.towards_sun.as_ref();
        let lit_side = if shading.dot(&normal) < 0.0 { -shading } else { shading };
        let mut cosine = lit_side.dot(towards_sun).max(0.0) as f32;
        if cosine > 0.0 {
            let eye = self.camera.world_from_camera.translation.vector;
            // Off the surface by more than the rounding of the hit, or it would shade itself.
            let start = Point3::from(eye + direction * hit.distance + normal * (1e-6 * (1.0 + hit.distance)));
            if self.surface.occluded(&start, towards_sun, MAX_RAY_LENGTH) {
                cosine = 0.0;
            }
        }
        std::array::from_fn(|c| albedo[c] * (self.lights.sun[c] * cosine + self.lights.ambient[c]))
    }
}

/// The normal of the hit on the side from which the ray came.
fn facing(hit: &Hit, direction: &Vector3<f64>) -> Vector3<f64> {
    if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal }
}
