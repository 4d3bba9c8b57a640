//! Where the camera is believed to be before a frame is looked at.

use nalgebra::{Isometry3, Point3, UnitQuaternion};
use tsdf_hash::{PosePrior, TrackingOutcome};

use super::gyroscope::Gyroscope;
use super::sequence::FrameFiles;

/// The error of recorded odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryError {
    /// Standard deviations of the turn, radians, and of the shift, metres, from one frame to the next, about and along each axis.
    pub deviations: [f64; 2],
    /// Seconds between two frames; a longer gap has the error of as many.
    pub interval: f64,
}

/// Frames farther apart than so many intervals have others missing between them (ours).
const LONGEST_STEP: f64 = 3.5;
/// Standard deviations of a turn by the gyroscope, radians, and of a shift at constant velocity, metres, from one frame to the next (ours).
const LED_BY_GYROSCOPE: [f64; 2] = [5e-3, 0.1];

/// The last pose, and how it goes on from there: by odometry where it was recorded, else at constant velocity, turned as the gyroscope says where there is one.
#[derive(Debug, Default)]
pub(super) struct Prediction {
    odometry: Option<OdometryError>,
    gyroscope: Option<Gyroscope>,
    /// When `last` was.
    stamp: Option<f64>,
    /// Frames since `last` was tracked were not: where the camera has gone since then no gyroscope knows.
    adrift: bool,
    last: Option<PosePrior>,
    /// The pose before the last one.
    before: Option<Isometry3<f64>>,
    /// Stamp and recorded pose of the frame that `last` belongs to.
    recorded: Option<(f64, Isometry3<f64>)>,
}

impl Prediction {
    pub(super) fn new(odometry: Option<OdometryError>, gyroscope: Option<Gyroscope>) -> Self {
        Self { odometry, gyroscope, ..Self::default() }
    }

    /// Goes on from a pose that is known.
    pub(super) fn start(&mut self, pose: Isometry3<f64>, frame: Option<&FrameFiles>) {
        self.last = Some(PosePrior { world_from_camera: pose, covariance: None });
        (self.before, self.recorded) = (None, frame.and_then(recorded));
        (self.stamp, self.adrift) = (frame.map(|frame| frame.stamp), false);
    }

    /// Whether frames are missing between the last one and this.
    pub(super) fn is_gap(&self, frame: &FrameFiles, interval: f64) -> bool {
        self.stamp.is_some_and(|stamp| frame.stamp - stamp > LONGEST_STEP * interval)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.last.is_none()
    }

    /// Where a frame was taken, as far as what came before it says, the likelier first; empty before the first frame.
    pub(super) fn priors(&self, frame: &FrameFiles) -> Vec<PosePrior> {
        let Some(last) = &self.last else { return Vec::new() };
        if let Some(prior) = self.by_odometry(last, frame) {
            return vec![prior];
        }
        let stopped = last.world_from_camera;
        if let Some(turn) = self.turn(frame) {
            let onwards = self.before.map(|before| {
                stopped.inverse_transform_point(&Point3::from(
                    2.0 * stopped.translation.vector - before.translation.vector,
                ))
            });
            let led = |to: Point3<f64>| {
                let prior = last.after(&Isometry3::from_parts(to.into(), turn), LED_BY_GYROSCOPE);
                PosePrior { covariance: prior.covariance.filter(|_| !self.adrift), ..prior }
            };
            return onwards.into_iter().chain([Point3::origin()]).map(led).collect();
        }
        let onwards = self.before.map(|before| stopped * (before.inverse() * stopped));
        let guess = |world_from_camera| PosePrior { world_from_camera, covariance: None };
        onwards.into_iter().chain([stopped]).map(guess).collect()
    }

    /// Of the camera since the last pose, by the gyroscope.
    fn turn(&self, frame: &FrameFiles) -> Option<UnitQuaternion<f64>> {
        self.gyroscope.as_ref()?.turn(self.stamp?, frame.stamp)
    }

