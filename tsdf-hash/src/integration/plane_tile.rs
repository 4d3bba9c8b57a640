//! Tiles of 8 x 8 pixels: the range of their depths, and how far they are from a plane.
//!
//! What is said here only spares work: it bounds what fusion finds voxel by voxel.

use crate::integration::plane::Plane;

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

    pub(crate) fn is_empty(&self) -> bool {
        self.far < self.near
    }
}

/// A line of squares in the making.
pub(crate) struct TileLine {
    width: usize,
    /// Inverse depths, row-major, 0 where a pixel is not fused.
    omegas: Vec<f32>,
    low: Vec<f32>,
    high: Vec<f32>,
    /// For each column, the linear function of its square at the square's first row, and per row.
    base: Vec<f32>,
    down: Vec<f32>,
    error: Vec<f32>,
}

impl TileLine {
    pub(crate) fn new(width: usize) -> Self {
        let column = || vec![0.0; width];
        let omegas = Vec::with_capacity(width * TILE);
        Self { width, omegas, low: column(), high: column(), base: column(), down: column(), error: column() }
    }

    /// Adds a row of inverse depths, 0 where a pixel is not fused.
    #[inline(always)]
    pub(crate) fn push(&mut self, omegas: &[f32]) {
        if self.omegas.is_empty() {
            self.low.fill(f32::INFINITY);
            self.high.fill(0.0);
        }
        self.omegas.extend_from_slice(omegas);
        for ((&omega, low), high) in omegas.iter().zip(&mut self.low).zip(&mut self.high) {
            let floor = if omega > 0.0 { omega } else { f32::INFINITY };
            *low = if floor < *low { floor } else { *low };
            *high = if omega > *high { omega } else { *high };
        }
    }

    /// Describes the squares of the rows that were added, of which the image's row `first` is the topmost, and forgets
    /// the rows.
    #[inline(always)]
    pub(crate) fn finish(&mut self, first: usize, planes: &[Plane], tiles: &mut [Tile]) {
        let width = self.width;
        let rows = self.omegas.len() / width;
        for (k, tile) in tiles.iter_mut().enumerate() {
            let columns = k * TILE..(k * TILE + TILE).min(width);
            let low = self.low[columns.clone()].iter().fold(f32::INFINITY, |a, &b| a.min(b));
            let high = self.high[columns.clone()].iter().fold(0.0_f32, |a, &b| a.max(b));
            // Of the pixel in the middle, if it is fused.
            let (u, v) = (columns.start.midpoint(columns.end), rows / 2);
            let plane = &planes[v * width + u];
            let omega = match plane.omega() {
                Some(omega) => Linear::through(omega, plane.scaled_slope.map(|s| s / plane.offset), [u, first + v]),
                None => Linear { base: f32::midpoint(low.min(high), high), slope: [0.0; 2] },
            };
            *tile = if high > 0.0 {
                Tile { near: 1.0 / high, far: 1.0 / low, omega, error: 0.0, rims: NO_RIMS }
            } else {
                Tile::EMPTY
            };
            for u in columns {
                self.base[u] = omega.at(u as f32, first as f32);
                self.down[u] = omega.slope[1];
            }
        }
        self.error.fill(0.0);
        for (row, omegas) in self.omegas.chunks_exact(width).enumerate() {
            widen(omegas, row as f32, &self.base, &self.down, &mut self.error);
        }
        for (tile, error) in tiles.iter_mut().zip(self.error.chunks(TILE)) {
            tile.error = error.iter().fold(0.0_f32, |a, &b| a.max(b));
        }
        self.omegas.clear();
    }
}

#[inline(always)]
fn widen(omegas: &[f32], row: f32, base: &[f32], down: &[f32], error: &mut [f32]) {
    for (((&omega, &base), &down), error) in omegas.iter().zip(base).zip(down).zip(error) {
        let off = (omega - (base + row * down)).abs();
        let off = if omega > 0.0 { off } else { 0.0 };
        *error = if off > *error { off } else { *error };
    }
}
