//! The nearest point of a surface, looked up cell by cell.

use nalgebra::{Point3, Vector3};

use super::oriented_point::{OrientedPoint, cell};
use crate::blocks::block_key::BlockKey;
use crate::blocks::block_table::BlockTable;

/// Cells to each side of a point in which it is looked for.
const REACH: i32 = 3;

/// For every cell near the surface the point that is nearest to its middle.
pub(super) struct NearestPoints {
    spacing: f64,
    pub(super) points: Vec<OrientedPoint>,
    /// Number of the point, and its squared distance from the middle of the cell.
    cells: BlockTable<(u32, f32)>,
}

impl NearestPoints {
    pub(super) fn new(points: Vec<OrientedPoint>, spacing: f64) -> Self {
        let mut cells: BlockTable<(u32, f32)> = BlockTable::new();
        for (number, point) in points.iter().enumerate() {
            let Some(own) = cell(&point.point, spacing) else { continue };
            let mut reach = |step: [i32; 3]| {
                let Some(key) = own.neighbour(step) else { return };
                let off = (middle(key, spacing) - point.point).norm_squared() as f32;
                match cells.get_mut(key) {
                    Some(nearest) if off < nearest.1 => *nearest = (number as u32, off),
                    Some(_) => {}
                    None => cells.insert(key, (number as u32, off)),
                }
            };
            for x in -REACH..=REACH {
                for y in -REACH..=REACH {
                    for z in -REACH..=REACH {
                        reach([x, y, z]);
                    }
                }
            }
        }
        Self { spacing, points, cells }
    }

    /// The nearest point but for the size of a cell; `None` where none is within some cells.
    pub(super) fn near(&self, point: &Point3<f64>) -> Option<&OrientedPoint> {
        let (number, _) = self.cells.get(cell(point, self.spacing)?)?;
        self.points.get(*number as usize)
    }
}

fn middle(key: BlockKey, spacing: f64) -> Point3<f64> {
    let [x, y, z] = key.block().map(|c| (f64::from(c) + 0.5) * spacing);
    Point3::from(Vector3::new(x, y, z))
}
