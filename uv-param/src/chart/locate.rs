//! Which face covers a point of the chart: a uniform grid of candidate lists, decided by the exact predicate.

use super::surface_point::SurfacePoint;
use crate::clip::Polygon;
use crate::triangle::orientation;

/// Area that two faces may share, relative to the squared diagonal of their chart: a strip as long as the chart and a few roundings of a coordinate
/// wide. The two sides of a slit in a flat piece touch, and when a chart is turned, each of their points is rounded on its own.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Faces by grid cell, in compressed rows.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    columns: usize,
    rows: usize,
    cells_per_metre: f64,
    /// Lower left corner of the cells.
    corner: [f64; 2],
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Grid {
    /// About as many cells as faces.
    pub(super) fn new(uv: &[[f64; 2]], faces: &[[u32; 3]], size: [f64; 2]) -> Self {
        let mut grid = Self::sized(faces.len(), size);
        grid.fill(uv, faces);
        grid
    }

    fn sized(faces: usize, [width, height]: [f64; 2]) -> Self {
        let cells_per_metre = (faces as f64 / (width * height)).sqrt().min(faces as f64 / width);
        let columns = (width * cells_per_metre).ceil().max(1.0) as usize;
        let rows = (height * cells_per_metre).ceil().max(1.0) as usize;
        let starts = vec![0; columns * rows + 1];
        Self { columns, rows, cells_per_metre, corner: [0.0; 2], starts, faces: Vec::new() }
    }

    fn fill(&mut self, uv: &[[f64; 2]], faces: &[[u32; 3]]) {
        let (columns, rows, grid) = (self.columns, self.rows, self);
        // A face that is not counter-clockwise covers nothing: where the chart folds, the faces around it lie there too.
        let upright: Vec<bool> = faces.iter().map(|f| orientation(f.map(|v| uv[v as usize])) > 0.0).collect();
        let boxes: Vec<[u32; 4]> = faces.iter().map(|f| grid.cell_box(f.map(|v| uv[v as usize]))).collect();
        let covered = || boxes.iter().enumerate().filter(|&(f, _)| upright[f]);
        for (_, cells) in covered() {
            for cell in cells_of(*cells, columns) {
                grid.starts[cell + 1] += 1;
            }
        }
        for cell in 0..columns * rows {
            grid.starts[cell + 1] += grid.starts[cell];
        }
        let mut cursor = grid.starts.clone();
        grid.faces = vec![0; grid.starts[columns * rows] as usize];
        for (f, cells) in covered() {
            for cell in cells_of(*cells, columns) {
                grid.faces[cursor[cell] as usize] = f as u32;
                cursor[cell] += 1;
            }
        }
    }

    fn cell_box(&self, corners: [[f64; 2]; 3]) -> [u32; 4] {
        let [left, bottom] = self.cell([low(corners, 0), low(corners, 1)]);
        let [right, top] = self.cell([high(corners, 0), high(corners, 1)]);
        [left as u32, bottom as u32, right as u32, top as u32]
    }

    /// Column and row of a point, the nearest cell for points outside.
    fn cell(&self, at: [f64; 2]) -> [usize; 2] {
        let index =
            |k: usize, count: usize| (((at[k] - self.corner[k]) * self.cells_per_metre) as usize).min(count - 1);
        [index(0, self.columns), index(1, self.rows)]
    }

    /// How many pairs of faces without a common edge lie on each other, by more than rounding can make, and the area that they share: 0 for a chart
    /// that does not overlap itself.
    pub(super) fn overlap(&self, uv: &[[f64; 2]], faces: &[[u32; 3]]) -> (usize, f64) {
        let corners = |f: u32| faces[f as usize].map(|v| uv[v as usize]);
        let (mut pairs, mut sum) = (0, 0.0);
        let size = [self.columns, self.rows].map(|cells| cells as f64 / self.cells_per_metre);
        let rounding = ROUNDING * (size[0] * size[0] + size[1] * size[1]);
        self.each_overlap(uv, faces, |f, g| {
            let area = common_area(corners(f), corners(g));
            if area > rounding {
                pairs += 1;
                sum += area;
            }
        });
        (pairs, sum)
    }

    /// The pairs of faces without a common edge that lie on each other, each once.
    fn each_overlap(&self, uv: &[[f64; 2]], faces: &[[u32; 3]], mut found: impl FnMut(u32, u32)) {
        let corners = |f: u32| faces[f as usize].map(|v| uv[v as usize]);
        for cell in 0..self.columns * self.rows {
            let here = &self.faces[self.starts[cell] as usize..self.starts[cell + 1] as usize];
            let here_is = [cell % self.columns, cell / self.columns];
            for (i, &f) in here.iter().enumerate() {
                for &g in &here[i + 1..] {
                    if faces[f as usize].iter().filter(|v| faces[g as usize].contains(v)).count() > 1 {
                        continue;
                    }
                    let (a, b) = (corners(f), corners(g));
                    // A pair may meet in many cells; the one that holds the lower left corner of both boxes speaks.
                    let low = [0, 1].map(|k| low(a, k).max(low(b, k)));
                    let high = [0, 1].map(|k| high(a, k).min(high(b, k)));
                    if low[0] < high[0] && low[1] < high[1] && self.cell(low) == here_is && meet(a, b) {
                        found(f, g);
                    }
                }
            }
        }
    }

    pub(super) fn locate(&self, uv: &[[f64; 2]], faces: &[[u32; 3]], at: [f64; 2]) -> Option<SurfacePoint> {
        if !(at[0] >= 0.0 && at[1] >= 0.0 && at[0].is_finite() && at[1].is_finite()) {
            return None;
        }
        let [column, row] = self.cell(at);
        let cell = row * self.columns + column;
        self.faces[self.starts[cell] as usize..self.starts[cell + 1] as usize].iter().find_map(|&face| {
            let corners = faces[face as usize].map(|v| uv[v as usize]);
            inside(corners, at).map(|barycentric| SurfacePoint { face, barycentric })
        })
    }
}

