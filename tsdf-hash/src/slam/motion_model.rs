//! Where the camera is believed to be before a frame is looked at.

use nalgebra::{Isometry3, Vector3};

use crate::slam::gyroscope::Gyroscope;
use crate::tracking::outcome::{PosePrior, TrackingOutcome};

/// A frame's stamp, and the pose that came with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StampedPose {
    /// Seconds.
    pub stamp: f64,
    /// Where odometry, or whatever knows, has the camera; in a world of its own.
    pub world_from_camera: Option<Isometry3<f64>>,
}

/// The error of odometry from one frame to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct OdometryError {
    /// Standard deviation of the turn about each axis, radians (ours: half a degree).
    pub turn: f64,
    /// Standard deviation of the shift along each axis, metres (ours: 0.01).
    pub shift: f64,
}

impl Default for OdometryError {
    fn default() -> Self {
        Self { turn: 0.5_f64.to_radians(), shift: 0.01 }
    }
}

/// Frames farther apart than so many intervals have others missing between them (ours).
const LONGEST_STEP: f64 = 3.5;
/// Standard deviations of a turn by the gyroscope, radians, and of a shift at constant velocity, metres, from one frame to the next (ours).
const LED_BY_GYROSCOPE: [f64; 2] = [5e-3, 0.1];

/// The last pose, and how it goes on from there: by odometry where it was recorded, else at constant velocity, turned as the gyroscope says
/// where there is one.
#[derive(Debug)]
pub struct MotionModel {
    odometry: Option<OdometryError>,
    /// Without samples it says nothing.
    pub(crate) gyroscope: Gyroscope,
    /// Seconds from frame to frame.
    interval: f64,
    pub(crate) last: Option<PosePrior>,
    /// The frame that `last` belongs to.
    pub(crate) then: Option<StampedPose>,
    /// The pose before the last one; `None` where the last one was not found.
    pub(crate) before: Option<Isometry3<f64>>,
}

impl MotionModel {
    /// With the error of the odometry, if there is one, and the seconds from frame to frame.
    pub fn new(odometry: Option<OdometryError>, interval: f64) -> Self {
        Self { odometry, gyroscope: Gyroscope::new(), interval, last: None, then: None, before: None }
    }

    /// Goes on from a pose that is known; `frame` is the one that was taken there, if one was.
    pub fn start(&mut self, pose: Isometry3<f64>, frame: Option<&StampedPose>) {
        self.last = Some(PosePrior { world_from_camera: pose, covariance: None });
        (self.before, self.then) = (None, frame.copied());
    }

    /// Whether no pose is known yet, or all were forgotten.
    pub fn is_empty(&self) -> bool {
        self.last.is_none()
    }

    /// The last pose.
    pub(crate) fn last(&self) -> Option<Isometry3<f64>> {
        self.last.map(|last| last.world_from_camera)
    }

    /// Whether odometry was recorded.
    pub(crate) fn has_odometry(&self) -> bool {
        self.odometry.is_some()
    }

    /// Whether frames are missing before this one, and no odometry says where the camera has gone.
    pub fn is_gap(&self, frame: &StampedPose) -> bool {
        self.steps(frame).is_some_and(|steps| steps > LONGEST_STEP) && !self.is_led(frame)
    }

    /// Whether odometry says where the camera is.
    pub fn is_led(&self, frame: &StampedPose) -> bool {
        self.by_odometry(frame).is_some()
    }

    /// Where a frame was taken, as far as what came before it says, the likelier first; empty before the first frame.
    pub fn priors(&self, frame: &StampedPose) -> Vec<PosePrior> {
        let Some(last) = &self.last else { return Vec::new() };
        if let Some(prior) = self.by_odometry(frame) {
            return vec![prior];
        }
        let stopped = last.world_from_camera;
        let before = self.before.as_ref();
        let shift = before.map(|before| stopped.translation.vector - before.translation.vector);
        let shifts = shift.into_iter().chain([Vector3::zeros()]);
        let led: Vec<PosePrior> = shifts.filter_map(|shift| self.by_gyroscope(frame, shift)).collect();
        if !led.is_empty() {
            return led;
        }
        let onwards = before.map(|before| stopped * (before.inverse() * stopped));
        let guess = |world_from_camera| PosePrior { world_from_camera, covariance: None };
        onwards.into_iter().chain([stopped]).map(guess).collect()
    }

    /// Where the camera is if it moves back as it came; `None` without two poses.
    pub(crate) fn turned_back(&self) -> Option<PosePrior> {
        Some(PosePrior { world_from_camera: self.before?, covariance: None })
    }

