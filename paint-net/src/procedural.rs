//! Seeded textures: the training and test pictures of the painters, the same numbers on every machine.

mod scene;

use crate::image::Image;

pub use scene::scene;

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

/// A number in `[0, 1)` for a lattice point: the splitmix64 finaliser over seed and coordinates.
pub fn lattice(seed: u64, x: i64, y: i64) -> f64 {
    let mut z = seed
        .wrapping_add(0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(x.wrapping_add(1) as u64))
        .wrapping_add(0xC2B2_AE3D_27D4_EB4F_u64.wrapping_mul(y.wrapping_add(1) as u64));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Value noise in `[0, 1]`: lattice numbers blended by quintics, so that second derivatives are continuous.
pub fn value_noise(seed: u64, x: f64, y: f64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let blend = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    let (a, b) = (blend(x - i), blend(y - j));
    let (i, j) = (i as i64, j as i64);
    let row = |j: i64| lattice(seed, i, j) * (1.0 - a) + lattice(seed, i + 1, j) * a;
    row(j) * (1.0 - b) + row(j + 1) * b
}

/// Fractal sum of value noise in `[0, 1]`: every octave has twice the frequency and half the weight of the last. At least one
/// octave, at most 32.
pub fn fbm(seed: u64, x: f64, y: f64, octaves: u32) -> f64 {
    let octaves = octaves.clamp(1, 32);
    let sum: f64 = (0..octaves)
        .map(|o| {
            let scale = f64::from(1_u32 << o);
            value_noise(seed.wrapping_add(u64::from(o)), x * scale, y * scale) / scale
        })
        .sum();
    sum / (2.0 - 0.5_f64.powi(octaves as i32 - 1))
}

fn worley(seed: u64, x: f64, y: f64) -> f64 {
    1.0 - 1.1 * worley_distances(seed, x, y).0
}

/// Distances to the nearest and second nearest of one random point per unit square, and a number in `[0, 1)` of the nearest.
fn worley_distances(seed: u64, x: f64, y: f64) -> (f64, f64, f64) {
    let (mut nearest, mut next, mut of) = (9.0_f64, 9.0_f64, 0.0);
    for dx in -1..=1 {
        for dy in -1..=1 {
            let (i, j) = (x.floor() as i64 + dx, y.floor() as i64 + dy);
            let (px, py) = (i as f64 + lattice(seed, i, j), j as f64 + lattice(seed.wrapping_add(1), i, j));
            let distance = (x - px).hypot(y - py);
            if distance < nearest {
                (next, nearest, of) = (nearest, distance, lattice(seed.wrapping_add(2), i, j));
            } else {
                next = next.min(distance);
            }
        }
    }
    (nearest, next, of)
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
