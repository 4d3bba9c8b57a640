//! What tracking a frame gave.

use nalgebra::{Isometry3, Matrix3xX, Matrix6, Vector6};

use crate::tracking::pose::{moved, rotated, step};

/// What is believed about a pose before the frame is looked at.
#[derive(Clone, Copy, Debug)]
pub struct PosePrior {
    /// The pose.
    pub world_from_camera: Isometry3<f64>,
    /// Its covariance, in the order and frame of [`TrackingOutcome::covariance`]: a pose too far from the prior is rejected, and along
    /// degenerate directions the prior is kept. `None` for a guess, as of constant velocity: then neither is done.
    pub covariance: Option<Matrix6<f64>>,
}

impl PosePrior {
    /// The prediction by odometry (thesis Paper I, Eq. (5.1)): where a camera that was here is after it has moved by
    /// `before_from_now`, whose turn and shift have these standard deviations about and along each axis, radians and metres. Without a
    /// covariance of the pose before, that one is taken as exact.
    #[must_use]
    pub fn after(&self, before_from_now: &Isometry3<f64>, [turn, shift]: [f64; 2]) -> Self {
        let arm = self.world_from_camera.rotation * before_from_now.translation.vector;
        let mut world_from_camera = self.world_from_camera * before_from_now;
        world_from_camera.rotation.renormalize();
        // A turn before the motion moves its end.
        let mut carried = Matrix6::identity();
        carried.fixed_view_mut::<3, 3>(3, 0).copy_from(&-arm.cross_matrix());
        let before = self.covariance.unwrap_or_else(Matrix6::zeros);
        let own = Vector6::new(turn, turn, turn, shift, shift, shift).map(|deviation| deviation * deviation);
        let covariance = carried * before * carried.transpose() + Matrix6::from_diagonal(&own);
        Self { world_from_camera, covariance: Some(covariance) }
    }

    /// What prior and frame say together: their mean by information. The prior alone of a frame that is not tracked; the outcome alone
    /// without a covariance of the prior, and where a frame leaves directions open, because along these it is the prior already.
    #[must_use]
    pub fn fused(&self, outcome: &TrackingOutcome) -> Self {
        if !outcome.is_tracked() {
            return *self;
        }
        let information = |covariance: &Matrix6<f64>| covariance.cholesky().map(|c| c.inverse());
        let own = self.covariance.as_ref().and_then(information);
        let (Some(own), Some(seen), true) = (own, information(&outcome.covariance), outcome.degenerate.is_empty())
        else {
            return outcome.pose();
        };
        let Some(covariance) = information(&(own + seen)) else { return outcome.pose() };
        let way = covariance * (seen * step(&self.world_from_camera, &outcome.world_from_camera));
        Self { world_from_camera: moved(&self.world_from_camera, &way), covariance: Some(covariance) }
    }

    /// The same in a world that `there` leads to.
    #[must_use]
    pub fn seen_from(&self, there: &Isometry3<f64>) -> Self {
        Self {
            world_from_camera: there * self.world_from_camera,
            covariance: self.covariance.map(|covariance| rotated(&covariance, &there.rotation)),
        }
    }
}

/// Whether the pose can be believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackingStatus {
    /// Yes.
    Tracked,
    /// Too little of the model is measured.
    NoOverlap,
    /// Too little of what is measured agrees with the model.
    Disagreement,
    /// The pose is too far from the prior for the covariances of both (chi-squared of six degrees of freedom, 99 %).
    Rejected,
    /// Frame and model agree, but along some directions ([`TrackingOutcome::degenerate`]) neither the frame nor the prior says where the camera
    /// is: before a wall, along a corridor. The pose is a guess along these.
    Degenerate,
}

/// A direction with less of a turn, of one, is a shift (ours).
const PURE_SHIFT: f64 = 0.2;

/// The result of [`Tracker::track`](crate::tracking::Tracker::track).
#[derive(Clone, Debug)]
pub struct TrackingOutcome {
    /// Whether the pose can be believed; if not, the pose is the prior's, of a degenerate frame along the degenerate directions.
    pub status: TrackingStatus,
    /// The pose.
    pub world_from_camera: Isometry3<f64>,
    /// Covariance of `(ω, v)`, where the true pose is `(exp(ω) R, t + v)`: a turn, radians, and a shift, metres, both along
    /// the axes of the world. Along degenerate directions it is the prior's, or 1 rad² and 1 m².
    pub covariance: Matrix6<f64>,
    /// Unit directions of `(mean depth · ω, v)` along which the frame says nothing; empty if it fixes the pose.
    pub degenerate: Vec<Vector6<f64>>,
    /// Share of the model's points for which the frame has a measurement: of depth, or of colour where it has none, as beyond the reach of
    /// the depth camera; of colour alone twice as many as of depth count at most.
    pub overlap: f64,
    /// Share of the frame's measurements that the model accounts for, about: where it is small, the rest of the frame has no say.
    pub coverage: f64,
    /// Share of the model's measured points that agree with the frame, within three standard deviations and half a voxel.
    pub agreement: f64,
    /// Standard deviation of the distances between partners, as a multiple of the noise model's.
    pub depth_scale: f64,
    /// Standard deviation of the intensities of partners, grey levels of 255; 0 if none were compared.
    pub intensity_scale: f64,
    /// Correlation of the intensities of map and frame, `-1..=1`; `None` without colour, or where the map is of one grey.
    pub likeness: Option<f64>,
    /// Iterations over all levels.
    pub iterations: usize,
}

