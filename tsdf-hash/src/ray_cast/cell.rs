//! Trilinear interpolation in the cells of an unpacked block.

use crate::ray_cast::pixel::UNSEEN;
use crate::ray_cast::unpacked::{ALL, NODES};
use crate::rounding::{ROUNDER, max, min};

pub(crate) const Y: usize = NODES;
pub(crate) const Z: usize = NODES * NODES;
/// From the first node of a cell to the last one.
const SPAN: usize = 1 + Y + Z;

/// A cell and where in it a point lies, `0..=1` along each axis.
pub(crate) struct Cell {
    pub(crate) first: usize,
    pub(crate) along: [f32; 3],
}

impl Cell {
    /// The cell around a point, whose coordinates are brought into `0..=8`.
    #[inline(always)]
    pub(crate) fn at(point: [f32; 3]) -> Self {
        let mut first = 0;
        let mut along = [0.0; 3];
        for (k, stride) in [1, Y, Z].into_iter().enumerate() {
            let p = min(max(point[k], 0.0), 8.0);
            // Rounded half a voxel lower: the cell below, either of the two at a node.
            let shifted = min(p - 0.5, 7.0) + ROUNDER;
            along[k] = p - (shifted - ROUNDER);
            first += (shifted.to_bits().wrapping_sub(ROUNDER.to_bits()) as usize & 7) * stride;
        }
        Self { first, along }
    }

    #[inline(always)]
    fn corners(&self, distance: &[f32; ALL]) -> [f32; 8] {
        // One slice of known length spares eight checks.
        let c = &distance[self.first..=self.first + SPAN];
        [c[0], c[1], c[Y], c[Y + 1], c[Z], c[Z + 1], c[Z + Y], c[Z + Y + 1]]
    }

    /// The corners, as far as they are needed: NaN where the nearest one is unobserved.
    ///
    /// An observed voxel stands for the cube around it. In there, corners that were not observed take the value of their
    /// neighbour along x, else y, else z.
    #[cold]
    fn completed(&self, mut c: [f32; 8]) -> [f32; 8] {
        let [x, y, z] = self.along.map(|a| usize::from(a > 0.5));
        if c[x + 2 * y + 4 * z].is_nan() {
            return [f32::NAN; 8];
        }
        for stride in [1, 2, 4] {
            for k in 0..8 {
                if c[k].is_nan() {
                    c[k] = c[k ^ stride];
                }
            }
        }
        c
    }

    #[inline(always)]
    fn between(&self, c: &[f32; 8]) -> f32 {
        let [x, y, z] = self.along;
        let along_x = [0, 2, 4, 6].map(|k| c[k] + x * (c[k + 1] - c[k]));
        let along_y = [0, 2].map(|k| along_x[k] + y * (along_x[k + 1] - along_x[k]));
        along_y[0] + z * (along_y[1] - along_y[0])
    }

    /// The interpolated value; NaN if the nearest corner is.
    #[inline(always)]
    pub(crate) fn value(&self, distance: &[f32; ALL]) -> f32 {
        let c = self.corners(distance);
        let value = self.between(&c);
        if value.is_nan() { self.between(&self.completed(c)) } else { value }
    }

    /// The interpolated value, and its derivatives per voxel.
    #[inline(always)]
    pub(crate) fn value_and_gradient(&self, distance: &[f32; ALL]) -> (f32, [f32; 3]) {
        let c = self.corners(distance);
        let c = if self.between(&c).is_nan() { self.completed(c) } else { c };
        let [x, y, z] = self.along;
        let rise_x = [0, 2, 4, 6].map(|k| c[k + 1] - c[k]);
        let along_x = [0, 1, 2, 3].map(|k| c[2 * k] + x * rise_x[k]);
        let rise_y = [0, 2].map(|k| along_x[k + 1] - along_x[k]);
        let along_y = [0, 1].map(|k| along_x[2 * k] + y * rise_y[k]);
        let near = rise_x[0] + y * (rise_x[1] - rise_x[0]);
        let far = rise_x[2] + y * (rise_x[3] - rise_x[2]);
        let rise_z = along_y[1] - along_y[0];
        (along_y[0] + z * rise_z, [near + z * (far - near), rise_y[0] + z * (rise_y[1] - rise_y[0]), rise_z])
    }

    /// The node nearest to the point.
    #[inline(always)]
    pub(crate) fn nearest(&self) -> usize {
        let [x, y, z] = self.along.map(|a| usize::from(a > 0.5));
        self.first + x + Y * y + Z * z
    }

