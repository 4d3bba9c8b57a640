//! A small ray caster: colour, depth, face ids and normals of a painted surface from any pinhole camera.

mod band;

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use self::band::{Band, BandRenderer};
use crate::error::{Error, check_positive, check_range};
use crate::surface::{Hit, Surface};
use crate::trace::span;

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
    let renderer = BandRenderer { surface, camera, shade, lights, supersampling };
    let (width, height) = (camera.width as usize, camera.height as usize);
    let pixels = width * height;
    let mut frame = Frame {
        width: camera.width,
        height: camera.height,
        colour: vec![[0; 3]; pixels],
        depth: vec![0.0; pixels],
        faces: vec![u32::MAX; pixels],
        normals: vec![[0.0; 3]; pixels],
    };
    let edge = renderer.tile_edge();
    let mut bands: Vec<Band> = (0..height)
        .step_by(edge)
        .zip(frame.colour.chunks_mut(edge * width))
        .zip(frame.depth.chunks_mut(edge * width))
        .zip(frame.faces.chunks_mut(edge * width))
        .zip(frame.normals.chunks_mut(edge * width))
        .map(|((((top, colour), depth), faces), normals)| Band { top, width, colour, depth, faces, normals })
        .collect();
    if threads == 1 {
        for band in &mut bands {
            renderer.fill(band);
        }
    } else {
        let share = bands.len().div_ceil(threads);
        std::thread::scope(|scope| {
            for chunk in bands.chunks_mut(share) {
                scope.spawn(|| chunk.iter_mut().for_each(|band| renderer.fill(band)));
            }
        });
    }
    Ok(frame)
}
