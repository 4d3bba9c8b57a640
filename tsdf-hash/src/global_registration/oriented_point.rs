//! Points with normals, one for each cell of a lattice.

use nalgebra::{Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;

/// A point of a surface with its unit normal, which points to the free side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedPoint {
    /// The point, metres.
    pub point: Point3<f64>,
    /// The normal.
    pub normal: Vector3<f64>,
}

/// Sums of all points that lie in a cell.
#[derive(Clone, Copy, Default)]
struct Cell {
    point: Vector3<f64>,
    normal: Vector3<f64>,
    count: f64,
}

/// Points averaged in cells; their order is that in which the cells were reached.
pub(super) struct Lattice {
    size: f64,
    cells: BlockTable<Cell>,
}

impl Lattice {
    /// With cells of `size` metres.
    pub(super) fn new(size: f64) -> Self {
        Self { size, cells: BlockTable::new() }
    }

    /// Adds a point. What is farther than a million cells from the origin is left out.
    pub(super) fn add(&mut self, point: &Point3<f64>, normal: &Vector3<f64>) {
        let Some(key) = cell(point, self.size) else { return };
        if self.cells.get(key).is_none() {
            self.cells.insert(key, Cell::default());
        }
        if let Some(cell) = self.cells.get_mut(key) {
            cell.point += point.coords;
            cell.normal += normal;
            cell.count += 1.0;
        }
    }

    pub(super) fn points(&self) -> Vec<OrientedPoint> {
        let mean = |cell: &Cell| {
            let normal = cell.normal.try_normalize(1e-9)?;
            Some(OrientedPoint { point: (cell.point / cell.count).into(), normal })
        };
        self.cells.values().iter().filter_map(mean).collect()
    }
}

/// The cell of a point.
pub(super) fn cell(point: &Point3<f64>, size: f64) -> Option<BlockKey> {
    let scaled = point.coords / size;
    // Beyond, the numbers of cells would saturate.
    let near = scaled.iter().all(|c| c.abs() < 1e6);
    near.then(|| BlockKey::new([scaled.x, scaled.y, scaled.z].map(|c| c.floor() as i32))).flatten()
}
