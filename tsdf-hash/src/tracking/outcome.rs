//! What tracking a frame gave.

use nalgebra::{Isometry3, Matrix6, Vector6};

/// What is believed about a pose before the frame is looked at.
#[derive(Clone, Copy, Debug)]
pub struct PosePrior {
    /// The pose.
    pub world_from_camera: Isometry3<f64>,
    /// Its covariance, in the order and frame of [`TrackingOutcome::covariance`]: a pose too far from the prior is rejected, and along
    /// degenerate directions the prior is kept. `None` for a guess, as of constant velocity: then neither is done.
    pub covariance: Option<Matrix6<f64>>,
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
}

/// The result of [`Tracker::track`](crate::Tracker::track).
#[derive(Clone, Debug)]
pub struct TrackingOutcome {
    /// Whether the pose can be believed; if not, the pose is the prior's.
    pub status: TrackingStatus,
    /// The pose.
    pub world_from_camera: Isometry3<f64>,
    /// Covariance of `(ω, v)`, where the true pose is `(exp(ω) R, t + v)`: a turn, radians, and a shift, metres, both along
    /// the axes of the world. Along degenerate directions it is the prior's, or 1 rad² and 1 m².
    pub covariance: Matrix6<f64>,
    /// Unit directions of `(mean depth · ω, v)` along which the frame says nothing; empty if it fixes the pose.
    pub degenerate: Vec<Vector6<f64>>,
    /// Share of the model's points for which the frame has a measurement.
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
}
