//! A small ray caster: colour, depth, face ids and normals of a painted surface from any pinhole camera, in the light of sun, sky and lamps.
//!
//! ```
//! use paint_sim::nalgebra::{Point3, Vector3};
//! use paint_sim::render::{Coat, Lights, Shading, SunPosition};
//! use paint_sim::{Camera, TriangleSurface, render};
//!
//! # fn main() -> Result<(), paint_sim::Error> {
//! // A wall in the plane y = 0 that faces south, in Zurich, on the 21st of June 2026 at 10:00 UTC (x east, y north).
//! let wall = TriangleSurface::new(&[[-9.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 0.0, 9.0]], &[[0, 1, 2]])?;
//! let sun = SunPosition::new(1_782_036_000.0, 47.4_f64.to_radians(), 8.5_f64.to_radians())?;
//! let lights = Lights::daylight(sun.direction(), 3.0, 0.2)?.exposed_at(&Point3::origin(), 0.9)?;
//! let varnish = Some(Coat::new(0.1)?);
//! let camera = Camera::looking_at(&Point3::new(1.0, -4.0, 1.7), &Point3::new(0.0, 0.0, 2.0), &Vector3::z(), 1.0, (64, 48))?;
//! let picture = render(&wall, &camera, &|hit| Shading { coat: varnish, ..Shading::matt([0.5; 3], hit.normal) }, &lights, 2, 1)?;
//! println!("{:.1} % too bright", 100.0 * picture.clipped as f64 / picture.colour.len() as f64);
//! # Ok(())
//! # }
//! ```

mod band;
mod black_body;
mod camera;
mod coat;
mod lamp;
mod lights;
mod seen;
mod shading;
mod sky;
mod sun_position;
mod sunlight;

use self::band::{Band, BandRenderer};
pub use self::black_body::black_body;
pub use self::camera::Camera;
pub use self::coat::Coat;
pub use self::lamp::Lamp;
pub use self::lights::Lights;
pub use self::shading::Shading;
pub use self::sky::Sky;
pub use self::sun_position::SunPosition;
pub use self::sunlight::sunlight;
use crate::error::{Error, check_range};
use crate::surface::{Hit, Surface};
use crate::trace::span;

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
    /// Pixels whose colour was clipped, as they have more light than 1 in a channel.
    pub clipped: usize,
}

/// Renders `surface`; `shade` gives the shading of a hit, surfaces are two-sided.
///
/// Each pixel's colour is the mean of `supersampling`^2 rays on a regular grid, each with shadow rays towards sun and lamps;
/// depth, face and normal belong to the pixel's centre. The picture does not depend on `threads`.
///
/// A `GpuSurface` of [`crate::surface`] (feature `gpu`) as the surface casts all rays on a GPU, those of shadows too, large parts of the
/// picture at once; `shade` and the light stay on the processor. The picture is the same, to the last bit.
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
    lights.check()?;
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
        clipped: 0,
    };
    let edge = renderer.tile_edge();
    let mut bands: Vec<Band> = (0..height)
        .step_by(edge)
        .zip(frame.colour.chunks_mut(edge * width))
        .zip(frame.depth.chunks_mut(edge * width))
        .zip(frame.faces.chunks_mut(edge * width))
        .zip(frame.normals.chunks_mut(edge * width))
        .map(|((((top, colour), depth), faces), normals)| Band {
            top,
            width,
            colour,
            depth,
            faces,
            normals,
            clipped: 0,
        })
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
    frame.clipped = bands.iter().map(|band| band.clipped).sum();
    Ok(frame)
}
