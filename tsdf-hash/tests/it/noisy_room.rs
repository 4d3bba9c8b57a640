//! The room as a depth camera with noise sees it, and errors of poses.

use nalgebra::{Isometry3, Vector3};

use crate::random::Random;
use crate::scene::{Shot, room};
use crate::tracking::noisy;

/// Metres and radians between two poses.
pub(crate) fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), (a.rotation.inverse() * b.rotation).angle())
}

/// A direction.
pub(crate) fn unit(random: &mut Random) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.uniform() - 0.5).normalize()
}

/// A frame without noise.
pub(crate) fn shot(pose: Isometry3<f64>) -> Shot {
    Shot::take((320, 240), [262.5; 2], pose, |o, d| Some(room::hit(o, d)))
}

/// A frame with the noise of the depth camera.
pub(crate) fn seen(pose: Isometry3<f64>, random: &mut Random) -> Shot {
    let clean = shot(pose);
    Shot { depth: noisy(&clean, random), ..clean }
}

/// What takes poses to where they lie best over the true ones.
#[cfg(feature = "pose-graph")]
pub(crate) fn alignment(poses: &[Isometry3<f64>], truth: &[Isometry3<f64>]) -> Isometry3<f64> {
    let mut found = Isometry3::identity();
    // About the origin turns and shifts are not independent: again until nothing is left.
    for _ in 0..50 {
        let (mut turn, mut shift) = (Vector3::zeros(), Vector3::zeros());
        for (pose, truth) in poses.iter().zip(truth) {
            let pose = found * pose;
            turn += (truth.rotation * pose.rotation.inverse()).scaled_axis();
            shift += truth.translation.vector - pose.translation.vector;
        }
        let count = poses.len() as f64;
        found = Isometry3::new(shift / count, turn / count) * found;
    }
    found
}
