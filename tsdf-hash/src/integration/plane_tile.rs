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
    /// Least and largest inverse depth, 1/m.
    range: [f32; 2],
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
    pub(crate) const EMPTY: Self = Self {
        near: f32::INFINITY,
        far: 0.0,
        range: [f32::INFINITY, 0.0],
        omega: Linear { base: 0.0, slope: [0.0; 2] },
        error: 0.0,
        rims: NO_RIMS,
    };

    /// Describes the square whose first pixel is `at`, from the lines of pixels that it is in, of an image with this width.
    #[inline(always)]
    pub(crate) fn of(width: usize, at: [usize; 2], planes: &[Plane], omegas: &[f32]) -> Self {
        // What is beyond the image is as what is not fused.
        let mut square = [[0.0; TILE]; TILE];
        let columns = at[0]..(at[0] + TILE).min(width);
        for (line, omegas) in square.iter_mut().zip(omegas.chunks_exact(width)) {
            let omegas = &omegas[columns.clone()];
            match omegas.first_chunk() {
                Some(whole) => *line = *whole,
                None => line[..omegas.len()].copy_from_slice(omegas),
            }
        }
        let (mut low, mut high) = ([f32::INFINITY; TILE], [0.0; TILE]);
        for line in &square {
            for k in 0..TILE {
                low[k] = min(if line[k] > 0.0 { line[k] } else { f32::INFINITY }, low[k]);
                high[k] = max(line[k], high[k]);
            }
        }
        let (low, high) = (fold(low, min), fold(high, max));
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
        let [left, above] = at.map(|k| k as f32);
        let mut error = [0.0; TILE];
        for (v, line) in square.iter().enumerate() {
            for k in 0..TILE {
                let off = (line[k] - omega.at(left + k as f32, above + v as f32)).abs();
                error[k] = max(if line[k] > 0.0 { off } else { 0.0 }, error[k]);
            }
        }
        Self { near: 1.0 / high, far: 1.0 / low, range: [low, high], omega, error: fold(error, max), rims: NO_RIMS }
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
        [max(off - by_plane, self.range[0] - middle - by_range), min(off + by_plane, self.range[1] - middle + by_range)]
    }
}

/// What is left of a row of values, two of which are made one again and again.
#[inline(always)]
fn fold(values: [f32; TILE], one: impl Fn(f32, f32) -> f32) -> f32 {
    let four: [f32; 4] = std::array::from_fn(|k| one(values[k], values[k + 4]));
    one(one(four[0], four[2]), one(four[1], four[3]))
}
