//! Free space beside the rims of near surfaces: how far a pixel's ray passes from a surface that ends before it gets there.
//!
//! Without it nothing is known of the voxels beside a rim, since their pixels show a surface far behind; a mesh then ends
//! a voxel short of each rim, and a thing thinner than two voxels has hardly any. The voxels behind a rim stand for half a
//! voxel around them, as in a ray cast: what is beside is as far from the surface as from there.

use crate::images::Intrinsics;
use crate::integration::gap_filling::{GRANTED, STEEPEST};
use crate::integration::inverse_depth_noise::InverseDepthNoise;
use crate::settings::Settings;

/// Free space is known so far beside and in front of rims, in voxels: no corner of a cell is farther from a surface in it (√3).
const FRONT: f64 = 1.75;
/// And so far behind them: what lies there may be a side of the thing that is not seen (ours).
const BEHIND: f64 = 1.0;
/// Pixels that a voxel spans at least where rims are told: they are known to a pixel (ours).
const LEAST_PIXELS: f32 = 2.0;
/// Bits of the number of pixels, in place of the last ones of the depth: a relative error below `2e-5`.
const PIXEL_BITS: u32 = 0xff;

/// The nearest rim that a pixel's ray passes before it meets a surface: its depth, and how many pixels it is away. 0: none.
#[derive(Clone, Copy, Default, PartialEq)]
pub(crate) struct Rim(pub(crate) u32);

impl Rim {
    pub(crate) const NONE: Self = Self(0);

    fn new(depth: f32, pixels: u32) -> Self {
        Self(depth.to_bits() & !PIXEL_BITS | pixels)
    }

    /// Along the optical axis, metres.
    pub(crate) fn depth(self) -> f32 {
        f32::from_bits(self.0 & !PIXEL_BITS)
    }

    /// At least one.
    pub(crate) fn pixels(self) -> u32 {
        self.0 & PIXEL_BITS
    }

    /// The nearer one of two; of two as near, that of the nearer surface.
    fn is_nearer(self, other: Self) -> bool {
        // The pixels come first, and none is the farthest.
        let key = |rim: Self| rim.0.rotate_right(PIXEL_BITS.count_ones()).wrapping_sub(1);
        key(self) < key(other)
    }
}

/// All pixels' rims.
#[derive(Default)]
pub(crate) struct RimImage {
    /// Row-major.
    pub(crate) rims: Vec<Rim>,
    /// The pixels that have one.
    pub(crate) beside: Vec<u32>,
    /// The pixels of near surfaces at whose rims they are.
    pub(crate) sources: Vec<u32>,
}

/// How far free space beside rims is known, from behind them (negative) to in front, metres.
pub(crate) fn reach(settings: &Settings) -> [f32; 2] {
    [-BEHIND, FRONT].map(|reach| (reach * settings.voxel_size) as f32)
}

/// What tells a rim from a steep surface, and how far to look.
struct Rule<'a> {
    /// Inverse depths, 0 where nothing is known.
    omegas: &'a [f32],
    noise: InverseDepthNoise,
    /// Largest relative change per pixel along a row and along a column.
    steepest: [f32; 2],
    voxel: f32,
    /// A voxel in pixels at a metre.
    pixels: f32,
}

/// A pixel from where free space is looked for, and how far it is itself from the rim.
#[derive(Clone, Copy)]
struct Start {
    at: u32,
    /// Inverse depth of the rim, 1/m.
    omega: f32,
    pixels: u32,
}

impl RimImage {
    /// Finds the rims among the pixels `edges` and what lies beside them: first along rows, then from there along columns.
    ///
    /// A distance is the larger one of the two along row and column.
    pub(crate) fn find(&mut self, width: usize, omegas: &[f32], edges: &[u32], k: &Intrinsics, settings: &Settings) {
        for &pixel in &self.beside {
            if let Some(rim) = self.rims.get_mut(pixel as usize) {
                *rim = Rim::NONE;
            }
        }
        self.rims.resize(omegas.len(), Rim::NONE);
        self.beside.clear();
        self.sources.clear();
        let rule = Rule {
            omegas,
            noise: InverseDepthNoise::new(settings),
            steepest: [k.fx, k.fy].map(|f| STEEPEST / f.abs() as f32),
            voxel: settings.voxel_size as f32,
            pixels: (settings.voxel_size * k.fx.abs().max(k.fy.abs())) as f32,
        };
        let own = |&at: &u32| {
            let omega = omegas[at as usize];
            (rule.pixels * omega >= LEAST_PIXELS).then_some(Start { at, omega, pixels: 0 })
        };
        for start in edges.iter().filter_map(own) {
            let column = start.at as usize % width;
            let known = self.beside.len();
            self.leave(&rule, start, [(-1, column), (1, width - 1 - column)], 0);
            if self.beside.len() > known {
                self.sources.push(start.at);
            }
        }
        let along_rows = self.beside.iter().map(|&at| {
            let rim = self.rims[at as usize];
            Start { at, omega: 1.0 / rim.depth(), pixels: rim.pixels() }
        });
        let starts: Vec<Start> = edges.iter().filter_map(own).chain(along_rows).collect();
        let rows = omegas.len() / width;
        for start in starts {
            let row = start.at as usize / width;
            let known = self.beside.len();
            self.leave(&rule, start, [(-(width as isize), row), (width as isize, rows - 1 - row)], 1);
            if self.beside.len() > known && start.pixels == 0 {
                self.sources.push(start.at);
            }
        }
    }

