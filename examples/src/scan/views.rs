//! Pictures of a map: beside what the camera recorded, and from outside.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, Vector3};
use paint_sim::render::{Frame, Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, TriangleSurface, render};
use tsdf_hash::mesh::Mesh;

use super::decode::Images;
use super::error::ScanError;
use super::mapped::Scan;
use super::sequence::Sequence;
use crate::pictures::Rgb;

/// How far behind the middle camera the overview stands, metres.
const BEHIND: f64 = 1.2;
/// How far above it, metres.
const ABOVE: f64 = 0.6;
/// Samples per pixel and direction.
const SMOOTH: u32 = 2;

/// Writes `views.png`, recorded picture, coloured mesh, shaded mesh and their overview, into a folder.
pub(super) fn save_views(scan: &Scan, sequence: &Sequence, folder: &Path, threads: usize) -> Result<(), ScanError> {
    let Some(&(middle, world_from_camera)) = scan.fused.get(scan.fused.len() / 2) else { return Ok(()) };
    if scan.mesh.faces.is_empty() {
        return Ok(());
    }
    let images = Images::read(&sequence.frames[middle])?;
    let k = sequence.intrinsics;
    let (width, height) = (images.width() as u32, images.height() as u32);
    let here = Camera { fx: k.fx, fy: k.fy, cx: k.cx, cy: k.cy, width, height, world_from_camera };
    let surface = TriangleSurface::new(&scan.mesh.positions, &scan.mesh.faces)?;
    // Even light, and what is shaded is shaded here: a lamp would throw shadows from behind the picture.
    let lights = Lights { sun: [0.0; 3], ambient: [1.0; 3], ..Lights::default() };
    let seen = |camera: &Camera, colours: bool| -> Result<Rgb, ScanError> {
        let towards_camera = camera.world_from_camera * -Vector3::z();
        let shade = |hit: &Hit| shading(&scan.mesh, hit, (!colours).then_some(&towards_camera));
        Ok(picture(&render(&surface, camera, &shade, &lights, SMOOTH, threads)?))
    };
    // The picture's "up" is -y, or +y where the focal length is negative.
    let up = -k.fy.signum() * ABOVE;
    let back = Isometry3::from_parts(
        Translation3::new(0.0, up, -BEHIND),
        nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), up.signum() * (ABOVE / 3.0).atan()),
    );
    let behind = Camera { world_from_camera: world_from_camera * back, ..here };
    let recorded = images.picture();
    let quarters = [recorded, seen(&here, true)?, seen(&here, false)?, seen(&behind, true)?];
    four(&quarters).save(&folder.join("views.png"))?;
    Ok(())
}
/// The mesh in its own colours, or in grey by the angle to `lamp`.
fn shading(mesh: &Mesh, hit: &Hit, lamp: Option<&Vector3<f64>>) -> Shading {
    let [a, b, c] = mesh.faces[hit.face as usize].map(|vertex| vertex as usize);
    let [s, t] = hit.barycentric.map(|w| w as f32);
    let blend = |of: &dyn Fn(usize) -> [f32; 3]| -> [f32; 3] {
        let [a, b, c] = [a, b, c].map(of);
        std::array::from_fn(|k| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]))
    };
    let normal = Vector3::from(blend(&|v| mesh.normals[v])).map(f64::from).normalize();
    let albedo = match lamp {
        None => blend(&|v| mesh.colours[v].map(linear)),
        Some(lamp) => [(0.05 + 0.75 * normal.dot(lamp).max(0.0)) as f32; 3],
    };
    Shading::matt(albedo, normal)
}

/// Linear light of an 8-bit sRGB value.
fn linear(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn picture(frame: &Frame) -> Rgb {
    Rgb::from_pixels(frame.width as usize, frame.height as usize, frame.colour.iter().copied())
}

/// Four pictures of one size in a square.
fn four(quarters: &[Rgb; 4]) -> Rgb {
    let (width, height) = (quarters[0].width as usize, quarters[0].height as usize);
    let at = |x: usize, y: usize| {
        let quarter = &quarters[usize::from(x >= width) + 2 * usize::from(y >= height)];
        let start = 3 * ((y % height) * width + x % width);
        [quarter.data[start], quarter.data[start + 1], quarter.data[start + 2]]
    };
    let pixels = (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| (x, y)));
    Rgb::from_pixels(2 * width, 2 * height, pixels.map(|(x, y)| at(x, y)))
}
