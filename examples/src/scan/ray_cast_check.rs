//! The map beside a frame: does it show what the camera saw?

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use tsdf_hash::RayCastSettings;

use super::decode::Images;
use super::error::ScanError;
use super::map_store::MapStore;
use super::sequence::Sequence;

/// The map, seen from where a frame was taken, beside that frame.
#[derive(Debug, Clone, Copy)]
pub struct RayCastCheck {
    /// Processor time of the ray cast, seconds.
    pub seconds: f64,
    /// Mean distance between the depth cast and the depth measured, over the pixels that have both, metres.
    pub depth_error: f64,
    /// Share of the measured pixels at which the map has a surface.
    pub fill: f64,
}

/// `None` if the map has no surface where the frame has one.
pub(super) fn ray_cast_check(
    store: &mut MapStore,
    sequence: &Sequence,
    images: &Images,
    pose: &Isometry3<f64>,
) -> Result<Option<RayCastCheck>, ScanError> {
    let depth = images.depth(sequence.intrinsics, sequence.depth_scale);
    let &tsdf_hash::Settings { min_depth, max_depth, threads, .. } = store.settings();
    let settings = RayCastSettings { min_depth, max_depth, colour: true, threads };
    let start = ProcessTime::now();
    let view = store.dense().ray_cast(&depth.intrinsics, depth.width, depth.height, pose, &settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let measured = images.metres(sequence.depth_scale).map(|z| Some(z).filter(|z| (min_depth..=max_depth).contains(z)));
    let (mut pixels, mut hits, mut error) = (0_usize, 0_usize, 0.0);
    for (z, seen) in measured.zip(&view.depth).filter_map(|(z, seen)| Some((z?, *seen))) {
        pixels += 1;
        if seen > 0.0 {
            hits += 1;
            error += (f64::from(seen) - z).abs();
        }
    }
    let check = RayCastCheck { seconds, depth_error: error / hits as f64, fill: hits as f64 / pixels as f64 };
    Ok(Some(check).filter(|_| hits > 0))
}
