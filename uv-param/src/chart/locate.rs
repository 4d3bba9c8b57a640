//! Which face covers a point of the chart: a uniform grid of candidate lists, decided by the exact predicate.

use super::SurfacePoint;
use crate::triangle::orientation;

/// Faces by grid cell, in compressed rows.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    columns: usize,
    rows: usize,
    cells_per_metre: f64,
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Grid {
    /// About as many cells as faces.
    pub(super) fn new(uv: &[[f64; 2]], faces: &[[u32; 3]], [width, height]: [f64; 2]) -> Self {
        let cells_per_metre = (faces.len() as f64 / (width * height)).sqrt().min(faces.len() as f64 / width);
        let columns = (width * cells_per_metre).ceil().max(1.0) as usize;
        let rows = (height * cells_per_metre).ceil().max(1.0) as usize;
        let mut grid = Self { columns, rows, cells_per_metre, starts: vec![0; columns * rows + 1], faces: Vec::new() };
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
        grid
    }

    fn cell_box(&self, corners: [[f64; 2]; 3]) -> [u32; 4] {
        let low = |k: usize| corners[0][k].min(corners[1][k]).min(corners[2][k]);
        let high = |k: usize| corners[0][k].max(corners[1][k]).max(corners[2][k]);
        let [left, bottom] = self.cell([low(0), low(1)]);
        let [right, top] = self.cell([high(0), high(1)]);
        [left as u32, bottom as u32, right as u32, top as u32]
    }

    /// Column and row of a point, the nearest cell for points outside.
    fn cell(&self, at: [f64; 2]) -> [usize; 2] {
        let index = |x: f64, count: usize| ((x * self.cells_per_metre) as usize).min(count - 1);
        [index(at[0], self.columns), index(at[1], self.rows)]
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

fn cells_of([left, bottom, right, top]: [u32; 4], columns: usize) -> impl Iterator<Item = usize> {
    (bottom..=top).flat_map(move |row| (left..=right).map(move |column| row as usize * columns + column as usize))
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
