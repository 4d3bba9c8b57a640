//! How far motions that were measured can be wrong, one after the other.

use nalgebra::Isometry3;

use crate::pose_graph::factors::BetweenFactor;
use crate::pose_graph::robust_kernel::RobustKernel;

/// Standard deviations that every motion of the odometry has at least, radians and metres.
const ODOMETRY_FLOOR: [f64; 2] = [1e-3, 2e-3];
/// Of a motion that was registered, radians and metres.
const REGISTERED: [f64; 2] = [1.5e-3, 3e-3];
/// So many standard deviations of the gathered error are believed (ours).
pub(crate) const WORST: f64 = 3.0;

/// Standard deviations of the turn and the shift of a motion by odometry with an error that is a share of it.
pub(crate) fn deviations(share: f64, motion: &Isometry3<f64>) -> [f64; 2] {
    let size = [motion.rotation.angle(), motion.translation.vector.norm()];
    [0, 1].map(|k| ODOMETRY_FLOOR[k] + share * size[k])
}

/// The largest error, radians and metres, that the motions between two keyframes can have gathered.
pub(crate) fn largest_error(
    poses: &[Isometry3<f64>],
    betweens: &[BetweenFactor],
    share: f64,
    [old, present]: [usize; 2],
) -> [f64; 2] {
    let is_registered =
        |k: usize| betweens.iter().any(|f| f.first == k && f.second == k + 1 && f.kernel != RobustKernel::Squared);
    let [mut turn, mut shift] = [0.0_f64; 2];
    for k in old..present {
        let [own_turn, own_shift] =
            if is_registered(k) { REGISTERED } else { deviations(share, &(poses[k].inverse() * poses[k + 1])) };
        // A turn moves all that comes after it.
        let arm = (poses[present].translation.vector - poses[k + 1].translation.vector).norm();
        turn += own_turn.powi(2);
        shift += own_shift.powi(2) + (own_turn * arm).powi(2);
    }
    [turn, shift].map(|variance| WORST * variance.sqrt())
}
