//! Rotated binary descriptors: 256 comparisons of smoothed grey in a patch that is turned with its own brightness (rotated BRIEF,
//! Rublee et al. 2011).

use std::sync::OnceLock;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::place_recognition::grey_image::GreyImage;

/// Pixels between a feature and the rim of the image at least.
pub(super) const RADIUS: usize = 15;
/// Bits.
pub(super) const BITS: u32 = 256;
/// Of the stream that the pattern is drawn from. A file of keyframes or words holds for one pattern.
const SEED: u64 = 20;

/// 256 bits; near descriptors differ in few.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Descriptor(pub(crate) [u64; 4]);

impl Descriptor {
    /// In how many bits two descriptors differ.
    #[inline]
    pub(crate) fn distance(&self, other: &Self) -> u32 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a ^ b).count_ones()).sum()
    }

    /// Of the patch around a pixel that is [`RADIUS`] from the rim, of an image and of the same one smoothed.
    pub(super) fn of_patch(image: &GreyImage, smooth: &GreyImage, u: usize, v: usize) -> Self {
        let [cos, sin] = direction(image, u, v);
        let grey = |[x, y]: [i8; 2]| {
            let (x, y) = (f32::from(x), f32::from(y));
            let across = (cos * x - sin * y).round() as isize;
            let down = (sin * x + cos * y).round() as isize;
            smooth.pixels[(v.wrapping_add_signed(down)) * smooth.width + u.wrapping_add_signed(across)]
        };
        let mut words = [0_u64; 4];
        for (k, [a, b]) in pattern().iter().enumerate() {
            words[k / 64] |= u64::from(grey(*a) < grey(*b)) << (k % 64);
        }
        Self(words)
    }
}

/// From the middle of a patch to its centre of brightness, of length one: products and roots only, so the same everywhere.
fn direction(image: &GreyImage, u: usize, v: usize) -> [f32; 2] {
    let radius = RADIUS as i32;
    let mut sums = [0_i32; 2];
    for y in -radius..=radius {
        let row = (v as i32 + y) as usize * image.width;
        for x in -radius..=radius {
            if x * x + y * y <= radius * radius {
                let grey = i32::from(image.pixels[row + (u as i32 + x) as usize]);
                sums[0] += x * grey;
                sums[1] += y * grey;
            }
        }
    }
    let [x, y] = sums.map(|s| s as f32);
    let norm = (x * x + y * y).sqrt();
    if norm > 0.0 { [x / norm, y / norm] } else { [1.0, 0.0] }
}

/// Pairs of places around the middle, more of them near it: sums of four numbers each.
fn pattern() -> &'static [[[i8; 2]; 2]; BITS as usize] {
    static PATTERN: OnceLock<[[[i8; 2]; 2]; BITS as usize]> = OnceLock::new();
    PATTERN.get_or_init(|| {
        let mut random = SplitMix64::seed_from_u64(SEED);
        let mut coordinate = || (0..4).map(|_| (random.next_u64() >> 32) % 11).sum::<u64>() as i32 - 20;
        let most = RADIUS as i32 - 1;
        // A place that turns stays within its circle.
        let mut place = || loop {
            let [x, y] = [coordinate(), coordinate()];
            if x * x + y * y <= most * most {
                return [x as i8, y as i8];
            }
        };
        std::array::from_fn(|_| {
            loop {
                let [a, b] = [place(), place()];
                if a != b {
                    return [a, b];
                }
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waves in all directions around a place: what is seen of them when the camera rolls by an angle.
    fn rolled(angle: f64) -> GreyImage {
        let (width, height) = (80, 80);
        let (sin, cos) = angle.sin_cos();
        let grey = |k: usize| {
            let (x, y) = ((k % width) as f64 - 40.0, (k / width) as f64 - 40.0);
            let (x, y) = (cos * x + sin * y, cos * y - sin * x);
            let waves = (0.31 * x + 0.2).sin() + (0.23 * y + 0.1 * x).cos() + (0.17 * (x - 2.0 * y)).sin();
            (128.0 + 20.0 * waves + 0.8 * x) as u8
        };
        GreyImage { width, height, pixels: (0..width * height).map(grey).collect() }
    }

    fn described(image: &GreyImage, u: usize, v: usize) -> Descriptor {
        Descriptor::of_patch(image, &image.smoothed(), u, v)
    }

    /// A patch that is turned is recognised; patches elsewhere are not.
    #[test]
    fn a_descriptor_turns_with_its_patch() {
        let upright = described(&rolled(0.0), 40, 40);
        let angles = (10..360).step_by(35).map(|degrees| rolled(f64::from(degrees).to_radians()));
        let turned: Vec<u32> = angles.map(|image| upright.distance(&described(&image, 40, 40))).collect();
        let places = [[20, 40], [40, 58], [60, 20]];
        let elsewhere = places.map(|[u, v]| upright.distance(&described(&rolled(0.0), u, v)));
        assert!(
            turned.iter().all(|off| elsewhere.iter().all(|there| 3 * off < 2 * there)),
            "{turned:?}, {elsewhere:?}"
        );
    }

    #[test]
    fn distance_counts_bits() {
        let (none, all) = (Descriptor([0; 4]), Descriptor([u64::MAX; 4]));
        assert_eq!([none.distance(&all), none.distance(&none)], [256, 0]);
        assert_eq!(none.distance(&Descriptor([0b1011, 0, 1 << 63, 0])), 4);
    }
}
