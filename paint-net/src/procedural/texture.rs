//! The built-in textures.

use super::noise::{fbm, lattice, worley_distances};
use crate::image::Image;

/// The kinds of texture, as ink pictures in `[0, 0.95]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texture {
    /// Fractal noise: soft clouds.
    Fbm,
    /// Distances to scattered points: cells.
    Worley,
    /// A running bond with mottled stones and pale mortar.
    Brick,
    /// Bands that bend.
    Stripes,
    /// Fourteen strokes of a broad pen.
    Glyph,
}

impl Texture {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Fbm, Self::Worley, Self::Brick, Self::Stripes, Self::Glyph];

    /// The square texture of `n` pixels for a seed.
    pub fn image(self, seed: u64, n: usize) -> Image {
        let ink: Box<dyn Fn(f64, f64) -> f64> = match self {
            Self::Fbm => Box::new(move |x, y| 1.6 * fbm(seed, x / 32.0, y / 32.0, 5) - 0.3),
            Self::Worley => Box::new(move |x, y| worley(seed, x / 12.0, y / 12.0)),
            Self::Brick => Box::new(move |x, y| brick(seed, x, y)),
            Self::Stripes => Box::new(move |x, y| stripes(seed, x, y)),
            Self::Glyph => Box::new(move |x, y| glyph(seed, x, y, n as f64)),
        };
        Image::from_fn(n, n, |x, y| ink(x as f64, y as f64).clamp(0.0, 0.95))
    }
}

fn worley(seed: u64, x: f64, y: f64) -> f64 {
    1.0 - 1.1 * worley_distances(seed, x, y).0
}

fn brick(seed: u64, x: f64, y: f64) -> f64 {
    let row = (y / 16.0).floor();
    let shifted = x + 16.0 * row.rem_euclid(2.0);
    let mortar = y.rem_euclid(16.0) < 2.0 || shifted.rem_euclid(32.0) < 2.0;
    let stone = if mortar { 0.15 } else { 0.35 + 0.5 * lattice(seed, (shifted / 32.0).floor() as i64, row as i64) };
    stone + 0.3 * (fbm(seed.wrapping_add(1), x / 8.0, y / 8.0, 5) - 0.5)
}

fn stripes(seed: u64, x: f64, y: f64) -> f64 {
    let angle = std::f64::consts::PI * lattice(seed, 0, 0);
    let across = x * angle.cos() + y * angle.sin();
    let bend = 6.0 * fbm(seed.wrapping_add(1), x / 40.0, y / 40.0, 5);
    0.5 + 0.45 * (std::f64::consts::TAU * across / 14.0 + bend).sin()
}

fn glyph(seed: u64, x: f64, y: f64, n: f64) -> f64 {
    let mut distance = 1e9_f64;
    for k in 0..14 {
        let u = |m: i64| lattice(seed, k, m);
        let (ax, ay, bx, by) = (n * u(0), n * u(1), n * u(2), n * u(3));
        let (dx, dy) = (bx - ax, by - ay);
        let t = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy + 1e-9)).clamp(0.0, 1.0);
        distance = distance.min((x - ax - t * dx).hypot(y - ay - t * dy) - 2.0 - 5.0 * u(4));
    }
    let s = (0.5 - distance / 3.0).clamp(0.0, 1.0);
    0.9 * s * s * (3.0 - 2.0 * s)
}
