//! A chart as cells, in each of its turns.

use super::settings::PackSettings;
use crate::atlas::pack::bitmap::{Bitmap, Outline, scattered};
use crate::half_edges::{EdgeTable, half_edge};

/// What is packed: a shape in the plane, metres.
#[derive(Debug, Clone)]
pub(in crate::atlas) struct Piece {
    /// The edges around it, which lies left of them.
    pub(in crate::atlas) rim: Vec<[[f64; 2]; 2]>,
}

impl Piece {
    /// The union of triangles, of which each edge has one or two.
    pub(in crate::atlas) fn new(uv: &[[f64; 2]], faces: &[[u32; 3]]) -> Self {
        let table = EdgeTable::new(uv.len(), faces);
        let single = table.groups().filter(|group| group.len() == 1).map(|group| half_edge(faces, group[0] as usize));
        Self { rim: single.map(|(a, b)| [uv[a as usize], uv[b as usize]]).collect() }
    }
}

/// A chart in one of its turns.
pub(super) struct Shape {
    /// Cosine and sine.
    pub(super) turn: [f64; 2],
    /// Lower left corner of the turned chart, metres.
    pub(super) corner: [f64; 2],
    /// Columns and rows that it covers.
    pub(super) size: [usize; 2],
    pub(super) outline: Outline,
    /// With the gutter around it.
    pub(super) wide: Bitmap,
}

/// All charts in some turns, at one size of cells.
pub(super) struct Shapes {
    pub(super) turned: Vec<Vec<Shape>>,
    /// Cells that stay free around each.
    pub(super) gutter: usize,
    /// Cells that the charts cover with half of their gutter, each in its first turn.
    pub(super) cells: usize,
}

impl Shapes {
    /// Every piece in every turn that `wanted` lists for it.
    pub(super) fn new(
        pieces: &[Piece],
        settings: &PackSettings,
        texels_per_cell: usize,
        wanted: impl Fn(usize) -> Vec<usize>,
    ) -> Self {
        let cell = settings.texel_m * texels_per_cell as f64;
        let gutter = settings.gutter.div_ceil(texels_per_cell);
        let count = settings.turns.count();
        let turned: Vec<Vec<Shape>> = pieces
            .iter()
            .enumerate()
            .map(|(k, piece)| wanted(k).into_iter().map(|turn| shape(piece, turn, count, cell, gutter)).collect())
            .collect();
        let cells = turned.iter().filter_map(|turns| turns.first()).map(|shape| shape.wide.count()).sum();
        Self { turned, gutter, cells }
    }

    /// The same with outlines in an order in which places are found sooner. They are the same places, but less work, by which the search is measured.
    pub(super) fn quicker(mut self) -> Self {
        for shape in self.turned.iter_mut().flatten() {
            shape.outline = scattered(&shape.outline);
        }
        self
    }

    /// Columns that the widest chart needs at least.
    pub(super) fn narrowest(&self) -> usize {
        let least = |turns: &Vec<Shape>| turns.iter().map(|shape| shape.size[0]).min().unwrap_or(1);
        self.turned.iter().map(least).max().unwrap_or(1)
    }

    /// Rows that all charts take, one above the other.
    pub(super) fn pile(&self) -> usize {
        let tallest = |turns: &Vec<Shape>| turns.iter().map(|shape| shape.size[1]).max().unwrap_or(1);
        self.turned.iter().map(|turns| tallest(turns) + self.gutter).sum()
    }
}

fn shape(piece: &Piece, k: usize, count: usize, cell: f64, gutter: usize) -> Shape {
    let angle = std::f64::consts::TAU * k as f64 / count as f64;
    // Quarters must not round.
    let exact = |x: f64| if x.abs() < 1e-9 || x.abs() > 1.0 - 1e-9 { x.round() } else { x };
    let turn = [exact(angle.cos()), exact(angle.sin())];
    let turned =
        || piece.rim.iter().map(|edge| edge.map(|[u, v]| [turn[0] * u - turn[1] * v, turn[1] * u + turn[0] * v]));
    let extreme = |k: usize, pick: fn(f64, f64) -> f64| turned().map(|[from, _]| from[k]).reduce(pick).unwrap_or(0.0);
    let corner = [extreme(0, f64::min), extreme(1, f64::min)];
    let size = [extreme(0, f64::max) - corner[0], extreme(1, f64::max) - corner[1]];
    let cells = Bitmap::within(turned().map(|edge| edge.map(|p| [p[0] - corner[0], p[1] - corner[1]])), size, cell);
    Shape { turn, corner, size: [cells.columns, cells.rows], outline: cells.outline(), wide: cells.dilated(gutter) }
}
