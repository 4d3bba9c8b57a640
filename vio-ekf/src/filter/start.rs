use nalgebra::{Isometry3, Translation3, Unit, Vector2, Vector3};

use super::estimator::Estimator;
use super::patch::Patch;
use super::{Bearing, Track, Vio, Waiting, later, moving, points};
use crate::error::all_not_negative;
use crate::trajectory::is_finite;
use crate::{Error, Imu, Stamp};

/// A state to start from, and how far it may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Time of the state.
    pub stamp: Stamp,
    /// Pose; the world's z axis points up.
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body in its own axes, m/s.
    pub velocity_in_body: Vector3<f64>,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Bias of the accelerometer, m/s².
    pub accel_bias: Vector3<f64>,
    /// Standard deviations of the above.
    pub sigma: StartSigma,
}

impl Start {
    /// Refuses what is not finite, negative deviations, and a time before that of the latest inertial sample.
    pub(crate) fn check(&self, latest: Stamp) -> Result<(), Error> {
        if self.stamp < latest {
            return Err(Error::Late { what: "start", stamp: self.stamp, now: latest });
        }
        if !is_finite(&self.world_from_body) {
            return Err(Error::NonFinite { what: "start pose", index: 0 });
        }
        let vectors = [self.velocity_in_body, self.gyro_bias, self.accel_bias];
        if let Some(index) = vectors.iter().position(|v| v.iter().any(|v| !v.is_finite())) {
            return Err(Error::NonFinite { what: "start velocity or bias", index });
        }
        self.sigma.check()
    }
}

/// Standard deviations of a start, per axis. The errors of all quantities are taken as independent.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct StartSigma {
    /// Position, m. Position and yaw are what the filter measures from: zero unless the world was there before it.
    pub position: f64,
    /// Velocity, m/s.
    pub velocity: f64,
    /// Roll and pitch, rad.
    pub tilt: f64,
    /// Yaw, rad.
    pub yaw: f64,
    /// Gyroscope's bias, rad/s.
    pub gyro_bias: f64,
    /// Accelerometer's bias, m/s².
    pub accel_bias: f64,
}

impl Default for StartSigma {
    /// Ours: what a start at rest leaves open.
    fn default() -> Self {
        Self { position: 0.0, velocity: 0.05, tilt: 0.01, yaw: 0.0, gyro_bias: 0.005, accel_bias: 0.1 }
    }
}

impl StartSigma {
    /// Refuses deviations that are negative or not finite.
    pub fn check(&self) -> Result<(), Error> {
        all_not_negative(&[
            ("position", self.position),
            ("velocity", self.velocity),
            ("tilt", self.tilt),
            ("yaw", self.yaw),
            ("gyro_bias", self.gyro_bias),
            ("accel_bias", self.accel_bias),
        ])
    }
}

impl Vio {
    /// Starts from the means of a rest.
    pub(super) fn start_at_rest(&mut self) -> Result<(), Error> {
        let Some(sample) = self.last else { return Ok(()) };
        let off = |force: Vector3<f64>| (force.norm() - self.settings.gravity).abs();
        self.waiting = match () {
            () if !self.rest.is_steady(sample.stamp) => Waiting::ForSteadiness,
            () if self.rest.force().is_some_and(|force| off(force) > self.settings.rest.gravity_tolerance) => {
                Waiting::ForGravity
            }
            () => Waiting::ForStillImages,
        };
        if self.waiting != Waiting::ForStillImages || !self.rest.is_at_rest(sample.stamp) {
            return Ok(());
        }
        let Some(window) = self.rest.take_window() else { return Ok(()) };
        let sigma = StartSigma { velocity: self.settings.rest.velocity_sigma, tilt: 0.1, ..StartSigma::default() };
        // Level as far as the force tells; only its direction is used, the update below weighs it against the bias.
        let attitude = Bearing::new(&Unit::new_normalize(window.force)).level();
        self.start(&Start {
            stamp: sample.stamp,
            world_from_body: Isometry3::from_parts(Translation3::identity(), attitude),
            velocity_in_body: Vector3::zeros(),
            gyro_bias: window.rate,
            accel_bias: Vector3::zeros(),
            sigma,
        })?;
        if let Some(estimator) = &mut self.estimator {
            estimator.weigh(&window, self.unnoticed, &self.settings.rest);
        }
        Ok(())
    }

    /// Starts from what the scout has found at the time of an image. `look` tells of a point by its name how it is seen in that
    /// image, and what it looks like.
    pub(super) fn start_in_motion(
        &mut self,
        stamp: Stamp,
        motion: &moving::Motion,
        mut look: impl FnMut(u64) -> Option<(Vector2<f64>, Option<Patch>)>,
    ) {
        let samples: Vec<Imu> = self.scout.samples().copied().collect();
        let after = samples.partition_point(|sample| sample.stamp <= stamp).max(1);
        let Some(before) = samples.get(after - 1) else { return };
        let found = Start {
            stamp,
            world_from_body: Isometry3::from_parts(Translation3::identity(), motion.attitude),
            velocity_in_body: motion.velocity,
            gyro_bias: motion.gyro_bias,
            accel_bias: motion.accel_bias,
            sigma: StartSigma::default(),
        };
        let mut estimator = Estimator::new(&self.camera, self.noise, &self.settings, &found, *before);
        self.reset();
        let pixel_sigma = self.settings.moving.pixel_sigma;
        estimator.inherit(motion, |id| {
            let (pixel, patch) = look(id)?;
            let bearing = Bearing::new(&self.camera.bearing(&pixel)?);
            let warp = points::project(&self.camera, &bearing)?.1.try_inverse()?;
            self.tracks.push(Track { id, misses: 0, seen: true, patch });
            Some((bearing, warp, warp * warp.transpose() * (pixel_sigma * pixel_sigma)))
        });
        for sample in &samples[after..] {
            estimator.imu(*sample);
        }
        self.next_id = self.tracks.iter().map(|track| track.id + 1).fold(self.next_id, u64::max);
        self.doubtful = Some(later(stamp, self.settings.moving.doubt_s));
        self.estimator = Some(estimator);
    }
}
