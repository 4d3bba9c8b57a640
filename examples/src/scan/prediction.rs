//! Where the camera is believed to be before a frame is looked at.

use nalgebra::{Isometry3, Vector3};
use tsdf_hash::{PosePrior, TrackingOutcome};

use super::gyroscope::Gyroscope;
use super::sequence::FrameFiles;

/// The error of recorded odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryError {
    /// Standard deviations of the turn, radians, and of the shift, metres, from one frame to the next, about and along each axis.
    pub deviations: [f64; 2],
}

/// Frames farther apart than so many intervals have others missing between them (ours).
const LONGEST_STEP: f64 = 3.5;
/// Standard deviations of a turn by the gyroscope, radians, and of a shift at constant velocity, metres, from one frame to the next (ours).
const LED_BY_GYROSCOPE: [f64; 2] = [5e-3, 0.1];

/// The last pose, and how it goes on from there: by odometry where it was recorded, else at constant velocity, turned as the gyroscope says
/// where there is one.
#[derive(Debug)]
pub(super) struct Prediction {
    odometry: Option<OdometryError>,
    gyroscope: Option<Gyroscope>,
    /// Seconds from frame to frame.
    interval: f64,
    last: Option<PosePrior>,
    /// Stamp and recorded pose of the frame that `last` belongs to.
    then: Option<(f64, Option<Isometry3<f64>>)>,
    /// The pose before the last one; `None` where the last one was not found.
    before: Option<Isometry3<f64>>,
}

impl Prediction {
    pub(super) fn new(odometry: Option<OdometryError>, gyroscope: Option<Gyroscope>, interval: f64) -> Self {
        Self { odometry, gyroscope, interval, last: None, then: None, before: None }
    }

    /// Goes on from a pose that is known.
    pub(super) fn start(&mut self, pose: Isometry3<f64>, frame: Option<&FrameFiles>) {
        self.last = Some(PosePrior { world_from_camera: pose, covariance: None });
        (self.before, self.then) = (None, frame.map(recorded));
    }

    pub(super) fn is_empty(&self) -> bool {
        self.last.is_none()
    }

    /// Whether frames are missing before this one, and no odometry says where the camera has gone.
    pub(super) fn is_gap(&self, frame: &FrameFiles) -> bool {
        self.steps(frame).is_some_and(|steps| steps > LONGEST_STEP) && !self.is_led(frame)
    }

    /// Whether odometry says where the camera is.
    pub(super) fn is_led(&self, frame: &FrameFiles) -> bool {
        self.by_odometry(frame).is_some()
    }

    /// Where a frame was taken, as far as what came before it says, the likelier first; empty before the first frame.
    pub(super) fn priors(&self, frame: &FrameFiles) -> Vec<PosePrior> {
        let Some(last) = &self.last else { return Vec::new() };
        if let Some(prior) = self.by_odometry(frame) {
            return vec![prior];
        }
        let stopped = last.world_from_camera;
        let before = self.before.as_ref();
        if self.gyroscope.is_some() {
            let shift = before.map(|before| stopped.translation.vector - before.translation.vector);
            let led: Vec<PosePrior> = shift
                .into_iter()
                .chain([Vector3::zeros()])
                .filter_map(|shift| self.by_gyroscope(frame, shift))
                .collect();
            if !led.is_empty() {
                return led;
            }
        }
        let onwards = before.map(|before| stopped * (before.inverse() * stopped));
        let guess = |world_from_camera| PosePrior { world_from_camera, covariance: None };
        onwards.into_iter().chain([stopped]).map(guess).collect()
    }

    /// Intervals since the last frame.
    fn steps(&self, frame: &FrameFiles) -> Option<f64> {
        Some((frame.stamp - self.then?.0) / self.interval)
    }

    /// On by a motion, whose error per frame grows with the frames that are missing.
    fn on_by(&self, frame: &FrameFiles, motion: &Isometry3<f64>, deviations: [f64; 2]) -> Option<PosePrior> {
        let steps = self.steps(frame)?.round().max(1.0);
        Some(self.last?.after(motion, deviations.map(|deviation| deviation * steps.sqrt())))
    }

    fn by_odometry(&self, frame: &FrameFiles) -> Option<PosePrior> {
        let OdometryError { deviations } = self.odometry?;
        let (from, to) = (self.then?.1?, frame.world_from_camera?);
        self.on_by(frame, &(from.inverse() * to), deviations)
    }

    /// Turned as the gyroscope says, and shifted by so much from each frame to the next, in the world.
    fn by_gyroscope(&self, frame: &FrameFiles, shift: Vector3<f64>) -> Option<PosePrior> {
        let turn = self.gyroscope.as_ref()?.turn(self.then?.0, frame.stamp)?;
        let along = self.last?.world_from_camera.rotation.inverse() * shift * self.steps(frame)?;
        self.on_by(frame, &Isometry3::from_parts(along.into(), turn), LED_BY_GYROSCOPE)
    }

    /// A frame was found; `earlier` is where the frame before it was taken, if that is known only now. `lost`: the one before it was not found.
    pub(super) fn found(
        &mut self,
        outcome: &TrackingOutcome,
        earlier: Option<Isometry3<f64>>,
        frame: &FrameFiles,
        lost: bool,
    ) {
        if let (Some(gyroscope), Some((then, _)), Some(last)) = (&mut self.gyroscope, self.then, &self.last)
            && !lost
            && outcome.degenerate.is_empty()
        {
            let turn = last.world_from_camera.rotation.inverse() * outcome.world_from_camera.rotation;
            gyroscope.learn(then, frame.stamp, &turn);
        }
        self.before = earlier.or(self.last.map(|last| last.world_from_camera));
        (self.last, self.then) = (Some(outcome.pose()), Some(recorded(frame)));
    }

    /// A frame was not found: odometry leads on, velocity does not; a gyroscope still knows the turn.
    pub(super) fn lost(&mut self, frame: &FrameFiles) {
        self.before = None;
        if let Some(prior) = self.by_odometry(frame).or_else(|| self.by_gyroscope(frame, Vector3::zeros())) {
            (self.last, self.then) = (Some(prior), Some(recorded(frame)));
        }
    }

    /// The camera has been somewhere else.
    pub(super) fn forget(&mut self) {
        (self.last, self.then, self.before) = (None, None, None);
    }

    /// The map and all in it have moved.
    pub(super) fn move_by(&mut self, correction: &Isometry3<f64>) {
        self.last = self.last.map(|last| last.seen_from(correction));
        self.before = self.before.map(|before| correction * before);
    }
}

fn recorded(frame: &FrameFiles) -> (f64, Option<Isometry3<f64>>) {
    (frame.stamp, frame.world_from_camera)
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
        let error = OdometryError { deviations: [0.01, 0.02] };
        let mut prediction = Prediction::new(Some(error), None, 0.1);
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
