//! Distances at points.

use nalgebra::{Point3, Vector3};

use crate::block::{Block, SIDE};
use crate::key::Key;
use crate::{Map, Settings};

impl Map {
    /// Signed distance from the nearest surface, metres, by trilinear interpolation; `None` where one of the eight voxels
    /// around the point was never observed (farther than `μ` from every surface, behind one, or unseen).
    pub fn distance(&self, point_in_world: &Point3<f64>) -> Option<f64> {
        Cell::around(self.settings(), |key| self.store().get(key), point_in_world).map(|cell| cell.distance())
    }

    /// [`distance`](Self::distance), and its gradient in the world: the exact one of the interpolation, of length about
    /// one near a surface, away from it. It jumps where the point passes from one cell of voxels to the next.
    pub fn distance_and_gradient(&self, point_in_world: &Point3<f64>) -> Option<(f64, Vector3<f64>)> {
        let cell = Cell::around(self.settings(), |key| self.store().get(key), point_in_world)?;
        Some((cell.distance(), cell.gradient() / self.settings().voxel_size))
    }
}

/// Eight voxels around a point.
pub(crate) struct Cell {
    /// Distances, metres; entry `n` is the upper voxel along x (bit 0), y (bit 1), z (bit 2).
    corners: [f64; 8],
    /// Where the point lies between them, `0..1`.
    along: Vector3<f64>,
}

impl Cell {
    /// The voxels in the blocks that `block` finds; `None` unless all were observed.
    pub(crate) fn around<'a>(
        settings: &Settings,
        block: impl Fn(Key) -> Option<&'a Block>,
        point_in_world: &Point3<f64>,
    ) -> Option<Self> {
        let voxel = point_in_world.coords / settings.voxel_size - Vector3::repeat(0.5);
        let low = voxel.map(f64::floor);
        // A NaN fails; beyond this the key would fail below, and the cast must not saturate.
        if !low.iter().all(|c| c.abs() <= f64::from(1 << 24)) {
            return None;
        }
        let low_voxel = [0, 1, 2].map(|k| low[k] as i32);
        let base = low_voxel.map(|c| c.div_euclid(SIDE as i32));
        let local = low_voxel.map(|c| c.rem_euclid(SIDE as i32) as usize);
        // Most cells lie in one block, and no block is looked up twice.
        let mut blocks: [Option<&Block>; 8] = [None; 8];
        let mut corners = [0.0; 8];
        for (n, corner) in corners.iter_mut().enumerate() {
            let at = [0, 1, 2].map(|k| local[k] + (n >> k & 1));
            let step = at.map(|c| c / SIDE);
            let place = step[0] | step[1] << 1 | step[2] << 2;
            let found = match blocks[place] {
                Some(found) => found,
                None => block(Key::new([0, 1, 2].map(|k| base[k] + step[k] as i32))?)?,
            };
            blocks[place] = Some(found);
            let [x, y, z] = at.map(|c| c % SIDE);
            *corner = settings.truncation() * f64::from(found.mean(x + SIDE * (y + SIDE * z))?);
        }
        Some(Self { corners, along: voxel - low })
    }

    /// Interpolated, metres.
    pub(crate) fn distance(&self) -> f64 {
        let mut values = self.corners;
        for (axis, half) in [4, 2, 1].into_iter().enumerate() {
            for k in 0..half {
                values[k] = values[2 * k] + self.along[axis] * (values[2 * k + 1] - values[2 * k]);
            }
        }
        values[0]
    }

    /// Metres per voxel.
    fn gradient(&self) -> Vector3<f64> {
        Vector3::from([0, 1, 2].map(|axis| {
            // Differences along the axis, weighted by the other two.
            let (one, two) = ((axis + 1) % 3, (axis + 2) % 3);
            let share = |k: usize, upper: usize| if upper == 1 { self.along[k] } else { 1.0 - self.along[k] };
            (0..4)
                .map(|n| {
                    let (a, b) = (n & 1, n >> 1);
                    let corner = a << one | b << two;
                    share(one, a) * share(two, b) * (self.corners[corner | 1 << axis] - self.corners[corner])
                })
                .sum::<f64>()
        }))
    }
}
