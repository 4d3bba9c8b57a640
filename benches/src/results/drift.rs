//! Paper I, Fig. 5.5: a camera comes back, and what its odometry has drifted by is taken back from every pose.

use std::error::Error;

use nalgebra::{Isometry3, Vector3};
use tsdf_hash::Settings;
use tsdf_hash::loop_closure::LoopSettings;
use tsdf_hash::slam::{PoseSource, Slam, SlamSettings};

use super::extent::Extent;
use super::table::{Table, number};
use crate::room::RgbdFrame;

/// Images of a tour around the room, and of the way on over what was seen before.
const TOUR: usize = 72;
const AGAIN: usize = 18;
const VOXEL: f64 = 0.02;

/// What the odometry errs by from image to image (ours): 6 cm over the tour.
fn slip() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(1.2e-3, -0.8e-3, 0.6e-3), Vector3::new(2e-4, 7e-4, -3e-4))
}

/// Mean and largest error of the poses before and after, and both from image to image.
///
/// # Errors
/// What the system refuses.
pub fn tables(extent: Extent) -> Result<Vec<Table>, Box<dyn Error>> {
    let images = match extent {
        Extent::Whole => TOUR + AGAIN,
        Extent::Quick => 12,
    };
    let frames: Vec<RgbdFrame> = (0..images).map(|k| RgbdFrame::take(k, TOUR)).collect();
    let truth: Vec<Isometry3<f64>> = frames.iter().map(|frame| frame.world_from_camera).collect();
    let mut believed = vec![truth[0]];
    for step in truth.windows(2) {
        let moved = step[0].inverse() * step[1] * slip();
        believed.push(believed[believed.len() - 1] * moved);
    }
    let map = Settings { voxel_size: VOXEL, ..Settings::default() };
    let settings =
        SlamSettings { map, poses: PoseSource::Given, loops: Some(LoopSettings::default()), ..SlamSettings::default() };
    let mut slam = Slam::new(settings)?;
    for (k, (frame, pose)) in frames.iter().zip(&believed).enumerate() {
        slam.frame(k as f64 / 30.0, &frame.view(), None, Some(pose))?;
    }
    let corrected: Vec<Isometry3<f64>> = slam.finish()?.trajectory.into_iter().map(|(_, pose)| pose).collect();
    if corrected.len() != images {
        return Err(format!("{} of {images} images have a pose", corrected.len()).into());
    }
    let errors = [believed, corrected].map(|poses| errors(&poses, &truth));
    let mut table = Table::new("drift", &["poses", "error in the mean; mm", "largest; mm"]);
    for (name, errors) in ["by odometry", "loops closed"].into_iter().zip(&errors) {
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let largest = errors.iter().copied().fold(0.0, f64::max);
        table.row([name.into(), number(mean, 1), number(largest, 1)]);
    }
    let mut curve = Table::new("fig_5_5", &["image", "before_mm", "after_mm"]);
    for (k, (before, after)) in errors[0].iter().zip(&errors[1]).enumerate() {
        curve.row([k.to_string(), number(*before, 2), number(*after, 2)]);
    }
    Ok(vec![table, curve])
}

/// Distances of the positions from the true ones, millimetres. The first pose is held.
fn errors(poses: &[Isometry3<f64>], truth: &[Isometry3<f64>]) -> Vec<f64> {
    let off = |(pose, truth): (&Isometry3<f64>, &Isometry3<f64>)| {
        1e3 * (pose.translation.vector - truth.translation.vector).norm()
    };
    poses.iter().zip(truth).map(off).collect()
}
