//! What a camera has seen around a place that it does not know.

use nalgebra::{Isometry3, Point3, Vector3};

use super::oriented_point::{Lattice, OrientedPoint};
use crate::error::Error;
use crate::images::{DepthData, DepthView, check_pose};

/// Every so many pixels along each side one is taken, and slopes are taken over so many to both sides.
const STRIDE: usize = 3;
const REACH: usize = 4;
/// Neighbours whose depth differs by more than this share are on another surface.
const STEEPEST: f64 = 0.1;

/// Points with normals from depth images whose poses to each other are known, by odometry or by tracking.
pub struct LocalCloud {
    lattice: Lattice,
}

impl LocalCloud {
    /// Nothing seen; points are averaged over cells of `spacing` metres.
    pub fn new(spacing: f64) -> Self {
        Self { lattice: Lattice::new(spacing) }
    }

    /// Adds a depth image, as far as it shows what is within `farthest` metres.
    ///
    /// # Errors
    /// An image or a pose that makes no sense.
    pub fn add(&mut self, depth: &DepthView, local_from_camera: &Isometry3<f64>, farthest: f64) -> Result<(), Error> {
        depth.check()?;
        check_pose(local_from_camera)?;
        let point = |u: usize, v: usize| {
            let k = &depth.intrinsics;
            let z = metres(depth, v * depth.width + u);
            // A comparison that a NaN fails.
            let seen = z > 0.0 && z <= farthest;
            seen.then(|| Vector3::new((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy, 1.0) * z)
        };
        for v in (REACH..depth.height.saturating_sub(REACH)).step_by(STRIDE) {
            for u in (REACH..depth.width.saturating_sub(REACH)).step_by(STRIDE) {
                let Some(here) = point(u, v) else { continue };
                let near = |u, v| point(u, v).filter(|there| (there.z - here.z).abs() <= STEEPEST * here.z);
                let across = near(u + REACH, v).zip(near(u - REACH, v)).map(|(right, left)| right - left);
                let down = near(u, v + REACH).zip(near(u, v - REACH)).map(|(below, above)| below - above);
                let Some((across, down)) = across.zip(down) else { continue };
                let Some(normal) = across.cross(&down).try_normalize(1e-12) else { continue };
                // It points to the camera, however the image lies.
                let normal = if normal.dot(&here) > 0.0 { -normal } else { normal };
                self.lattice.add(&(local_from_camera * Point3::from(here)), &(local_from_camera * normal));
            }
        }
        Ok(())
    }

    /// The points.
    pub fn points(&self) -> Vec<OrientedPoint> {
        self.lattice.points()
    }
}

fn metres(depth: &DepthView, at: usize) -> f64 {
    match depth.data {
        DepthData::U16 { data, .. } if data[at] == u16::MAX => 0.0,
        DepthData::U16 { data, scale } => f64::from(data[at]) / scale,
        DepthData::F32 { data } => f64::from(data[at]),
    }
}
