//! Two trajectories to compare: a flight and what a drifting estimator makes of it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use vio_ekf::{Error, Stamp, Trajectory};

use crate::Rng;

/// Time between two poses, nanoseconds.
const INTERVAL: i64 = 10_000_000;

/// Truth and estimate of `count` poses at 100 Hz: a figure of eight, seen from a turned frame with millimetres of noise and
/// a slow drift.
///
/// # Errors
/// None that these poses are known to give; they are checked.
pub fn pair(count: usize) -> Result<(Trajectory, Trajectory), Error> {
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    let mut rng = Rng::new(7);
    let frame = Isometry3::new(Vector3::new(3.0, -1.0, 0.5), Vector3::new(0.0, 0.0, 0.8));
    let mut drift = Vector3::zeros();
    for k in 0..count {
        let t = k as f64 * INTERVAL as f64 * 1e-9;
        let position = Vector3::new(4.0 * (0.4 * t).sin(), 2.5 * (0.8 * t).sin(), 1.5 + 0.5 * (0.3 * t).cos());
        let attitude = UnitQuaternion::from_euler_angles(0.1 * (1.1 * t).sin(), 0.1 * (0.9 * t).cos(), 0.5 * t);
        let pose = Isometry3::from_parts(Translation3::from(position), attitude);
        drift += Vector3::from_fn(|_, _| rng.between(-1e-3, 1e-3));
        let noise = Vector3::from_fn(|_, _| rng.between(-5e-3, 5e-3));
        let turn = Vector3::from_fn(|_, _| rng.between(-5e-3, 5e-3));
        let stamp = Stamp::from_nanos(k as i64 * INTERVAL);
        truth.push(stamp, pose)?;
        let seen = frame * pose;
        let error = Isometry3::from_parts(Translation3::from(drift + noise), UnitQuaternion::from_scaled_axis(turn));
        let shifted = Translation3::from(error.translation.vector) * seen;
        estimate.push(stamp, Isometry3::from_parts(shifted.translation, shifted.rotation * error.rotation))?;
    }
    Ok((truth, estimate))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vio_ekf::eval::{Alignment, ate};

    /// Root mean squares by evo 1.38.1 (`peers/trajectory_peers.py`) on the files that `library_figures pair` writes.
    #[test]
    fn evo_finds_the_same_errors() {
        let (truth, estimate) = pair(10_000).unwrap();
        for (mode, metres, degrees) in [
            (Alignment::None, 4.06178421668066, 45.83644639073955),
            (Alignment::Se3, 0.041316376080295425, 0.2926500466261237),
            (Alignment::Sim3, 0.0412902897268599, 0.2926500466261237),
        ] {
            let error = ate(truth.poses(), estimate.poses(), mode).unwrap();
            assert!((error.position.rmse - metres).abs() < 1e-6, "{mode:?}: {}", error.position.rmse);
            assert!((error.orientation.rmse.to_degrees() - degrees).abs() < 1e-6);
        }
    }
}
