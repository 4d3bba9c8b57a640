//! Slow and white random errors of three axes.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::pose_source::{LocalisedPose, PoseSource};
use super::settings::{Localisation, Wind};
use super::vehicle::Vehicle;
use crate::error::Error;
use crate::rng::Rng;

/// Three independent Ornstein-Uhlenbeck processes, stepped exactly: `w+ = a w + sigma sqrt(1 - a^2) N(0,1)`.
#[derive(Debug, Clone)]
pub(super) struct OrnsteinUhlenbeck {
    decay: f64,
    noise: f64,
    value: Vector3<f64>,
    rng: Rng,
}

impl OrnsteinUhlenbeck {
    /// Starts in the stationary distribution.
    pub(super) fn new(sigma: f64, time: f64, dt: f64, seed: u64, stream: u64) -> Self {
        let mut rng = Rng::new(seed, stream);
        let decay = (-dt / time).exp();
        let value = sigma * rng.normal3();
        Self { decay, noise: sigma * (1.0 - decay * decay).sqrt(), value, rng }
    }

    pub(super) fn step(&mut self) -> Vector3<f64> {
        if self.noise > 0.0 {
            self.value = self.decay * self.value + self.noise * self.rng.normal3();
        }
        self.value
    }
}

/// The moving air.
#[derive(Debug, Clone)]
pub struct WindModel {
    mean: Vector3<f64>,
    gusts: OrnsteinUhlenbeck,
}

impl WindModel {
    /// The air of a seed, in steps of `dt` seconds.
    pub fn new(wind: &Wind, dt: f64, seed: u64) -> Self {
        Self { mean: wind.mean, gusts: OrnsteinUhlenbeck::new(wind.gust_sigma, wind.gust_time, dt, seed, 1) }
    }

    /// Velocity of the air for the next step, m/s.
    pub fn step(&mut self) -> Vector3<f64> {
        self.mean + self.gusts.step()
    }
}

/// Turns the true pose into what the localisation reports.
#[derive(Debug, Clone)]
pub struct PoseSensor {
    settings: Localisation,
    position: OrnsteinUhlenbeck,
    attitude: OrnsteinUhlenbeck,
    white: Rng,
}

impl PoseSensor {
    /// The errors of a seed, in steps of `dt` seconds.
    pub fn new(settings: Localisation, dt: f64, seed: u64) -> Self {
        let drift = |sigma, stream| OrnsteinUhlenbeck::new(sigma, settings.drift_time, dt, seed, stream);
        let (position, attitude) = (drift(settings.position_drift, 2), drift(settings.attitude_drift, 3));
        Self { settings, position, attitude, white: Rng::new(seed, 4) }
    }

    /// The pose that is reported for the next step.
    pub fn measure(&mut self, vehicle: &Vehicle) -> Isometry3<f64> {
        let shift = self.position.step() + self.settings.position_noise * self.white.normal3();
        let turn = self.attitude.step() + self.settings.attitude_noise * self.white.normal3();
        let [roll, pitch, yaw] = vehicle.attitude;
        let rotation = UnitQuaternion::from_euler_angles(roll + turn.x, pitch + turn.y, yaw + turn.z);
        Isometry3::from_parts(Translation3::from(vehicle.position + shift), rotation)
    }
}

impl PoseSource for PoseSensor {
    fn pose(&mut self, _time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        let Localisation { position_noise, position_drift, attitude_noise, attitude_drift, .. } = self.settings;
        let sigma = [position_noise.hypot(position_drift), attitude_noise.hypot(attitude_drift)];
        Ok(Some(LocalisedPose { world_from_body: self.measure(truth), trusted: true, sigma }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_have_the_stationary_moments_and_correlation() {
        let (sigma, time, dt) = (0.5, 1.5, 0.05);
        let mut process = OrnsteinUhlenbeck::new(sigma, time, dt, 7, 1);
        let lag = 15;
        let series: Vec<f64> = (0..400_000).map(|_| process.step().x).collect();
        let mean = series.iter().sum::<f64>() / series.len() as f64;
        let product = |shift: usize| {
            let n = series.len() - shift;
            (0..n).map(|i| series[i] * series[i + shift]).sum::<f64>() / n as f64
        };
        // Effective samples: 20000 s / (2 * 1.5 s), so the standard error of the mean is 0.006 and of the variance 2 %.
        assert!(mean.abs() < 0.024, "{mean}");
        assert!((product(0) / (sigma * sigma) - 1.0).abs() < 0.08);
        let expected = (-(lag as f64) * dt / time).exp();
        assert!((product(lag) / product(0) - expected).abs() < 0.04);
    }

    #[test]
    fn normal_deviates_have_the_normal_moments() {
        let mut rng = Rng::new(3, 9);
        let n = 400_000;
        let mut moments = [0.0; 4];
        for _ in 0..n {
            let x = rng.normal();
            for (k, moment) in moments.iter_mut().enumerate() {
                *moment += x.powi(k as i32 + 1) / f64::from(n);
            }
        }
        for (moment, (expected, tolerance)) in moments.iter().zip([(0.0, 0.008), (1.0, 0.01), (0.0, 0.03), (3.0, 0.08)])
        {
            assert!((moment - expected).abs() < tolerance, "{moments:?}");
        }
    }
}
