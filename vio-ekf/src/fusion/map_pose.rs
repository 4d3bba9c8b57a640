//! A pose in a map, and where it leads.

use std::collections::VecDeque;

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
    pub(super) fn with_velocity_by(self, samples: &VecDeque<Imu>, gravity: f64) -> Self {
        let duration = self.stamp.secs_since(self.since);
        let within = |pair: &(&Imu, &Imu)| pair.0.stamp >= self.since && pair.1.stamp <= self.stamp;
        let gain = samples.iter().zip(samples.iter().skip(1)).filter(within).map(|(before, sample)| {
            let acceleration = self.after(sample.stamp).rotation * sample.accel - Vector3::z() * gravity;
            let [since, step] = [self.since, before.stamp].map(|stamp| sample.stamp.secs_since(stamp));
            acceleration * ((since - 0.5 * step) / duration * step)
        });
        Self { velocity: self.velocity + gain.sum::<Vector3<f64>>(), ..self }
    }

    /// The pose at a later time by the inertial samples since the one before it; at constant velocities where they do not reach back so far. Between
    /// two poses of the map a body may start to turn: a controller that is told otherwise swings.
    pub(super) fn later_by(&self, stamp: Stamp, samples: &VecDeque<Imu>, gravity: f64) -> Isometry3<f64> {
        let covered = samples.front().is_some_and(|first| first.stamp <= self.since);
        if !covered || self.since == self.stamp || stamp <= self.stamp {
            return self.after(stamp);
        }
        let Isometry3 { mut rotation, translation } = self.world_from_body;
        let (mut velocity, mut position) = (self.with_velocity_by(samples, gravity).velocity, translation.vector);
        let mut now = self.stamp;
        let next = samples.iter().filter(|sample| sample.stamp > self.stamp && sample.stamp <= stamp);
        // The last one holds until the end.
        let ends = next.clone().skip(1).map(|sample| sample.stamp).chain([stamp]);
        for (sample, until) in next.zip(ends) {
            let dt = until.secs_since(now);
            let acceleration = rotation * sample.accel - Vector3::z() * gravity;
            position += velocity * dt + acceleration * (0.5 * dt * dt);
            velocity += acceleration * dt;
            rotation *= UnitQuaternion::from_scaled_axis(sample.gyro * dt);
            now = until;
        }
        position += velocity * stamp.secs_since(now);
        Isometry3::from_parts(position.into(), rotation)
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
        let samples: VecDeque<Imu> = (800..1100).step_by(2).map(sample).collect();
        let mean = MapPose::next(Some(before), at(1000), pose(1.0));
        let now = mean.with_velocity_by(&samples, 9.81);
        assert!((mean.velocity.x - 1.084).abs() < 1e-9, "{}", mean.velocity);
        assert!((now.velocity - Vector3::new(1.2, 0.0, 0.0)).norm() < 4e-3, "{}", now.velocity);
        // A tenth of a second later, by the samples and not by the mean velocities.
        let [by_samples, straight] = [mean.later_by(at(1098), &samples, 9.81), mean.after(at(1098))];
        let off = |found: &Isometry3<f64>| (found.translation.vector - pose(1.098).translation.vector).norm();
        assert!(off(&by_samples) < 1.5e-3 && off(&straight) > 0.01, "{} {}", off(&by_samples), off(&straight));
        assert!(by_samples.rotation.angle_to(&pose(1.098).rotation) < 5e-3);
        let short: VecDeque<Imu> = samples.iter().copied().filter(|sample| sample.stamp > at(950)).collect();
        assert_eq!(mean.later_by(at(1098), &short, 9.81), straight);
    }
}