    fn by_odometry(&self, last: &PosePrior, frame: &FrameFiles) -> Option<PosePrior> {
        let OdometryError { deviations, interval } = self.odometry?;
        let ((then, from), (now, to)) = (self.recorded?, recorded(frame)?);
        let frames = ((now - then) / interval).round().max(1.0);
        Some(last.after(&(from.inverse() * to), deviations.map(|deviation| deviation * frames.sqrt())))
    }

    /// A frame was found; `earlier` is where the frame before it was taken, if that is known only now.
    pub(super) fn found(&mut self, outcome: &TrackingOutcome, earlier: Option<Isometry3<f64>>, frame: &FrameFiles) {
        if let (Some(gyroscope), Some(then), Some(last), None, true) =
            (&mut self.gyroscope, self.stamp, &self.last, earlier, outcome.degenerate.is_empty() && !self.adrift)
        {
            let turn = last.world_from_camera.rotation.inverse() * outcome.world_from_camera.rotation;
            gyroscope.learn(then, frame.stamp, &turn);
        }
        self.before = earlier.or(self.last.map(|last| last.world_from_camera));
        (self.last, self.recorded) = (Some(outcome.pose()), recorded(frame));
        (self.stamp, self.adrift) = (Some(frame.stamp), false);
    }

    /// A frame was not found: odometry leads on, velocity does not; a gyroscope still knows the turn.
    pub(super) fn lost(&mut self, frame: &FrameFiles) {
        self.before = None;
        if let Some(prior) = self.last.as_ref().and_then(|last| self.by_odometry(last, frame)) {
            (self.last, self.recorded) = (Some(prior), recorded(frame));
        } else if let (Some(turn), Some(last)) = (self.turn(frame), &mut self.last) {
            last.world_from_camera.rotation *= turn;
            (self.stamp, self.adrift) = (Some(frame.stamp), true);
        }
    }

    /// The camera has been somewhere else.
    pub(super) fn forget(&mut self) {
        (self.last, self.before, self.recorded, self.stamp, self.adrift) = (None, None, None, None, false);
    }

    /// The map and all in it have moved.
    pub(super) fn move_by(&mut self, correction: &Isometry3<f64>) {
        self.last = self.last.map(|last| last.seen_from(correction));
        self.before = self.before.map(|before| correction * before);
    }
}

fn recorded(frame: &FrameFiles) -> Option<(f64, Isometry3<f64>)> {
    Some((frame.stamp, frame.world_from_camera?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::ImageSource;

    fn frame(stamp: f64, x: f64) -> FrameFiles {
        let depth = ImageSource::File("depth.png".into());
        FrameFiles {
            stamp,
            depth,
            colour: None,
            world_from_camera: Some(Isometry3::translation(x, 0.0, 0.0)),
            lost: false,
        }
    }

    /// Variances of errors that do not know of each other add: over a gap of three frames, three of them; and of a frame that was lost.
    #[test]
    fn the_error_of_odometry_grows_over_a_gap() {
        let error = OdometryError { deviations: [0.01, 0.02], interval: 0.1 };
        let mut prediction = Prediction::new(Some(error), None);
        prediction.start(Isometry3::identity(), Some(&frame(5.0, 1.0)));
        let variance = |prediction: &Prediction, frame: &FrameFiles| {
            let prior = prediction.priors(frame)[0];
            assert!(
                (prior.world_from_camera.translation.x - (frame.world_from_camera.unwrap().translation.x - 1.0)).abs()
                    < 1e-12
            );
            prior.covariance.unwrap()[(3, 3)]
        };
        assert!((variance(&prediction, &frame(5.1, 1.5)) - 4e-4).abs() < 1e-12);
        assert!((variance(&prediction, &frame(5.3, 1.5)) - 12e-4).abs() < 1e-12);
        prediction.lost(&frame(5.1, 1.5));
        assert!((variance(&prediction, &frame(5.2, 1.7)) - 8e-4).abs() < 1e-12);
        // Without a recorded pose the motion before is all there is: none here.
        let unrecorded = FrameFiles { world_from_camera: None, ..frame(5.2, 0.0) };
        assert!(prediction.priors(&unrecorded)[0].covariance.is_none());
    }
}
