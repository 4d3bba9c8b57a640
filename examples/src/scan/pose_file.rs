//! Poses of a recording from a file beside it: what an odometry or a motion capture has written.

use std::path::Path;

use nalgebra::Isometry3;
use vio_ekf::{Stamp, Trajectory};

use super::error::SequenceError;
use super::sequence::Sequence;

/// Between stamps that are farther apart nothing is interpolated, seconds (ours).
const LONGEST_GAP: f64 = 0.5;

/// Gives the frames the poses of a TUM file (`stamp x y z qx qy qz qw`, the same clock), interpolated at their stamps, in place of those
/// recorded; frames that it does not cover have none. `body_from_camera` is where the camera is on what the file follows. Returns how
/// many frames have a pose.
///
/// # Errors
/// [`SequenceError`]; a file that covers no frame is one.
pub(super) fn take_poses(
    sequence: &mut Sequence,
    path: &Path,
    body_from_camera: &Isometry3<f64>,
) -> Result<usize, SequenceError> {
    let text = std::fs::read_to_string(path).map_err(|e| SequenceError::unreadable(path, &e))?;
    let trajectory = vio_ekf::format::tum::read(&text).map_err(|e| SequenceError::malformed(path, 0, e.to_string()))?;
    let mut found = 0;
    for frame in &mut sequence.frames {
        frame.world_from_camera = pose_at(&trajectory, frame.stamp).map(|pose| pose * body_from_camera);
        frame.lost = false;
        found += usize::from(frame.world_from_camera.is_some());
    }
    if found == 0 {
        let seconds = |span: Option<(f64, f64)>| span.map_or("none".into(), |(a, b)| format!("{a:.3} to {b:.3} s"));
        let images = sequence.frames.first().zip(sequence.frames.last()).map(|(a, b)| (a.stamp, b.stamp));
        let poses = trajectory.span().map(|(a, b)| (a.as_secs(), b.as_secs()));
        let why = format!("its stamps ({}) are not those of the images ({})", seconds(poses), seconds(images));
        return Err(SequenceError::malformed(path, 0, why));
    }
    Ok(found)
}

fn pose_at(trajectory: &Trajectory, seconds: f64) -> Option<Isometry3<f64>> {
    let stamp = Stamp::from_secs(seconds).ok()?;
    let stamps = trajectory.stamps();
    let next = stamps.partition_point(|s| *s < stamp);
    let after = stamps.get(next)?;
    let is_near = *after == stamp || next.checked_sub(1).is_some_and(|k| after.secs_since(stamps[k]) <= LONGEST_GAP);
    is_near.then(|| trajectory.pose_at(stamp).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_lie_between_neighbours_and_not_in_gaps() {
        let stamps = [1.0, 1.4, 2.0].map(|time| Stamp::from_secs(time).unwrap()).to_vec();
        let poses = [0.0, 4.0, 10.0].map(|x| Isometry3::translation(x, 0.0, 0.0)).to_vec();
        let trajectory = Trajectory::new(stamps, poses).unwrap();
        let x = |time: f64| pose_at(&trajectory, time).map(|pose| (1e6 * pose.translation.x).round() / 1e6);
        assert_eq!([x(1.0), x(1.1), x(1.4)], [Some(0.0), Some(1.0), Some(4.0)]);
        // 0.6 s apart: nothing between them, the end itself.
        assert_eq!([x(1.5), x(1.999), x(2.0)], [None, None, Some(10.0)]);
        assert_eq!([x(0.999), x(2.001), x(f64::NAN)], [None; 3]);
    }
}
