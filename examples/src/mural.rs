//! The built-in mural: a lake below mountains, at sunset.

use paint_net::procedural::{fbm, lattice, value_noise};
use paint_sim::colour::decode_srgb;

/// Stored sRGB, 0 to 1.
type Stored = [f64; 3];

/// Where things end, shares of the height from the top.
const SHORE: f64 = 0.64;
const BANK: f64 = 0.86;
/// The sky from the top to the shore.
const SKY: [(f64, u32); 6] =
    [(0.0, 0x2c_4a8f), (0.16, 0x5c_62ac), (0.32, 0xb9_7fae), (0.44, 0xee_9a80), (0.54, 0xfb_c675), (SHORE, 0xfd_e6ae)];
/// Ridges from the farthest to the nearest: how high they begin, how high they reach, how wide a mountain is, colours of crest and foot.
const RIDGES: [(f64, f64, f64, u32, u32); 3] = [
    (0.60, 0.25, 0.50, 0x8f_7bb4, 0xd8_a0a8),
    (0.625, 0.17, 0.36, 0x5f_66a6, 0xb0_8aae),
    (0.645, 0.12, 0.25, 0x35_5b86, 0x66_86a4),
];

/// A landscape. Its parts lie anew for every seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mural {
    /// Which one.
    pub seed: u64,
}

impl Mural {
    /// Linear sRGB at `(x, y)` metres from the upper left corner of a wall of this width and height.
    pub fn colour(&self, [x, y]: [f64; 2], [width, height]: [f64; 2]) -> [f64; 3] {
        // Lengths in heights of the wall.
        let (x, v, wide) = (x / height, y / height, width / height);
        let scene = Scene { seed: self.seed, wide, sun: [wide * (0.56 + 0.2 * lattice(self.seed, 0, 7)), 0.41] };
        scene.at(x, v).map(decode_srgb)
    }
}

struct Scene {
    seed: u64,
    wide: f64,
    sun: [f64; 2],
}

impl Scene {
    fn at(&self, x: f64, v: f64) -> Stored {
        let land = if v < SHORE { self.above_shore(x, v) } else { self.lake(x, v) };
        self.bank(x, v, self.birds(x, v, land))
    }

    fn above_shore(&self, x: f64, v: f64) -> Stored {
        let mut colour = self.sky(x, v);
        for (k, (from, rise, period, crest, foot)) in RIDGES.into_iter().enumerate() {
            let top = from - rise * self.ridge(k as u64, x / period);
            let haze = smoothstep((v - top) / (SHORE + 0.02 - top));
            colour = mix(colour, mix(stored(crest), stored(foot), haze), edge(v - top, 0.006));
        }
        colour
    }

    fn sky(&self, x: f64, v: f64) -> Stored {
        let mut colour = gradient(&SKY, v);
        let [dx, dy] = [x - self.sun[0], v - self.sun[1]];
        let distance = dx.hypot(dy);
        colour = mix(colour, stored(0xff_db8c), 0.75 * (-(distance / 0.2).powi(2)).exp());
        // Long clouds, lit from below where the sun is near.
        let drift = fbm(self.seed ^ 0xC10D, x / 0.75, v / 0.13, 4) - 0.5;
        let high = smoothstep(v / 0.06) * smoothstep((0.5 - v) / 0.16);
        let cloud = smoothstep((drift - 0.03) / 0.16) * high;
        let lit =
            mix(stored(0x93_77b2), stored(0xff_c79a), smoothstep((v + 0.5 * (-(dx / 0.8).powi(2)).exp() - 0.2) / 0.5));
        colour = mix(colour, lit, 0.8 * cloud);
        mix(colour, stored(0xff_e2a0), edge(0.1 - distance, 0.008))
    }

    /// Height of a ridge, 0 to 1: peaks with shoulders.
    fn ridge(&self, layer: u64, x: f64) -> f64 {
        let seed = self.seed ^ (0xA1D5 + layer);
        let peak = |x: f64, salt: u64| 1.0 - (2.0 * value_noise(seed ^ salt, x, 0.5) - 1.0).abs();
        let height = 0.62 * peak(x, 1) + 0.26 * peak(2.3 * x, 2) + 0.12 * peak(5.1 * x, 3);
        // A valley where the sun stands.
        let valley = (-((x * RIDGES[layer as usize].2 - self.sun[0]) / 0.3).powi(2)).exp();
        height.clamp(0.0, 1.0).powf(1.4) * (1.0 - 0.45 * valley)
    }

    /// What stands above the shore, upside down, drawn out by ripples that grow towards the bank.
    fn lake(&self, x: f64, v: f64) -> Stored {
        let depth = v - SHORE;
        let ripple = value_noise(self.seed ^ 0x21B1, x / 0.22, v / 0.022) - 0.5;
        let mirrored =
            self.above_shore(x + 0.05 * ripple * depth / 0.2, (SHORE - 1.15 * depth + 0.05 * ripple).clamp(0.0, SHORE));
        let water = mix(mirrored, stored(0x2e_5f96), 0.15 + 0.45 * depth);
        // The way of the sun's light on the water.
        let glitter = (-((x - self.sun[0]) / (0.06 + 0.35 * depth)).powi(2)).exp() * smoothstep((ripple + 0.15) / 0.3);
        mix(water, stored(0xff_dc9a), 0.85 * glitter)
    }

