//! The map beside a frame: does it show what the camera saw?

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::ray_cast::{DepthComparison, RayCastSettings};
use tsdf_hash::{DenseMap, Settings};

use super::decode::Images;
use super::error::ScanError;
use super::sequence::Sequence;

/// The map, seen from where a frame was taken, beside that frame.
#[derive(Debug, Clone, Copy)]
pub struct RayCastCheck {
    /// Processor time of the ray cast, seconds.
    pub seconds: f64,
    /// How far what is seen is from what was measured.
    pub depth: DepthComparison,
}

/// `None` if the map has no surface where the frame has one.
pub(super) fn ray_cast_check(
    map: &mut dyn DenseMap,
    sequence: &Sequence,
    images: &Images,
    pose: &Isometry3<f64>,
) -> Result<Option<RayCastCheck>, ScanError> {
    let depth = images.depth(sequence.intrinsics, sequence.depth_scale);
    let &Settings { min_depth, max_depth, threads, .. } = map.settings();
    let settings = RayCastSettings { min_depth, max_depth, colour: true, threads };
    let start = ProcessTime::now();
    let view = map.ray_cast(&depth.intrinsics, depth.width, depth.height, pose, &settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let found = view.compare(&depth, [min_depth, max_depth]);
    Ok(found.map(|depth| RayCastCheck { seconds, depth }))
}