impl TrackingOutcome {
    /// Whether the pose can be believed.
    pub fn is_tracked(&self) -> bool {
        self.status == TrackingStatus::Tracked
    }

    /// Whether frame and map agree, be it that nothing fixes some directions.
    pub(crate) fn is_on_the_map(&self) -> bool {
        matches!(self.status, TrackingStatus::Tracked | TrackingStatus::Degenerate)
    }

    /// Whether the frame leaves a shift open that no turn goes with.
    pub(crate) fn leaves_shift_open(&self) -> bool {
        if self.degenerate.is_empty() {
            return false;
        }
        let turns: Vec<_> = self.degenerate.iter().map(|direction| direction.fixed_rows::<3>(0).into_owned()).collect();
        let turns = Matrix3xX::from_columns(&turns);
        turns.ncols() > 3 || turns.singular_values().min() < PURE_SHIFT
    }

    /// The same in a world that `there` leads to.
    #[must_use]
    pub fn seen_from(mut self, there: &Isometry3<f64>) -> Self {
        self.world_from_camera = there * self.world_from_camera;
        self.covariance = rotated(&self.covariance, &there.rotation);
        let turn = there.rotation;
        for direction in &mut self.degenerate {
            let [about, along] = [0, 3].map(|first| turn * direction.fixed_rows::<3>(first).into_owned());
            direction.fixed_rows_mut::<3>(0).copy_from(&about);
            direction.fixed_rows_mut::<3>(3).copy_from(&along);
        }
        self
    }

    /// The pose and its covariance, to predict the next one from; a pose that is not tracked has that of the prior.
    pub fn pose(&self) -> PosePrior {
        PosePrior { world_from_camera: self.world_from_camera, covariance: Some(self.covariance) }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_motion_carries_the_covariance_on() {
        let pose = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.9, -0.4));
        let motion = Isometry3::new(Vector3::new(0.4, 0.1, -0.7), Vector3::new(-0.2, 0.1, 0.3));
        // A covariance of one direction: the true pose is off along it, before and after.
        let off: Vector6<f64> = 1e-4 * Vector6::new(1.0, -2.0, 0.5, 0.3, 1.5, -1.0);
        let before = PosePrior { world_from_camera: pose, covariance: Some(off * off.transpose()) };
        let after = before.after(&motion, [0.0; 2]);
        let moved_off = step(&after.world_from_camera, &(moved(&pose, &off) * motion));
        assert!((after.covariance.unwrap() - moved_off * moved_off.transpose()).amax() < 1e-11);
        // And in another world.
        let there = Isometry3::new(Vector3::new(0.0, 3.0, 1.0), Vector3::new(0.0, 1.2, 0.7));
        let elsewhere = after.seen_from(&there);
        let off_there = step(&elsewhere.world_from_camera, &(there * moved(&pose, &off) * motion));
        assert!((elsewhere.covariance.unwrap() - off_there * off_there.transpose()).amax() < 1e-11);
        // What the motion adds.
        let noisy = before.after(&motion, [0.01, 0.02]).covariance.unwrap() - after.covariance.unwrap();
        assert!((noisy.diagonal() - Vector6::new(1e-4, 1e-4, 1e-4, 4e-4, 4e-4, 4e-4)).amax() < 1e-15);
    }

    #[test]
    fn prior_and_frame_meet_by_their_information() {
        let pose = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.9, -0.4));
        let prior = PosePrior { world_from_camera: pose, covariance: Some(Matrix6::identity() * 3e-6) };
        let way = 1e-3 * Vector6::new(1.0, -2.0, 0.5, 0.3, 1.5, -1.0);
        let outcome = TrackingOutcome {
            status: TrackingStatus::Tracked,
            world_from_camera: moved(&pose, &way),
            covariance: Matrix6::identity() * 1e-6,
            degenerate: Vec::new(),
            overlap: 1.0,
            coverage: 1.0,
            agreement: 1.0,
            depth_scale: 1.0,
            intensity_scale: 1.0,
            likeness: None,
            iterations: 1,
        };
        let fused = prior.fused(&outcome);
        assert!((step(&pose, &fused.world_from_camera) - 0.75 * way).amax() < 1e-9);
        assert!((fused.covariance.unwrap() - Matrix6::identity() * 0.75e-6).amax() < 1e-15);
        let open = TrackingOutcome { degenerate: vec![Vector6::x()], ..outcome.clone() };
        assert_eq!(prior.fused(&open).world_from_camera, outcome.world_from_camera);
        let lost = TrackingOutcome { status: TrackingStatus::NoOverlap, ..outcome };
        assert_eq!(prior.fused(&lost).world_from_camera, pose);
    }
}
