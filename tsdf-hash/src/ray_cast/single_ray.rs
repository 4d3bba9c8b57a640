//! One ray, for planners and simulators that ask for a place rather than for an image.

use nalgebra::{Point3, Unit, Vector3};

use crate::blocks::block_key::BlockKey;
use crate::blocks::trilinear::TrilinearCell;
use crate::blocks::voxel_block::VoxelBlock;
use crate::settings::Settings;

/// Steps between two looks where the distance is not known, and least steps near the surface, voxels.
const STEP: f64 = 0.5;
/// Steps by the distance are shortened by this share: it is a mean of several views.
const CAUTION: f64 = 0.8;

/// Where a ray meets the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// From the origin, metres.
    pub distance: f64,
    /// In the world.
    pub point: Point3<f64>,
    /// Of unit length, towards the free side.
    pub normal: Unit<Vector3<f64>>,
}

/// The first place where the distance falls through zero along a ray, among the blocks that `block` finds.
pub(crate) fn cast<'a>(
    settings: &Settings,
    block: impl Fn(BlockKey) -> Option<&'a VoxelBlock> + Copy,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
    max_distance: f64,
) -> Option<SurfaceHit> {
    let direction = Unit::try_new(*direction, 1e-12)?;
    let h = settings.voxel_size;
    let at = |t: f64| origin + direction.into_inner() * t;
    let value = |t: f64| TrilinearCell::around(settings, block, &at(t)).map(|cell| cell.distance());
    let exists = |p: &Point3<f64>| {
        let corner = p.coords.map(|c| (c / settings.block_size()).floor());
        let known = corner.iter().all(|c| c.abs() < f64::from(1 << 20));
        known && BlockKey::new([0, 1, 2].map(|k| corner[k] as i32)).is_some_and(|key| block(key).is_some())
    };
    let (mut t, mut before) = (0.0, None);
    // A comparison that a NaN fails.
    while t <= max_distance {
        let here = value(t);
        match (before, here) {
            (Some((near, above)), Some(below)) if below < 0.0 => {
                let t: f64 = near + (t - near) * above / (above - below);
                let gradient = TrilinearCell::around(settings, block, &at(t))?.gradient();
                let normal = Unit::try_new(gradient, 1e-12)?;
                return (normal.dot(&direction) < 0.0).then(|| SurfaceHit { distance: t, point: at(t), normal });
            }
            // Solid that was never seen from this side.
            (None, Some(below)) if below < 0.0 => return None,
            _ => {}
        }
        before = here.map(|d| (t, d));
        t += match here {
            Some(d) => (CAUTION * d).max(STEP * h),
            None if exists(&at(t)) => STEP * h,
            // A block that is not there cannot hold a surface; its neighbours may begin half a voxel inside it.
            None => (to_next_block(&at(t), &direction, settings.block_size()) - h).max(STEP * h),
        };
    }
    None
}

/// How far a ray goes until it leaves the block of a point.
fn to_next_block(point: &Point3<f64>, direction: &Vector3<f64>, side: f64) -> f64 {
    let along = |k: usize| {
        let inside = point[k] - (point[k] / side).floor() * side;
        let left = if direction[k] > 0.0 { side - inside } else { inside };
        left / direction[k].abs().max(1e-12)
    };
    along(0).min(along(1)).min(along(2))
}
