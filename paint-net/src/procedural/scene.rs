//! Random scenes for training.

use super::noise::{fbm, lattice, worley_distances};
use crate::image::Image;

/// Kinds of scenes. Bricks, `Texture::Brick`, are not among them: they are kept to test with.
const KINDS: usize = 9;

/// Numbers of one scene, drawn in order.
struct Draw {
    seed: u64,
    count: i64,
}

impl Draw {
    fn unit(&mut self) -> f64 {
        self.count += 1;
        lattice(self.seed, self.count, -7)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Evenly distributed in the logarithm.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }
}

/// A random picture for training: clouds, cells, cracks, strata, stripes, strokes, leaves, gradients or filtered noise, at a
/// random scale, turned, inverted and of random contrast; ink in `[0, 0.98]`. Bricks are not among them: they are kept to
/// test with.
pub fn scene(seed: u64, width: usize, height: usize) -> Image {
    let mut draw = Draw { seed, count: 0 };
    let kind = (draw.unit() * KINDS as f64) as usize;
    let angle = draw.between(0.0, std::f64::consts::TAU);
    let (cos, sin) = (angle.cos(), angle.sin());
    let middle = (0.5 * width as f64, 0.5 * height as f64);
    let ink = ink_of(kind, &mut draw, width.max(height) as f64);
    let mut image = Image::from_fn(width, height, |x, y| {
        let (x, y) = (x as f64 - middle.0, y as f64 - middle.1);
        ink(cos * x - sin * y, sin * x + cos * y)
    });
    // Fine grain, as a photograph of a rough surface has it.
    let grain = if draw.unit() < 0.5 { draw.between(0.0, 0.25) } else { 0.0 };
    let lumps = draw.scale(0.8, 6.0);
    let (power, invert) = (draw.scale(0.6, 1.7), draw.unit() < 0.5);
    let (low, high) = (draw.between(0.0, 0.35), draw.between(0.6, 1.0));
    for (k, v) in image.data_mut().iter_mut().enumerate() {
        let (x, y) = ((k % width) as f64, (k / width) as f64);
        let rough = if grain > 0.0 { grain * (2.0 * fbm(seed ^ 1, x / lumps, y / lumps, 2) - 1.0) } else { 0.0 };
        let t = (*v + rough).clamp(0.0, 1.0).powf(power);
        let t = low + (high - low) * if invert { 1.0 - t } else { t };
        *v = if kind == GLYPHS && !invert { t - low } else { t }.clamp(0.0, 0.98);
    }
    image
}

/// Strokes are the one kind that may leave the wall bare.
const GLYPHS: usize = 5;