    /// Trilinear over the corners that have a colour, in sixteenths of a voxel.
    #[inline(always)]
    pub(crate) fn colour(&self, colours: &[u64; ALL]) -> [u8; 3] {
        let c = &colours[self.first..=self.first + SPAN];
        let [x, y, z] = self.along.map(|a| u64::from((a * 16.0 + ROUNDER).to_bits().wrapping_sub(ROUNDER.to_bits())));
        let row = |k: usize| (16 - x) * c[k] + x * c[k + 1];
        let layer = |k: usize| (16 - y) * row(k) + y * row(k + Y);
        // A lane holds up to 255 * 16 * 16 so far: four bits less make room for the last factor.
        let [near, far] = [layer(0), layer(Z)].map(|lanes| lanes >> 4 & 0x0fff_0fff_0fff_0fff);
        let sums = (16 - z) * near + z * far;
        let lane = |k: u32| (sums >> (16 * k) & 0xffff) as u32;
        match lane(3) {
            0 => UNSEEN,
            total => [0, 1, 2].map(|k| ((lane(k) + total / 2) / total).min(255) as u8),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(k: usize) -> [f32; 3] {
        [k % Y, k / Y % NODES, k / Z].map(|c| c as f32)
    }

    /// A product of linear functions is interpolated exactly.
    #[test]
    fn interpolates_what_is_linear_along_each_axis() {
        let f = |[x, y, z]: [f32; 3]| (1.0 + 0.5 * x) * (2.0 - 0.25 * y) * (0.5 + z);
        let mut field = [0.0; ALL];
        (0..ALL).for_each(|k| field[k] = f(node(k)));
        for p in [[0.0, 0.0, 0.0], [8.0, 8.0, 8.0], [3.0, 4.5, 7.25], [0.3, 7.9, 1.0], [7.5, 0.5, 2.0]] {
            let cell = Cell::at(p);
            let (value, gradient) = cell.value_and_gradient(&field);
            let [x, y, z] = p;
            let expected = [
                0.5 * (2.0 - 0.25 * y) * (0.5 + z),
                -0.25 * (1.0 + 0.5 * x) * (0.5 + z),
                (1.0 + 0.5 * x) * (2.0 - 0.25 * y),
            ];
            assert!((value - f(p)).abs() < 1e-4 && (cell.value(&field) - f(p)).abs() < 1e-4, "{p:?}");
            assert!((0..3).all(|k| (gradient[k] - expected[k]).abs() < 1e-4), "{p:?}: {gradient:?}");
        }
    }

    /// f = 1 + y + 2 z wherever x <= 4 has been observed; nothing beyond.
    #[test]
    fn an_observed_voxel_stands_for_the_cube_around_it() {
        let f = |[_, y, z]: [f32; 3]| 1.0 + y + 2.0 * z;
        let mut field = [f32::NAN; ALL];
        (0..ALL).filter(|k| node(*k)[0] <= 4.0).for_each(|k| field[k] = f(node(k)));
        for p in [[4.0, 2.3, 5.1], [4.25, 2.3, 5.1], [4.5, 7.5, 0.0]] {
            let cell = Cell::at(p);
            let (value, gradient) = cell.value_and_gradient(&field);
            assert!((cell.value(&field) - f(p)).abs() < 1e-4 && (value - f(p)).abs() < 1e-4, "{p:?}");
            assert!((0..3).all(|k| (gradient[k] - [0.0, 1.0, 2.0][k]).abs() < 1e-4), "{p:?}: {gradient:?}");
        }
        for p in [[4.51, 2.3, 5.1], [5.5, 2.3, 5.1]] {
            let cell = Cell::at(p);
            assert!(cell.value(&field).is_nan() && cell.value_and_gradient(&field).0.is_nan(), "{p:?}");
        }
        // One corner alone is enough for its own eighth of the cell.
        field.fill(f32::NAN);
        field[4 + 4 * Y + 4 * Z] = 0.5;
        assert_eq!(Cell::at([3.6, 4.4, 3.7]).value(&field), 0.5);
        assert!(Cell::at([3.6, 4.6, 3.4]).value(&field).is_nan());
    }

    #[test]
    fn colours_come_from_the_corners_that_have_one() {
        let lanes = |rgb: [u64; 3]| rgb[0] | rgb[1] << 16 | rgb[2] << 32 | 1 << 48;
        let mut colours = [0; ALL];
        assert_eq!(Cell::at([2.5, 2.5, 2.5]).colour(&colours), UNSEEN);
        colours[2 + 2 * Y + 2 * Z] = lanes([255, 0, 10]);
        assert_eq!(Cell::at([2.5, 2.75, 2.5]).colour(&colours), [255, 0, 10]);
        colours[3 + 2 * Y + 2 * Z] = lanes([0, 255, 10]);
        assert_eq!(Cell::at([2.25, 2.0, 2.0]).colour(&colours), [191, 64, 10]);
        colours.fill(lanes([255, 255, 255]));
        assert_eq!(Cell::at([5.3, 1.9, 7.7]).colour(&colours), [255; 3]);
    }
}