    /// Intervals since the last frame.
    fn steps(&self, frame: &StampedPose) -> Option<f64> {
        Some((frame.stamp - self.then?.stamp) / self.interval)
    }

    /// On by a motion, whose error per frame grows with the frames that are missing.
    fn on_by(&self, frame: &StampedPose, motion: &Isometry3<f64>, deviations: [f64; 2]) -> Option<PosePrior> {
        let steps = self.steps(frame)?.round().max(1.0);
        Some(self.last?.after(motion, deviations.map(|deviation| deviation * steps.sqrt())))
    }

    fn by_odometry(&self, frame: &StampedPose) -> Option<PosePrior> {
        let OdometryError { turn, shift } = self.odometry?;
        let (from, to) = (self.then?.world_from_camera?, frame.world_from_camera?);
        // Thesis Paper I, Eq. (5.1), with the poses of the camera in place of those of the inertial unit.
        self.on_by(frame, &(from.inverse() * to), [turn, shift])
    }

    /// Turned as the gyroscope says, and shifted by so much from each frame to the next, in the world.
    fn by_gyroscope(&self, frame: &StampedPose, shift: Vector3<f64>) -> Option<PosePrior> {
        let turn = self.gyroscope.turn(self.then?.stamp, frame.stamp)?;
        let along = self.last?.world_from_camera.rotation.inverse() * shift * self.steps(frame)?;
        self.on_by(frame, &Isometry3::from_parts(along.into(), turn), LED_BY_GYROSCOPE)
    }

    /// A frame was found; `earlier` is where the frame before it was taken, if that is known only now. `lost`: the one before it was not found.
    pub fn found(
        &mut self,
        outcome: &TrackingOutcome,
        earlier: Option<Isometry3<f64>>,
        frame: &StampedPose,
        lost: bool,
    ) {
        if let (Some(then), Some(last)) = (self.then, &self.last)
            && !lost
            && outcome.degenerate.is_empty()
        {
            let turn = last.world_from_camera.rotation.inverse() * outcome.world_from_camera.rotation;
            self.gyroscope.learn(then.stamp, frame.stamp, &turn);
        }
        self.before = earlier.or(self.last.map(|last| last.world_from_camera));
        (self.last, self.then) = (Some(outcome.pose()), Some(*frame));
        self.gyroscope.forget_before(frame.stamp);
    }

    /// A frame was not found: odometry leads on, velocity does not; a gyroscope still knows the turn.
    pub fn lost(&mut self, frame: &StampedPose) {
        self.before = None;
        if let Some(prior) = self.by_odometry(frame).or_else(|| self.by_gyroscope(frame, Vector3::zeros())) {
            (self.last, self.then) = (Some(prior), Some(*frame));
        }
    }

    /// The camera has been somewhere else.
    pub fn forget(&mut self) {
        (self.last, self.then, self.before) = (None, None, None);
    }

    /// The map and all in it have moved.
    pub fn move_by(&mut self, correction: &Isometry3<f64>) {
        self.last = self.last.map(|last| last.seen_from(correction));
        self.before = self.before.map(|before| correction * before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(stamp: f64, x: f64) -> StampedPose {
        StampedPose { stamp, world_from_camera: Some(Isometry3::translation(x, 0.0, 0.0)) }
    }

    /// Variances of errors that do not know of each other add: over a gap of three frames, three of them; and of a frame that was lost.
    #[test]
    fn the_error_of_odometry_grows_over_a_gap() {
        let mut model = MotionModel::new(Some(OdometryError { turn: 0.01, shift: 0.02 }), 0.1);
        model.start(Isometry3::identity(), Some(&frame(5.0, 1.0)));
        let variance = |model: &MotionModel, frame: &StampedPose| {
            let prior = model.priors(frame)[0];
            assert!(
                (prior.world_from_camera.translation.x - (frame.world_from_camera.unwrap().translation.x - 1.0)).abs()
                    < 1e-12
            );
            prior.covariance.unwrap()[(3, 3)]
        };
        assert!((variance(&model, &frame(5.1, 1.5)) - 4e-4).abs() < 1e-12);
        assert!((variance(&model, &frame(5.3, 1.5)) - 12e-4).abs() < 1e-12);
        model.lost(&frame(5.1, 1.5));
        assert!((variance(&model, &frame(5.2, 1.7)) - 8e-4).abs() < 1e-12);
        // Without a recorded pose the motion before is all there is: none here.
        let unrecorded = StampedPose { world_from_camera: None, ..frame(5.2, 0.0) };
        assert!(model.priors(&unrecorded)[0].covariance.is_none());
    }
}