/// How many pairs of faces of a layout without flips lie on each other.
pub(crate) fn overlapping_pairs(uv: &[[f64; 2]], faces: &[[u32; 3]]) -> usize {
    let mut pairs = 0;
    grid_around(uv, faces).each_overlap(uv, faces, |_, _| pairs += 1);
    pairs
}

/// These pairs.
pub(crate) fn overlapping_faces(uv: &[[f64; 2]], faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut pairs = Vec::new();
    grid_around(uv, faces).each_overlap(uv, faces, |f, g| pairs.push([f, g]));
    pairs
}

fn grid_around(uv: &[[f64; 2]], faces: &[[u32; 3]]) -> Grid {
    let bound = |k: usize, pick: fn(f64, f64) -> f64| uv.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
    let low = [bound(0, f64::min), bound(1, f64::min)];
    let size = [bound(0, f64::max) - low[0], bound(1, f64::max) - low[1]];
    let mut grid = Grid::sized(faces.len(), size);
    grid.corner = low;
    grid.fill(uv, faces);
    grid
}

fn cells_of([left, bottom, right, top]: [u32; 4], columns: usize) -> impl Iterator<Item = usize> {
    (bottom..=top).flat_map(move |row| (left..=right).map(move |column| row as usize * columns + column as usize))
}

fn low([a, b, c]: [[f64; 2]; 3], k: usize) -> f64 {
    a[k].min(b[k]).min(c[k])
}

fn high([a, b, c]: [[f64; 2]; 3], k: usize) -> f64 {
    a[k].max(b[k]).max(c[k])
}

/// Whether two counter-clockwise triangles, whose boxes overlap, share more than a boundary point: no side of one has the other beyond it.
fn meet(a: [[f64; 2]; 3], b: [[f64; 2]; 3]) -> bool {
    let apart = |a: [[f64; 2]; 3], b: [[f64; 2]; 3]| {
        (0..3).any(|k| b.iter().all(|&p| orientation([a[k], a[(k + 1) % 3], p]) <= 0.0))
    };
    !apart(a, b) && !apart(b, a)
}

/// Area that two counter-clockwise triangles share.
fn common_area(a: [[f64; 2]; 3], [p, q, r]: [[f64; 2]; 3]) -> f64 {
    Polygon::triangle(a).left_of(p, q).left_of(q, r).left_of(r, p).area()
}

/// Weights of `at` in a counter-clockwise triangle, `None` outside. The signs are exact, so that neighbouring triangles
/// leave no gap.
pub(crate) fn inside([a, b, c]: [[f64; 2]; 3], at: [f64; 2]) -> Option<[f64; 3]> {
    let wa = orientation([b, c, at]);
    let wb = orientation([c, a, at]);
    let wc = orientation([a, b, at]);
    if wa < 0.0 || wb < 0.0 || wc < 0.0 {
        return None;
    }
    let sum = wa + wb + wc;
    (sum > 0.0).then(|| [wa / sum, wb / sum, wc / sum])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares of side 1, the second moved over the first by a little.
    #[test]
    fn overlaps_count_from_what_rounding_cannot_make() {
        let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        for (over, expected) in [(-0.1, 0), (0.0, 0), (1e-15, 0), (1e-12, 1), (0.1, 2)] {
            let square = |x: f64| [[x, 0.0], [x + 1.0, 0.0], [x + 1.0, 1.0], [x, 1.0]];
            let uv: Vec<[f64; 2]> = square(0.0).into_iter().chain(square(1.0 - over)).collect();
            let (pairs, area) = Grid::new(&uv, &faces, [2.0, 1.0]).overlap(&uv, &faces);
            assert!(pairs >= expected && (pairs > 0) == (expected > 0), "{over}: {pairs}");
            let exact = if expected > 0 { over } else { 0.0 };
            assert!((area - exact).abs() <= 1e-3 * exact, "{over}: {area}");
        }
    }
}
