//! Seeded noise functions of the plane.

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A number in `[0, 1)` for a lattice point: the first of the splitmix64 stream that seed and coordinates start.
pub fn lattice(seed: u64, x: i64, y: i64) -> f64 {
    let start = seed
        .wrapping_add(0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(x as u64))
        .wrapping_add(0xC2B2_AE3D_27D4_EB4F_u64.wrapping_mul(y.wrapping_add(1) as u64));
    (SplitMix64::seed_from_u64(start).next_u64() >> 11) as f64 / (1_u64 << 53) as f64
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

/// Distances to the nearest and second nearest of one random point per unit square, and a number in `[0, 1)` of the nearest.
pub(super) fn worley_distances(seed: u64, x: f64, y: f64) -> (f64, f64, f64) {
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
