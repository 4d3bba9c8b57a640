//! Tiles of 8 x 8 pixels: the range of their depths, and how far they are from a plane.
//!
//! What is said here only spares work: it bounds what fusion finds voxel by voxel.

use crate::integration::plane::Plane;
use crate::rounding::{max, min};

/// Edge of a square, pixels.
pub(crate) const TILE: usize = 8;

/// Of a square without rims.
pub(crate) const NO_RIMS: [f32; 2] = [f32::INFINITY, 0.0];

/// The fused pixels of a square.
#[derive(Clone, Copy)]
pub(crate) struct Tile {
    /// Least depth, metres.
    pub(crate) near: f32,
    /// Largest depth, metres; below `near` in a square without fused pixels.
    pub(crate) far: f32,
    /// Their inverse depths, 1/m, are within `error` of this linear function.
    pub(crate) omega: Linear,
    pub(crate) error: f32,
    /// Least and largest depth of the rims beside which they are, metres; the largest below the least if there is none.
    pub(crate) rims: [f32; 2],
}

/// `base + slope · (u, v)`.
#[derive(Clone, Copy, Default)]
pub(crate) struct Linear {
    pub(crate) base: f32,
    pub(crate) slope: [f32; 2],
}

impl Linear {
    pub(crate) fn at(&self, u: f32, v: f32) -> f32 {
        self.base + self.slope[0] * u + self.slope[1] * v
    }

    fn through(value: f32, slope: [f32; 2], at: [usize; 2]) -> Self {
        Self { base: value - slope[0] * at[0] as f32 - slope[1] * at[1] as f32, slope }
    }
}

impl Tile {
    pub(crate) const EMPTY: Self =
        Self { near: f32::INFINITY, far: 0.0, omega: Linear { base: 0.0, slope: [0.0; 2] }, error: 0.0, rims: NO_RIMS };

    /// Describes the square whose first pixel is `at`, from the lines of pixels that it is in, of an image with this width.
    #[inline(always)]
    pub(crate) fn of(width: usize, at: [usize; 2], planes: &[Plane], omegas: &[f32]) -> Self {
        // What is beyond the image is as what is not fused.
        let mut square = [[0.0; TILE]; TILE];
        let columns = at[0]..(at[0] + TILE).min(width);
        for (line, omegas) in square.iter_mut().zip(omegas.chunks_exact(width)) {
            line[..columns.len()].copy_from_slice(&omegas[columns.clone()]);
        }
        let (mut low, mut high) = ([f32::INFINITY; TILE], [0.0; TILE]);
        for line in &square {
            for (&omega, (low, high)) in line.iter().zip(low.iter_mut().zip(&mut high)) {
                *low = min(if omega > 0.0 { omega } else { f32::INFINITY }, *low);
                *high = max(omega, *high);
            }
        }
        let (low, high) = (low.into_iter().fold(f32::INFINITY, min), high.into_iter().fold(0.0, max));
        if high <= 0.0 {
            return Self::EMPTY;
        }
        // Of the pixel in the middle, if it is fused.
        let (u, v) = (columns.start.midpoint(columns.end), planes.len() / width / 2);
        let plane = &planes[v * width + u];
        let omega = match plane.omega() {
            Some(omega) => Linear::through(omega, plane.scaled_slope.map(|s| s / plane.offset), [u, at[1] + v]),
            None => Linear { base: f32::midpoint(low, high), slope: [0.0; 2] },
        };
        let mut error = [0.0; TILE];
        for (line, v) in square.iter().zip(at[1]..) {
            for (k, (&value, error)) in line.iter().zip(&mut error).enumerate() {
                let off = (value - omega.at((at[0] + k) as f32, v as f32)).abs();
                *error = max(if value > 0.0 { off } else { 0.0 }, *error);
            }
        }
        let error = error.into_iter().fold(0.0, max);
        Self { near: 1.0 / high, far: 1.0 / low, omega, error, rims: NO_RIMS }
    }

    /// How far its inverse depths are from a linear function, at least and at most; it is the square at this column and line.
    #[inline(always)]
    pub(crate) fn off(&self, other: &Linear, at: [usize; 2]) -> [f32; 2] {
        // Two linear functions differ most at a corner; half a square more than there is, at the image's rim.
        let half = 0.5 * TILE as f32;
        let [u, v] = at.map(|k| (k * TILE) as f32 + half);
        let middle = other.at(u, v);
        let own = [self.omega.slope[0] - other.slope[0], self.omega.slope[1] - other.slope[1]];
        let by_plane = self.error + half * (own[0].abs() + own[1].abs());
        let off = self.omega.at(u, v) - middle;
        let by_range = half * (other.slope[0].abs() + other.slope[1].abs());
        [
            max(off - by_plane, 1.0 / self.far - middle - by_range),
            min(off + by_plane, 1.0 / self.near - middle + by_range),
        ]
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.far < self.near
    }
}
