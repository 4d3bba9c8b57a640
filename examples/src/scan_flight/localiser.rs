//! Where the robot is in the map that it makes: odometry predicts, the depth image corrects (thesis Paper I, section 4.1).

use nalgebra::Isometry3;
use tsdf_hash::tracking::{PosePrior, Tracker, TrackingSettings};
use tsdf_hash::{ColourView, DepthView, Map};

use super::error::ScanFlightError;

/// Standard deviations of the odometry from one image to the next, radians and metres (ours): so wide that its jumps are put right. With a
/// fifth of them the gate took them for faults of the tracker.
const ODOMETRY: [f64; 2] = [5e-3, 1.5e-2];

/// Poses of the camera in the map.
pub(super) struct Localiser {
    tracker: Tracker,
    /// The last pose in the map, and the same in the world of the odometry.
    last: Option<(PosePrior, Isometry3<f64>)>,
}

impl Localiser {
    pub(super) fn new(threads: usize) -> Result<Self, ScanFlightError> {
        let tracker = Tracker::new(TrackingSettings { threads, ..TrackingSettings::default() })?;
        Ok(Self { tracker, last: None })
    }

    /// The pose of an image whose pose is `odometry_from_camera` by odometry; of the first one it is `start`. Where the map says nothing,
    /// the motion by odometry since the last image is taken.
    pub(super) fn place(
        &mut self,
        map: &mut Map,
        depth: &DepthView,
        colour: &ColourView,
        odometry_from_camera: &Isometry3<f64>,
        start: &Isometry3<f64>,
    ) -> Result<Isometry3<f64>, ScanFlightError> {
        let pose = match &self.last {
            None => PosePrior { world_from_camera: *start, covariance: None },
            Some((last, before)) => {
                let prior = last.after(&(before.inverse() * odometry_from_camera), ODOMETRY);
                prior.fused(&self.tracker.track(map, depth, Some(colour), &prior)?)
            }
        };
        self.last = Some((pose, *odometry_from_camera));
        Ok(pose.world_from_camera)
    }
}