    /// Goes from a pixel in steps along an axis, as far as there is room, and leaves the rim in each pixel that shows a surface
    /// behind it, until this is known.
    fn leave(&mut self, rule: &Rule, start: Start, ways: [(isize, usize); 2], axis: usize) {
        let Start { at, omega, pixels } = start;
        let (granted, slope) = (GRANTED * rule.noise.sigma_inverse(omega), rule.steepest[axis] * omega);
        let (voxel, depth) = (rule.voxel * omega, 1.0 / omega);
        let most = ((FRONT as f32 * rule.pixels * omega) as u32 + 1).min(PIXEL_BITS);
        for (step, room) in ways {
            let (mut at, mut n, last) = (at as usize, 0, most.min(room as u32));
            while n < last {
                n += 1;
                at = at.wrapping_add_signed(step);
                let there = rule.omegas[at];
                // What lies there is unknown.
                if there <= 0.0 {
                    continue;
                }
                let behind = omega - there;
                let (rim, known) = (Rim::new(depth, n.max(pixels)), &mut self.rims[at]);
                // One that is nearer is so all the way from here.
                if !(behind > granted + slope * n as f32 && behind > voxel * there && rim.is_nearer(*known)) {
                    break;
                }
                if *known == Rim::NONE {
                    self.beside.push(at as u32);
                }
                *known = rim;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{LEAST_PIXELS, Rim, RimImage};
    use crate::hashing::mix64;
    use crate::images::Intrinsics;
    use crate::settings::Settings;

    const WIDTH: usize = 60;
    const HEIGHT: usize = 44;

    const CAMERA: Intrinsics = Intrinsics { fx: 200.0, fy: -180.0, cx: 30.0, cy: 20.0 };

    fn is_near(at: usize) -> bool {
        (20..33).contains(&(at % WIDTH)) && (15..27).contains(&(at / WIDTH))
    }

    /// A rectangle a metre away before a wall, with gaps in the wall.
    fn scene(is_gap: impl Fn(usize) -> bool) -> Vec<f32> {
        let omega = |at: usize| match (is_near(at), is_gap(at)) {
            (false, true) => 0.0,
            (true, _) => 1.0,
            (false, false) => 2.0 / 3.0,
        };
        (0..WIDTH * HEIGHT).map(omega).collect()
    }

    /// By brute force; the second time in the same memory.
    #[test]
    fn a_pixel_has_the_nearest_rim_within_reach() {
        let settings = Settings { voxel_size: 0.02, ..Settings::default() };
        let edges: Vec<u32> = (0..(WIDTH * HEIGHT) as u32).collect();
        // 1.75 voxels at one metre, of 200 pixels, and the pixel that they end in.
        let most = (1.75_f64 * 0.02 * 200.0) as usize + 1;
        let mut image = RimImage::default();
        for has_gaps in [true, false] {
            let is_gap = |at: usize| has_gaps && mix64(at as u64).is_multiple_of(9);
            image.find(WIDTH, &scene(is_gap), &edges, &CAMERA, &settings);
            for at in 0..WIDTH * HEIGHT {
                let (u, v) = (at % WIDTH, at / WIDTH);
                let beside = 20_usize.saturating_sub(u) + u.saturating_sub(32);
                let apart = beside.max(15_usize.saturating_sub(v) + v.saturating_sub(26));
                let rim = image.rims[at];
                let pixels = rim.pixels() as usize;
                if is_near(at) || is_gap(at) || apart > most {
                    assert!(rim == Rim::NONE, "{u} {v}");
                } else if !(has_gaps && (rim == Rim::NONE || pixels > apart)) {
                    // What lies in gaps cannot be gone on from.
                    assert!(pixels == apart && (rim.depth() - 1.0).abs() < 4e-5, "{u} {v}: {pixels}");
                }
            }
            let beside = (0..WIDTH * HEIGHT).filter(|&at| image.rims[at] != Rim::NONE).count();
            assert_eq!(beside, image.beside.len());
            assert!(image.sources.iter().all(|&at| is_near(at as usize)));
        }
    }

    #[test]
    fn a_rim_is_not_told_where_a_voxel_is_less_than_two_pixels() {
        let edges: Vec<u32> = (0..(WIDTH * HEIGHT) as u32).collect();
        let voxel_size = f64::from(LEAST_PIXELS) / 200.0;
        for (voxel_size, is_told) in [(voxel_size - 1e-5, false), (voxel_size + 1e-5, true)] {
            let mut image = RimImage::default();
            let settings = Settings { voxel_size, ..Settings::default() };
            image.find(WIDTH, &scene(|_| false), &edges, &CAMERA, &settings);
            assert_eq!(image.beside.is_empty(), !is_told);
        }
    }
}
