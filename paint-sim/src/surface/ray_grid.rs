//! Rays sorted into the cells of a square, so that a triangle finds those that may meet it.

use super::projection::Covered;

/// Rays that are compared at once: a loop over them becomes vector code.
const LANES: usize = 8;
/// Most cells along a side.
const MOST_CELLS: usize = 512;
/// A limit that nothing passes.
const NEVER: f32 = f32::MAX;

/// One ray.
pub(super) struct GridRay {
    /// Column and row, in cells.
    pub(super) x: f32,
    pub(super) y: f32,
    /// Triangles count if their [depth](Covered) is at least this.
    pub(super) limit: f32,
    pub(super) number: u32,
}

impl GridRay {
    pub(super) fn new([x, y]: [f64; 2], limit: f32, number: u32) -> Self {
        Self { x: x as f32, y: y as f32, limit, number }
    }
}

/// Rays by cell, row by row.
pub(super) struct RayGrid {
    side: usize,
    /// First ray of each cell, and the end.
    starts: Vec<u32>,
    x: Vec<f32>,
    y: Vec<f32>,
    limits: Vec<f32>,
    numbers: Vec<u32>,
}

impl RayGrid {
    /// Cells along a side for so many rays: about as many as rays.
    pub(super) fn side(rays: usize) -> usize {
        rays.isqrt().clamp(1, MOST_CELLS)
    }

    /// Sorts the rays.
    pub(super) fn new(side: usize, rays: &[GridRay]) -> Self {
        let cell = |ray: &GridRay| (ray.y as usize).min(side - 1) * side + (ray.x as usize).min(side - 1);
        let mut starts = vec![0_u32; side * side + 1];
        for ray in rays {
            starts[cell(ray)] += 1;
        }
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let padded = rays.len() + LANES;
        let (x, y, limits, numbers) = (vec![0.0; padded], vec![0.0; padded], vec![NEVER; padded], vec![0; rays.len()]);
        let mut grid = Self { side, starts, x, y, limits, numbers };
        // Backwards from the end of each cell, which so becomes its start.
        for ray in rays.iter().rev() {
            let start = &mut grid.starts[cell(ray)];
            *start -= 1;
            let at = *start as usize;
            (grid.x[at], grid.y[at], grid.limits[at], grid.numbers[at]) = (ray.x, ray.y, ray.limit, ray.number);
        }
        grid
    }

    /// How many rays there are.
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Calls `visit` with the number of each ray that may meet the triangle; what it returns is the ray's limit from then on.
    pub(super) fn meet(&mut self, triangle: &Covered, mut visit: impl FnMut(u32) -> Option<f32>) {
        let [[left, right], [first, last]] = triangle.cells;
        for row in first..=last {
            let [mut at, end] = [left, right + 1].map(|column| self.starts[row * self.side + column] as usize);
            while at < end {
                let block = at..at + LANES;
                let (x, y, limits) = (&self.x[block.clone()], &self.y[block.clone()], &self.limits[block]);
                let lanes: [f32; LANES] = std::array::from_fn(|k| triangle.meets(x[k], y[k], limits[k]));
                if lanes.iter().fold(u32::MAX, |signs, lane| signs & lane.to_bits()) >> 31 == 0 {
                    for (k, lane) in lanes.into_iter().enumerate().take(end - at) {
                        if lane >= 0.0
                            && let Some(limit) = visit(self.numbers[at + k])
                        {
                            self.limits[at + k] = limit;
                        }
                    }
                }
                at += LANES;
            }
        }
    }
}
