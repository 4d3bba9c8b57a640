//! Image pyramids.

use nalgebra::Vector2;

use crate::samples::ImageView;

/// Corners are detected on this level, unless patches begin above it.
const CORNER_LEVEL: usize = 2;

/// An image and its reductions by means of 2x2 pixels.
///
/// A pixel `x` of the full image lies at `(x − (2^l − 1)/2) / 2^l` on level `l`; pixel centres are integers.
#[derive(Debug, Clone)]
pub(crate) struct Pyramid {
    first: usize,
    count: usize,
    levels: Vec<Level>,
}

/// One level: grey values, row by row.
#[derive(Debug, Clone)]
pub(crate) struct Level {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) data: Vec<u8>,
    /// Level pixels per full pixel.
    pub(crate) scale: f64,
    /// Position of the first level pixel in the full image.
    pub(crate) offset: f64,
}

impl Pyramid {
    /// Room for patches on levels `first .. first + count` of a full image of a given size, and for corners on a level that
    /// is coarse enough for them to be few.
    pub(crate) fn new(width: usize, height: usize, first: usize, count: usize) -> Self {
        let level = |l: usize| {
            let (width, height) = (width >> l, height >> l);
            let scale = 1.0 / (1_usize << l) as f64;
            Level { width, height, data: vec![0; width * height], scale, offset: 0.5 / scale - 0.5 }
        };
        Self { first, count, levels: (0..(first + count).max(CORNER_LEVEL + 1)).map(level).collect() }
    }

    /// Fills all levels.
    pub(crate) fn fill(&mut self, image: &ImageView) {
        if self.first == 0 {
            self.levels[0].data.copy_from_slice(image.data);
        }
        for l in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(l);
            let from = if l == 1 { image.data } else { &below[l - 1].data };
            reduce(from, below[l - 1].width, &mut above[0]);
        }
    }

    /// The levels that patches are made of, the finest first.
    pub(crate) fn patch_levels(&self) -> &[Level] {
        &self.levels[self.first..self.first + self.count]
    }

    /// The level on which corners are detected.
    pub(crate) fn corner_level(&self) -> &Level {
        &self.levels[CORNER_LEVEL.max(self.first)]
    }
}

/// Means of 2x2 pixels, rounded to nearest; an odd last row or column is left out.
fn reduce(from: &[u8], width: usize, to: &mut Level) {
    for (y, row) in to.data.chunks_exact_mut(to.width).enumerate() {
        let upper = &from[2 * y * width..][..2 * to.width];
        let lower = &from[(2 * y + 1) * width..][..2 * to.width];
        for ((mean, a), b) in row.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
            *mean = ((u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]) + 2) / 4) as u8;
        }
    }
}

impl Level {
    /// Position on this level of a pixel of the full image.
    pub(crate) fn position(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        (pixel - Vector2::repeat(self.offset)) * self.scale
    }

    /// The pixel of the full image at a position on this level.
    pub(crate) fn pixel(&self, position: &Vector2<f64>) -> Vector2<f64> {
        position / self.scale + Vector2::repeat(self.offset)
    }

    /// Whether a rectangle about a position can be interpolated, also after its corners are rounded to `f32`.
    pub(crate) fn contains(&self, position: &Vector2<f64>, half_size: &Vector2<f64>) -> bool {
        let inside = |x: f64, half_size: f64, side: usize| x - half_size >= 0.01 && x + half_size < side as f64 - 1.01;
        inside(position.x, half_size.x, self.width) && inside(position.y, half_size.y, self.height)
    }

    /// Grey value between four pixels, which must be there.
    #[inline(always)]
    pub(crate) fn interpolate(&self, x: f32, y: f32) -> f32 {
        let (column, row) = (x as usize, y as usize);
        let (u, v) = (x - column as f32, y - row as f32);
        let upper = &self.data[row * self.width + column..][..2];
        let lower = &self.data[(row + 1) * self.width + column..][..2];
        let mix = |pair: &[u8]| f32::from(pair[0]) + u * (f32::from(pair[1]) - f32::from(pair[0]));
        let (upper, lower) = (mix(upper), mix(lower));
        upper + v * (lower - upper)
    }
}