    fn birds(&self, x: f64, v: f64, behind: Stored) -> Stored {
        let mut colour = behind;
        for k in 0..5 {
            let of = |salt: i64| lattice(self.seed ^ 0xB12D, k, salt);
            let [cx, cy] = [self.wide * 0.2 + 0.16 * k as f64 + 0.06 * of(0), 0.2 + 0.1 * of(1) + 0.02 * k as f64];
            let span = 0.05 + 0.02 * of(2);
            let along = ((x - cx) / span).abs();
            let wing = cy - 0.9 * span * (along - 0.75 * along * along);
            let inside = edge(0.009 * (1.25 - along) - (v - wing).abs(), 0.005);
            colour = mix(colour, stored(0x2a_2f55), 0.9 * inside);
        }
        colour
    }

    /// The near bank with its firs: meadow where the light falls, dark below.
    fn bank(&self, x: f64, v: f64, behind: Stored) -> Stored {
        let top = self.bank_top(x);
        let colour = self.firs(x, v, top, behind);
        let light = fbm(self.seed ^ 0x3EAD, x / 0.3, v / 0.07, 3);
        let meadow = mix(
            stored(0x2c_5a40),
            stored(0x9a_b04e),
            smoothstep((light - 0.34) / 0.32) * (1.0 - smoothstep((v - top) / 0.16)),
        );
        let ground = mix(meadow, stored(0x17_3a3c), smoothstep((v - top - 0.05) / 0.16));
        let ground = self.flowers(x, v, ground);
        mix(colour, ground, edge(v - top, 0.006))
    }

    fn bank_top(&self, x: f64) -> f64 {
        let valley = (-((x - self.sun[0]) / (0.34 * self.wide)).powi(2)).exp();
        BANK - 0.1 + 0.15 * valley + 0.025 * (fbm(self.seed ^ 0xBA2C, x / 0.4, 0.3, 3) - 0.5)
    }

    /// Blossoms on the meadow, one in two or three cells of a grid.
    fn flowers(&self, x: f64, v: f64, behind: Stored) -> Stored {
        const CELL: f64 = 0.062;
        const BLOSSOMS: [u32; 4] = [0xf5_7f45, 0xf7_c84e, 0xd9_6aa6, 0xf6_ead6];
        let [i, j] = [x, v].map(|c| (c / CELL).floor() as i64);
        let of = |salt: u64| lattice(self.seed ^ (0xF107 + salt), i, j);
        let centre = [(i as f64 + 0.3 + 0.4 * of(1)) * CELL, (j as f64 + 0.3 + 0.4 * of(2)) * CELL];
        if of(0) > 0.42 || centre[1] < self.bank_top(centre[0]) + 0.02 {
            return behind;
        }
        let radius = 0.011 + 0.007 * of(3);
        let inside = edge(radius - (x - centre[0]).hypot(v - centre[1]), 0.005);
        mix(behind, stored(BLOSSOMS[(4.0 * of(4)) as usize % 4]), inside)
    }

    fn firs(&self, x: f64, v: f64, top: f64, behind: Stored) -> Stored {
        let mut colour = behind;
        let count = (self.wide / 0.075) as i64;
        for k in 0..count {
            let of = |salt: i64| lattice(self.seed ^ 0xF125, k, salt);
            let at = self.wide * (k as f64 + 0.8 * of(0)) / count as f64;
            // None where the sun stands above the water.
            let open = (-((at - self.sun[0]) / (0.25 * self.wide)).powi(2)).exp();
            let height = (0.15 + 0.24 * of(1)) * (1.0 - 1.25 * open);
            if height < 0.05 || of(2) < 0.25 {
                continue;
            }
            let share = (v - (top - height)) / height;
            let tier = 0.72 + 0.28 * (1.0 - (5.0 * share).fract());
            let half = 0.21 * height * share.max(0.0).powf(0.85) * tier;
            let inside = edge(half - (x - at).abs(), 0.005) * edge(share, 0.03) * edge(1.15 - share, 0.03);
            let shade = mix(stored(0x1d_4a4c), stored(0x12_2c3a), of(3));
            colour = mix(colour, shade, inside);
        }
        colour
    }
}

fn stored(rgb: u32) -> Stored {
    [16, 8, 0].map(|shift| f64::from(rgb >> shift & 0xff) / 255.0)
}

fn mix(a: Stored, b: Stored, share: f64) -> Stored {
    let share = share.clamp(0.0, 1.0);
    std::array::from_fn(|c| a[c] + share * (b[c] - a[c]))
}

fn gradient(stops: &[(f64, u32)], at: f64) -> Stored {
    let next = stops.partition_point(|(place, _)| *place <= at).clamp(1, stops.len() - 1);
    let ((from, a), (to, b)) = (stops[next - 1], stops[next]);
    mix(stored(a), stored(b), smoothstep((at - from) / (to - from)))
}

/// From 0 outside to 1 inside, `width` wide to both sides.
fn edge(inside: f64, width: f64) -> f64 {
    smoothstep(0.5 + 0.5 * inside / width)
}

fn smoothstep(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
