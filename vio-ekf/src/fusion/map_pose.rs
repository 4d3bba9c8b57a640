//! A pose in a map, and where it leads.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::samples::Imu;
use crate::stamp::Stamp;

/// A pose with the velocities since the one before: m/s and rad/s along the world's axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct MapPose {
    pub(super) stamp: Stamp,
    pub(super) world_from_body: Isometry3<f64>,
    pub(super) velocity: Vector3<f64>,
    rate: Vector3<f64>,
    /// Time of the pose before.
    pub(super) since: Stamp,
}

impl MapPose {
    /// After another one; at rest without.
    pub(super) fn next(before: Option<Self>, stamp: Stamp, world_from_body: Isometry3<f64>) -> Self {
        let since = |before: Self| {
            let dt = stamp.secs_since(before.stamp).max(1e-3);
            let way = world_from_body.translation.vector - before.world_from_body.translation.vector;
            let turn = (world_from_body.rotation * before.world_from_body.rotation.inverse()).scaled_axis();
            (way / dt, turn / dt)
        };
        let (velocity, rate) = before.map_or_else(Default::default, since);
        let since = before.map_or(stamp, |before| before.stamp);
        Self { stamp, world_from_body, velocity, rate, since }
    }

    /// The same with the velocity at its own time in place of the mean since the pose before, by the inertial samples between (ours): the
    /// mean of `v(t1) - v(s)` over `s` in `t0..t1` is the integral of `(s - t0) a(s) / (t1 - t0)`.
    pub(super) fn with_velocity_by(self, samples: &[Imu], gravity: f64) -> Self {
        let duration = self.stamp.secs_since(self.since);
        let within = |pair: &&[Imu]| pair[0].stamp >= self.since && pair[1].stamp <= self.stamp;
        let gain = samples.windows(2).filter(within).map(|pair| {
            let sample = &pair[1];
            let acceleration = self.after(sample.stamp).rotation * sample.accel - Vector3::z() * gravity;
            let [since, step] = [self.since, pair[0].stamp].map(|stamp| sample.stamp.secs_since(stamp));
            acceleration * ((since - 0.5 * step) / duration * step)
        });
        Self { velocity: self.velocity + gain.sum::<Vector3<f64>>(), ..self }
    }

    /// The pose at another time, at constant velocities.
    pub(super) fn after(&self, stamp: Stamp) -> Isometry3<f64> {
        let dt = stamp.secs_since(self.stamp);
        let rotation = UnitQuaternion::from_scaled_axis(self.rate * dt) * self.world_from_body.rotation;
        Isometry3::from_parts((self.world_from_body.translation.vector + self.velocity * dt).into(), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_body_that_turns_and_accelerates_the_velocity_is_that_at_the_later_pose() {
        // x = 0.4 t³, so that neither acceleration nor velocity is constant; it turns about z, and the samples are in its axes.
        let at = |millis: i64| Stamp::from_nanos(1_000_000 * millis);
        let pose = |t: f64| Isometry3::new(Vector3::new(0.4 * t.powi(3), 0.0, 1.0), Vector3::new(0.0, 0.0, 2.0 * t));
        let before = MapPose::next(None, at(900), pose(0.9));
        let sample = |millis: i64| {
            let t = 1e-3 * millis as f64;
            let force = Vector3::new(2.4 * t, 0.0, 9.81);
            let accel = pose(t).rotation.inverse() * force;
            Imu { stamp: at(millis), gyro: Vector3::new(0.0, 0.0, 2.0), accel }
        };
        let samples: Vec<Imu> = (800..1100).step_by(2).map(sample).collect();
        let mean = MapPose::next(Some(before), at(1000), pose(1.0));
        let now = mean.with_velocity_by(&samples, 9.81);
        assert!((mean.velocity.x - 1.084).abs() < 1e-9, "{}", mean.velocity);
        assert!((now.velocity - Vector3::new(1.2, 0.0, 0.0)).norm() < 4e-3, "{}", now.velocity);
    }
}