/// Ink in `[0, 1]` over the plane, origin in the middle of the picture.
fn ink_of(kind: usize, draw: &mut Draw, size: f64) -> Box<dyn Fn(f64, f64) -> f64> {
    let seed = draw.seed.wrapping_mul(3);
    match kind {
        // Clouds.
        0 => {
            let scale = draw.scale(3.0, 48.0);
            let contrast = draw.between(1.4, 2.6);
            Box::new(move |x, y| 0.5 + contrast * (fbm(seed, x / scale, y / scale, 5) - 0.5))
        }
        // Cells, and pebbles with dark joints.
        1 | 2 => {
            let (scale, joint) = (draw.scale(4.0, 24.0), draw.between(0.05, 0.5));
            let pebbles = kind == 2;
            Box::new(move |x, y| {
                let (near, next, cell) = worley_distances(seed, x / scale, y / scale);
                if pebbles { (0.3 + 0.7 * cell) * ((next - near) / joint).min(1.0) } else { 1.0 - 1.1 * near }
            })
        }
        // Strata: bands of their own ink, bent.
        3 => {
            let (scale, bend, reach) = (draw.scale(3.0, 16.0), draw.between(0.0, 3.0), draw.scale(16.0, 64.0));
            Box::new(move |x, y| {
                let depth = y / scale + bend * fbm(seed, x / reach, y / reach, 3);
                0.8 * fbm(seed ^ 5, 0.3, depth, 3) + 0.5 * lattice(seed, 0, depth.floor() as i64) - 0.1
            })
        }
        // Stripes of a sine.
        4 => {
            let (period, bend, reach) = (draw.scale(3.0, 24.0), draw.between(0.0, 8.0), draw.scale(16.0, 64.0));
            Box::new(move |x, y| {
                0.5 + 0.5 * (std::f64::consts::TAU * x / period + bend * fbm(seed, x / reach, y / reach, 4)).sin()
            })
        }
        GLYPHS => glyphs(draw, size),
        6 => leaves(draw, size),
        // Gradients with a few edges.
        7 => {
            let (reach, slope) = (draw.scale(32.0, 200.0), draw.between(-1.0, 1.0) / size);
            let edge = draw.between(-0.3, 0.3) * size;
            let jump = draw.between(-0.6, 0.6);
            Box::new(move |x, y| {
                0.5 + slope * x + 0.6 * (fbm(seed, x / reach, y / reach, 1) - 0.5) + if y > edge { jump } else { 0.0 }
            })
        }
        // Filtered noise: grass and gravel.
        _ => {
            let (across, along) = (draw.scale(0.9, 5.0), draw.scale(0.9, 8.0));
            let contrast = draw.between(0.8, 1.8);
            Box::new(move |x, y| {
                0.5 + contrast
                    * (0.7 * fbm(seed, x / across, y / along, 1) + 0.3 * fbm(seed, x / 17.0, y / 17.0, 2) - 0.5)
            })
        }
    }
}

/// Strokes of a broad pen with soft ends.
fn glyphs(draw: &mut Draw, size: f64) -> Box<dyn Fn(f64, f64) -> f64> {
    let count = (draw.between(3.0, 16.0) * (size / 64.0).powi(2)).min(64.0) as usize;
    let strokes: Vec<[f64; 5]> = (0..count)
        .map(|_| {
            let (x, y) = (draw.between(-0.7, 0.7) * size, draw.between(-0.7, 0.7) * size);
            let (dx, dy) = (draw.between(-30.0, 30.0), draw.between(-30.0, 30.0));
            [x, y, dx, dy, draw.between(0.8, 6.0)]
        })
        .collect();
    let soft = draw.between(0.5, 3.0);
    Box::new(move |x, y| {
        let distance = strokes.iter().fold(1e9_f64, |least, &[ax, ay, dx, dy, half]| {
            let t = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy + 1e-9)).clamp(0.0, 1.0);
            least.min((x - ax - t * dx).hypot(y - ay - t * dy) - half)
        });
        let s = (0.5 - distance / soft).clamp(0.0, 1.0);
        s * s * (3.0 - 2.0 * s)
    })
}

/// Discs of all sizes lying over each other: the edges and plains of photographs (the dead leaves of Matheron 1968, with
/// radii distributed as `r⁻³`).
fn leaves(draw: &mut Draw, size: f64) -> Box<dyn Fn(f64, f64) -> f64> {
    let (smallest, shade) = (draw.between(1.5, 4.0), draw.between(0.0, 0.5));
    let count = (300.0 * (size / 64.0).powi(2)).min(2000.0) as usize;
    let discs: Vec<[f64; 4]> = (0..count)
        .map(|_| {
            // Inverse of the distribution function between the smallest radius and a third of the picture.
            let (a, b) = (smallest.powi(-2), (0.33 * size).powi(-2));
            let radius = (a - draw.unit() * (a - b)).powf(-0.5);
            [draw.between(-0.75, 0.75) * size, draw.between(-0.75, 0.75) * size, radius, draw.unit()]
        })
        .collect();
    let seed = draw.seed;
    Box::new(move |x, y| {
        let top = discs.iter().find(|[cx, cy, r, _]| (x - cx).powi(2) + (y - cy).powi(2) < r * r);
        top.map_or(0.5, |[cx, _, r, ink]| ink + shade * (x - cx) / r * (ink - 0.5))
            + 0.1 * shade * (fbm(seed ^ 3, x / 3.0, y / 3.0, 2) - 0.5)
    })
}
