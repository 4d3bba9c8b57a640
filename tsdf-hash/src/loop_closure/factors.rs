//! Motions as factors of the pose graph.

use nalgebra::{Isometry3, Matrix3, Matrix6};

use crate::loop_closure::error_growth::deviations;
use crate::pose_graph::factors::BetweenFactor;
use crate::pose_graph::robust_kernel::RobustKernel;
use crate::tracking::outcome::TrackingOutcome;
use crate::tracking::pose::rotated;

/// Standard deviations that every registration has at least, radians and metres.
const FLOOR: [f64; 2] = [2e-4, 4e-4];
/// Of the kernel of loops: chi-squared of six degrees of freedom, 99 %.
pub(crate) const LOOP_KERNEL: f64 = 16.81;
/// Of the kernel of motions measured between neighbours, in standard deviations.
const STEP_KERNEL: f64 = 3.0;

/// The motion between consecutive keyframes, as good as odometry is.
pub(crate) fn odometry(poses: &[Isometry3<f64>], share: f64, first: usize) -> BetweenFactor {
    let first_from_second = poses[first].inverse() * poses[first + 1];
    let information = diagonal(deviations(share, &first_from_second).map(|s| s.powi(-2)));
    BetweenFactor { first, second: first + 1, first_from_second, information, kernel: RobustKernel::Squared }
}

/// A keyframe registered against another one that stands at `pose`, in the same world.
pub(crate) fn registered(
    pose: &Isometry3<f64>,
    outcome: &TrackingOutcome,
    [first, second]: [usize; 2],
    is_loop: bool,
) -> BetweenFactor {
    let registered = outcome.world_from_camera;
    // From the axes of the world to those of the camera.
    let own = rotated(&outcome.covariance, &registered.rotation.inverse());
    let covariance = own + diagonal(FLOOR.map(|s| s.powi(2)));
    let information = covariance.try_inverse().unwrap_or_else(Matrix6::zeros);
    let kernel =
        if is_loop { RobustKernel::DynamicCovarianceScaling(LOOP_KERNEL) } else { RobustKernel::Huber(STEP_KERNEL) };
    BetweenFactor {
        first,
        second,
        first_from_second: pose.inverse() * registered,
        information: 0.5 * (information + information.transpose()),
        kernel,
    }
}

/// Turn before shift.
fn diagonal([turn, shift]: [f64; 2]) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * turn));
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * shift));
    out
}
