//! A small ray caster: colour, depth, face ids and normals of a painted surface from any pinhole camera.

mod band;
mod camera;
mod lights;

use self::band::{Band, BandRenderer};
pub use self::camera::Camera;
pub use self::lights::{Lights, Shading};
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
