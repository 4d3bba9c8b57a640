//! Lines in a rendered scene, hidden where the scene is in front.

use std::path::Path;

use nalgebra::Point3;

use super::{PictureError, Rgb};

/// A rendered picture with its depth, and the way points come into it.
pub struct Scene<'a> {
    /// The picture.
    pub picture: Rgb,
    /// Depth along the optical axis per pixel in metres, 0 where nothing was hit.
    pub depth: &'a [f32],
    /// Where a world point comes to lie.
    pub project: &'a Projection<'a>,
}

/// Pixel coordinates and depth of a world point; `None` behind the camera.
pub type Projection<'a> = dyn Fn(&Point3<f64>) -> Option<(f64, f64, f64)> + 'a;

/// A path in the world.
pub struct Polyline {
    /// Its points, metres.
    pub points: Vec<Point3<f64>>,
    /// Line colour.
    pub colour: [u8; 3],
    /// Radius of the pen in pixels.
    pub radius: f64,
}

/// A point counts as hidden when the surface is nearer than it by more than this, metres.
const HIDDEN_BY: f64 = 0.02;

/// Draws the paths into the picture, faint where the surface hides them, and saves it.
pub fn save_scene(path: &Path, mut scene: Scene, lines: &[Polyline]) -> Result<(), PictureError> {
    for line in lines {
        for pair in line.points.windows(2) {
            let (Some(a), Some(b)) = ((scene.project)(&pair[0]), (scene.project)(&pair[1])) else { continue };
            let steps = (b.0 - a.0).hypot(b.1 - a.1).ceil().clamp(1.0, 4000.0) as usize;
            for k in 0..=steps {
                let t = k as f64 / steps as f64;
                let mix = |p: f64, q: f64| p + t * (q - p);
                dot(&mut scene, mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2), line);
            }
        }
    }
    scene.picture.save(path)
}

/// One round dot of the pen, with a soft rim.
fn dot(scene: &mut Scene, x: f64, y: f64, depth: f64, line: &Polyline) {
    let reach = line.radius.ceil() as i64 + 1;
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (px, py) = (x.round() as i64 + dx, y.round() as i64 + dy);
            if px < 0 || py < 0 || px >= i64::from(scene.picture.width) || py >= i64::from(scene.picture.height) {
                continue;
            }
            let distance = (px as f64 - x).hypot(py as f64 - y);
            let cover = (line.radius + 0.5 - distance).clamp(0.0, 1.0);
            let pixel = (py * i64::from(scene.picture.width) + px) as usize;
            let surface = f64::from(scene.depth[pixel]);
            let alpha = if surface > 0.0 && surface < depth - HIDDEN_BY { 0.12 * cover } else { cover };
            for (channel, &ink) in line.colour.iter().enumerate() {
                let value = &mut scene.picture.data[3 * pixel + channel];
                *value = (f64::from(*value) * (1.0 - alpha) + f64::from(ink) * alpha).round() as u8;
            }
        }
    }
}
