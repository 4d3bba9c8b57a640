//! Rays sorted into the cells of a square, so that a triangle finds those that may meet it.
//!
//! `unsafe`: a function that is compiled for AVX2 may only be called where the processor has it; that is asked before. Both versions do the
//! same operations in the same order, so their results are the same bits.
#![allow(unsafe_code, reason = "a function compiled for AVX2 is called where the processor has it")]

use nalgebra::Vector3;

use super::projection::{Covered, Projection};

/// Rays that are compared at once: a loop over them becomes vector code.
const LANES: usize = 8;
/// Triangles by which memory is asked ahead: those of a large mesh are not in the cache.
const AHEAD: usize = 8;
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
    /// Cells along a side for so many rays: some rays in each.
    pub(super) fn side(rays: usize) -> usize {
        (rays / 3).isqrt().clamp(1, MOST_CELLS)
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

    /// Calls `visit` with the leaf of a triangle and the number of a ray wherever they may meet; what it returns is the ray's limit from then on.
    pub(super) fn meet(
        &mut self,
        projection: &Projection,
        leaves: &[u32],
        corners: &[[Vector3<f64>; 3]],
        visit: &mut dyn FnMut(u32, u32) -> Option<f32>,
    ) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            unsafe { self.meet_avx2(projection, leaves, corners, visit) };
            return;
        }
        self.meet_each(projection, leaves, corners, visit);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn meet_avx2(
        &mut self,
        projection: &Projection,
        leaves: &[u32],
        corners: &[[Vector3<f64>; 3]],
        visit: &mut dyn FnMut(u32, u32) -> Option<f32>,
    ) {
        self.meet_each(projection, leaves, corners, visit);
    }

    #[inline(always)]
    fn meet_each(
        &mut self,
        projection: &Projection,
        leaves: &[u32],
        corners: &[[Vector3<f64>; 3]],
        visit: &mut dyn FnMut(u32, u32) -> Option<f32>,
    ) {
        for (k, &leaf) in leaves.iter().enumerate() {
            if let Some(ahead) = leaves.get(k + AHEAD) {
                prefetch(&corners[*ahead as usize]);
            }
            if let Some(triangle) = projection.cover(&corners[leaf as usize]) {
                self.meet_one(&triangle, |ray| visit(leaf, ray));
            }
        }
    }

    #[inline(always)]
    fn meet_one(&mut self, triangle: &Covered, mut visit: impl FnMut(u32) -> Option<f32>) {
        let [[left, right], [first, last]] = triangle.cells;
        for row in first..=last {
            let [mut at, end] = [left, right + 1].map(|column| self.starts[row * self.side + column] as usize);
            while at < end {
                let lanes = |of: &[f32]| of[at..].first_chunk().copied().unwrap_or([NEVER; LANES]);
                let (x, y, limits) = (lanes(&self.x), lanes(&self.y), lanes(&self.limits));
                let least: [f32; LANES] = std::array::from_fn(|k| triangle.meets(x[k], y[k], limits[k]));
                if least.iter().fold(u32::MAX, |signs, lane| signs & lane.to_bits()) >> 31 == 0 {
                    for (k, lane) in least.into_iter().enumerate().take(end - at) {
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

/// Asks for the memory of a triangle.
#[inline(always)]
fn prefetch(corners: &[Vector3<f64>; 3]) {
    #[cfg(target_arch = "x86_64")]
    for corner in [&corners[0], &corners[2]] {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 processor has it, and it never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(corner).cast()) };
    }
}
