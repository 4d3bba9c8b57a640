//! Trilinear interpolation of the distance between eight voxels.

use nalgebra::{Point3, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::voxel_block::{SIDE, VoxelBlock};
use crate::settings::Settings;

/// Eight voxels around a point.
pub(crate) struct TrilinearCell {
    /// Distances, metres; entry `n` is the upper voxel along x (bit 0), y (bit 1), z (bit 2).
    corners: [f64; 8],
    /// Where the point lies between them, `0..1`.
    along: Vector3<f64>,
}

impl TrilinearCell {
    /// The voxels in the blocks that `block` finds; `None` unless all were observed.
    pub(crate) fn around<'a>(
        settings: &Settings,
        block: impl Fn(BlockKey) -> Option<&'a VoxelBlock>,
        point_in_world: &Point3<f64>,
    ) -> Option<Self> {
        let (voxel, low, low_voxel) = lowest_voxel(settings, point_in_world)?;
        let base = low_voxel.map(|c| c.div_euclid(SIDE as i32));
        let local = low_voxel.map(|c| c.rem_euclid(SIDE as i32) as usize);
        // Most cells lie in one block, and no block is looked up twice.
        let mut blocks: [Option<&VoxelBlock>; 8] = [None; 8];
        let mut corners = [0.0; 8];
        for (n, corner) in corners.iter_mut().enumerate() {
            let at = [0, 1, 2].map(|k| local[k] + (n >> k & 1));
            let step = at.map(|c| c / SIDE);
            let place = step[0] | step[1] << 1 | step[2] << 2;
            let found = match blocks[place] {
                Some(found) => found,
                None => block(BlockKey::new([0, 1, 2].map(|k| base[k] + step[k] as i32))?)?,
            };
            blocks[place] = Some(found);
            let [x, y, z] = at.map(|c| c % SIDE);
            *corner = settings.truncation() * f64::from(found.mean(x + SIDE * (y + SIDE * z))?);
        }
        Some(Self { corners, along: voxel - low })
    }

    /// The blocks that [`around`](Self::around) asks for.
    pub(crate) fn blocks(settings: &Settings, point_in_world: &Point3<f64>) -> Vec<BlockKey> {
        let Some((_, _, low_voxel)) = lowest_voxel(settings, point_in_world) else { return Vec::new() };
        let block_of = |n: usize| [0, 1, 2].map(|k| (low_voxel[k] + (n >> k & 1) as i32).div_euclid(SIDE as i32));
        let mut keys: Vec<BlockKey> = (0..8).filter_map(|n| BlockKey::new(block_of(n))).collect();
        keys.sort_unstable();
        keys.dedup();
        keys
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

    /// The gradient of the interpolation, metres per voxel.
    pub(crate) fn gradient(&self) -> Vector3<f64> {
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

/// A point in voxels from the first voxel's centre, the centre below it along all axes, and that one's number.
#[inline(always)]
fn lowest_voxel(settings: &Settings, point_in_world: &Point3<f64>) -> Option<(Vector3<f64>, Vector3<f64>, [i32; 3])> {
    let voxel = point_in_world.coords / settings.voxel_size - Vector3::repeat(0.5);
    let low = voxel.map(f64::floor);
    // A NaN fails; beyond this the key would fail later, and the cast must not saturate.
    low.iter().all(|c| c.abs() <= f64::from(1 << 24)).then(|| (voxel, low, [0, 1, 2].map(|k| low[k] as i32)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial with a term of its own for every axis and product, by its value and its partial derivatives.
    #[test]
    fn distance_and_gradient_are_those_of_the_polynomial() {
        let value = |x: f64, y: f64, z: f64| {
            1.0 + 2.0 * x - 3.0 * y + 5.0 * z + 7.0 * x * y - 11.0 * y * z + 13.0 * z * x + 17.0 * x * y * z
        };
        let corners = std::array::from_fn(|n| value((n & 1) as f64, (n >> 1 & 1) as f64, (n >> 2 & 1) as f64));
        for [x, y, z] in [[0.0, 0.0, 0.0], [0.25, 0.5, 0.75], [0.9, 0.1, 0.3], [1.0, 0.0, 1.0]] {
            let cell = TrilinearCell { corners, along: Vector3::new(x, y, z) };
            let slopes = Vector3::new(
                2.0 + 7.0 * y + 13.0 * z + 17.0 * y * z,
                -3.0 + 7.0 * x - 11.0 * z + 17.0 * z * x,
                5.0 - 11.0 * y + 13.0 * x + 17.0 * x * y,
            );
            assert!((cell.distance() - value(x, y, z)).abs() < 1e-12);
            assert!((cell.gradient() - slopes).norm() < 1e-12, "{} for {slopes}", cell.gradient());
        }
    }
}
