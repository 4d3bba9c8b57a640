//! The chart cut into square texels: which piece of the surface each one is.

use crate::chart::{Chart, SurfacePoint, inside};
use crate::clip::Polygon;
use crate::error::Error;
use crate::triangle::orientation;

/// Largest number of texels of one map (a 16k square).
const MAX_TEXELS: usize = 1 << 28;

/// A chart that reaches past the last texel by less than this fraction of a texel gets no other one: it belongs to the
/// last, and a wall of 2 m has 160 texels of 1.25 cm even if its width was computed as 2 m plus rounding.
const ROUNDING: f64 = 1e-9;

/// One texel per `texel_m` x `texel_m` of the chart, row-major, row 0 at the TOP (largest v). The chart's lower left
/// corner is the lower left corner of the lower left texel.
#[derive(Debug, Clone, PartialEq)]
pub struct TexelMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Side of a texel, metres.
    pub texel_m: f64,
    /// The surface point at the texel's centre; where only the rest of the texel is covered, the middle of the largest
    /// piece of a face in it; `None` where the texel is empty.
    pub cells: Vec<Option<SurfacePoint>>,
    /// Area of the surface that lies in the texel, m^2. Sums to the area of the surface.
    pub area_m2: Vec<f64>,
    /// Covered fraction of the texel (1 inside, less at the border; above 1 where the chart overlaps itself).
    pub coverage: Vec<f32>,
}

impl TexelMap {
    /// Cuts `chart` into texels of side `texel_m` metres (thesis: 0.0125 m).
    ///
    /// # Errors
    /// [`Error::Setting`] unless the side is positive, [`Error::TooManyTexels`].
    pub fn new(chart: &Chart, texel_m: f64) -> Result<Self, Error> {
        if !(texel_m.is_finite() && texel_m > 0.0) {
            return Err(Error::Setting { name: "texel_m", value: texel_m, must_be: "positive" });
        }
        let count = |length: f64| (length / texel_m - ROUNDING).ceil().max(1.0);
        let (columns, rows) = (count(chart.width()), count(chart.height()));
        if columns * rows > MAX_TEXELS as f64 {
            return Err(Error::TooManyTexels { texel_m, width: columns, height: rows, limit: MAX_TEXELS });
        }
        let (width, height) = (columns as usize, rows as usize);
        let mut map = Self {
            width,
            height,
            texel_m,
            cells: vec![None; width * height],
            area_m2: vec![0.0; width * height],
            coverage: vec![0.0; width * height],
        };
        let mut largest_piece = vec![0.0; width * height];
        for face in 0..chart.disk().faces().len() {
            map.add_face(chart, face, &mut largest_piece);
        }
        Ok(map)
    }

    /// The surface point of a texel.
    pub fn at(&self, column: usize, row: usize) -> Option<SurfacePoint> {
        if column < self.width && row < self.height { self.cells[row * self.width + column] } else { None }
    }

    /// Centre of a texel in the chart, metres.
    pub fn uv_of_texel(&self, column: usize, row: usize) -> [f64; 2] {
        [(column as f64 + 0.5) * self.texel_m, (self.height as f64 - row as f64 - 0.5) * self.texel_m]
    }

    /// Column and row of the texel that holds a point of the chart; `None` outside the map.
    pub fn texel_of_uv(&self, uv: [f64; 2]) -> Option<[usize; 2]> {
        let (column, from_below) = (uv[0] / self.texel_m, uv[1] / self.texel_m);
        let inside =
            column >= 0.0 && from_below >= 0.0 && column < self.width as f64 && from_below < self.height as f64;
        inside.then(|| [column as usize, self.height - 1 - from_below as usize])
    }

    /// Adds the pieces of one face to the texels it meets. A flipped face counts as area but is no texel's point as long
    /// as another face is there.
    fn add_face(&mut self, chart: &Chart, face: usize, largest_piece: &mut [f64]) {
        // In units of texels from the lower left corner.
        let corners = chart.disk().faces()[face].map(|v| chart.uv()[v as usize].map(|x| x / self.texel_m));
        let doubled = orientation(corners);
        if doubled == 0.0 {
            return;
        }
        let area_per_texel = chart.disk().face_area(face) / (0.5 * doubled.abs());
        let low = |k: usize| corners[0][k].min(corners[1][k]).min(corners[2][k]).max(0.0) as usize;
        let high = |k: usize| corners[0][k].max(corners[1][k]).max(corners[2][k]) as usize;
        let last_column = high(0).min(self.width - 1);
        let triangle = Polygon::triangle(corners);
        for level in low(1)..=high(1).min(self.height - 1) {
            let strip = triangle.between(1, level as f64, end(level, self.height));
            for column in low(0)..=last_column {
                let piece = strip.between(0, column as f64, end(column, self.width));
                let size = piece.area();
                if size == 0.0 {
                    continue;
                }
                let texel = (self.height - 1 - level) * self.width + column;
                self.area_m2[texel] += area_per_texel * size;
                self.coverage[texel] += size as f32;
                if largest_piece[texel] == f64::INFINITY {
                    continue;
                }
                let centre = [column as f64 + 0.5, level as f64 + 0.5];
                let found = if let Some(barycentric) = inside(corners, centre) {
                    largest_piece[texel] = f64::INFINITY;
                    barycentric
                } else if size > largest_piece[texel] {
                    largest_piece[texel] = size;
                    clamped(corners, doubled, piece.middle())
                } else {
                    continue;
                };
                self.cells[texel] = Some(SurfacePoint { face: face as u32, barycentric: found });
            }
        }
    }
}

/// Upper bound of a row or column, in texels.
fn end(index: usize, count: usize) -> f64 {
    if index + 1 == count { f64::INFINITY } else { (index + 1) as f64 }
}

/// Weights of a point of the triangle, with what rounding pushed outside put back.
fn clamped([a, b, c]: [[f64; 2]; 3], doubled: f64, at: [f64; 2]) -> [f64; 3] {
    let weights = [[b, c, at], [c, a, at], [a, b, at]].map(|t| (orientation(t) / doubled).clamp(0.0, 1.0));
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}
