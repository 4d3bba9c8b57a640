//! Rays and projections of one view, in voxels.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::blocks::voxel_block::SIDE;
use crate::error::Error;
use crate::images::{Intrinsics, check_pose, check_sides};
use crate::ray_cast::settings::RayCastSettings;
use crate::settings::Settings;

/// Coordinates count voxel centres, so that the corners of a cell are integers, and start at a corner of the camera's own
/// block: single precision then is fine wherever the camera is.
pub(crate) struct Camera {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Block of the camera.
    pub(crate) base: [i32; 3],
    /// The camera, in voxels from the first voxel of `base`.
    origin: [f32; 3],
    /// Voxels per metre of depth: columns for one pixel along a row, one along a column, and for pixel (0, 0).
    rays: Matrix3<f64>,
    /// `(u z, v z, z)` in metres from voxels relative to the camera.
    projection: Matrix3<f64>,
    /// Normals of the four sides and the front of the view, inwards, of unit length.
    sides: [Vector3<f64>; 5],
    pub(crate) min_depth: f32,
    pub(crate) max_depth: f32,
    /// Truncation distance in voxels.
    pub(crate) truncation: f32,
}

impl Camera {
    pub(crate) fn new(
        k: &Intrinsics,
        (width, height): (usize, usize),
        world_from_camera: &Isometry3<f64>,
        map: &Settings,
        settings: &RayCastSettings,
    ) -> Result<Self, Error> {
        settings.check()?;
        check_sides("view", width, height)?;
        k.check("view")?;
        check_pose(world_from_camera)?;
        let h = map.voxel_size;
        let position = world_from_camera.translation.vector / h - Vector3::repeat(0.5);
        let block = position.map(|c| (c / SIDE as f64).floor());
        if block.iter().any(|c| c.abs() > f64::from(1 << 21)) {
            return Err(Error::OutOfRange);
        }
        let rotation = world_from_camera.rotation.to_rotation_matrix().into_inner();
        let camera_from_pixels =
            Matrix3::new(1.0 / k.fx, 0.0, -k.cx / k.fx, 0.0, 1.0 / k.fy, -k.cy / k.fy, 0.0, 0.0, 1.0);
        let pixels_from_camera = Matrix3::new(k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0);
        let projection = pixels_from_camera * rotation.transpose() * h;
        // A point is inside where u >= -1/2, u <= width - 1/2 and so on, in front; all linear in (u z, v z, z).
        let [u, v, z] = [0, 1, 2].map(|row| projection.row(row).transpose());
        let (right, bottom) = (width as f64 - 0.5, height as f64 - 0.5);
        Ok(Self {
            width,
            height,
            base: [0, 1, 2].map(|k| block[k] as i32),
            origin: (position - block * SIDE as f64).cast::<f32>().into(),
            rays: rotation * camera_from_pixels / h,
            projection,
            sides: [u + z * 0.5, z * right - u, v + z * 0.5, z * bottom - v, z].map(|n| n.normalize()),
            min_depth: settings.min_depth as f32,
            max_depth: settings.max_depth as f32,
            truncation: map.truncation_voxels as f32,
        })
    }

    /// Whether a ball, relative to the camera and in voxels, may be in the image.
    pub(crate) fn sees(&self, centre: [f32; 3], radius: f64) -> bool {
        let centre = Vector3::from(centre.map(f64::from));
        let along = self.projection.row(2).transpose();
        let (depth, reach) = (along.dot(&centre), radius * along.norm());
        self.sides.iter().all(|n| n.dot(&centre) >= -radius)
            && depth + reach >= f64::from(self.min_depth)
            && depth - reach <= f64::from(self.max_depth)
    }

    /// The pixels that a box may cover, `[first u, first v, last u, last v]`; the box is given relative to the camera.
    pub(crate) fn cover(&self, low: &[f32; 3], high: &[f32; 3]) -> Option<[usize; 4]> {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut behind = false;
        for n in 0..8 {
            let corner = Vector3::from([0, 1, 2].map(|k| f64::from(if n >> k & 1 == 1 { high[k] } else { low[k] })));
            let p = self.projection * corner;
            behind |= p.z < 0.5 * f64::from(self.min_depth);
            for k in 0..2 {
                let at = p[k] / p.z;
                (least[k], most[k]) = (least[k].min(at), most[k].max(at));
            }
        }
        let size = [self.width, self.height];
        if behind {
            return Some([0, 0, size[0] - 1, size[1] - 1]);
        }
        let mut range = [0; 4];
        for k in 0..2 {
            // A little more, for the rounding of the rays.
            let (first, last) = ((least[k] - 0.01).ceil(), (most[k] + 0.01).floor());
            if last < 0.0 || first >= size[k] as f64 || first > last {
                return None;
            }
            range[k] = first.max(0.0) as usize;
            range[k + 2] = (last as usize).min(size[k] - 1);
        }
        Some(range)
    }

    /// Direction of the rays at the left end of a row, and its change per pixel, voxels per metre of depth.
    pub(crate) fn row(&self, v: usize) -> ([f32; 3], [f32; 3]) {
        let start = self.rays.column(2) + self.rays.column(1) * v as f64;
        (start.cast::<f32>().into(), self.rays.column(0).into_owned().cast::<f32>().into())
    }

    /// From the camera to the first voxel of a block, voxels.
    pub(crate) fn offset(&self, block: [i32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|k| ((block[k] - self.base[k]) * SIDE as i32) as f32 - self.origin[k])
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn a_ray_projects_onto_its_pixel() {
        let k = Intrinsics { fx: 70.0, fy: -80.0, cx: 30.3, cy: 21.0 };
        let pose = Isometry3::new(Vector3::new(3.0, -41.0, 0.7), Vector3::new(0.3, -0.4, 1.0));
        let map = Settings { voxel_size: 0.02, ..Settings::default() };
        let camera = Camera::new(&k, (64, 48), &pose, &map, &RayCastSettings::default()).unwrap();
        let (start, step) = camera.row(7);
        let point = [0, 1, 2].map(|k| 1.7 * (start[k] + 11.0 * step[k]));
        assert_eq!(camera.cover(&point, &point), Some([11, 7, 11, 7]));
        // The same point by the rigid motion: u = 11 and v = 7 at a depth of 1.7 m.
        let in_camera = Point3::new((11.0 - k.cx) / k.fx, (7.0 - k.cy) / k.fy, 1.0) * 1.7;
        let expected = (pose * in_camera).coords / 0.02 - Vector3::repeat(0.5);
        for k in 0..3 {
            let found = f64::from(point[k] + camera.origin[k]) + 8.0 * f64::from(camera.base[k]);
            assert!((found - expected[k]).abs() < 1e-3);
        }
    }
}
