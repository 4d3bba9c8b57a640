//! One axis of a hobby servo.

use std::collections::VecDeque;

use crate::Error;
use crate::error::{check_not_negative, check_positive};

/// How a servo follows its commands.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ServoSettings {
    /// Time from a command to its first effect, s. Default 20 ms (ours).
    pub dead_time: f64,
    /// Time constant of the first-order lag that follows, s. Default 30 ms (ours).
    pub lag: f64,
    /// Largest rate, rad/s. Default 354 deg/s (Dynamixel AX-12A, no load at 12 V: 59 rpm).
    pub rate_limit: f64,
    /// Step of the commanded angle, rad; zero for none. Default 300/1023 = 0.293 degrees (AX-12A).
    pub resolution: f64,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self {
            dead_time: 0.02,
            lag: 0.03,
            rate_limit: 354.0_f64.to_radians(),
            resolution: (300.0_f64 / 1023.0).to_radians(),
        }
    }
}

/// A servo axis: dead time, quantisation, first-order lag with a rate limit.
#[derive(Debug, Clone)]
pub struct Servo {
    settings: ServoSettings,
    /// Commands on their way, with the time at which each takes effect.
    queue: VecDeque<(f64, f64)>,
    clock: f64,
    target: f64,
    angle: f64,
}

impl Servo {
    /// A servo at rest at angle zero.
    ///
    /// # Errors
    /// Times that are negative, a rate that is not positive, or a value that is not finite.
    pub fn new(settings: ServoSettings) -> Result<Self, Error> {
        check_not_negative("servo dead time", settings.dead_time)?;
        check_not_negative("servo lag", settings.lag)?;
        check_not_negative("servo resolution", settings.resolution)?;
        check_positive("servo rate limit", settings.rate_limit)?;
        Ok(Self { settings, queue: VecDeque::new(), clock: 0.0, target: 0.0, angle: 0.0 })
    }

    /// Puts the servo at rest at `angle`.
    pub fn reset(&mut self, angle: f64) {
        self.queue.clear();
        self.clock = 0.0;
        self.target = angle;
        self.angle = angle;
    }

    /// Gives a command, lets `dt` seconds pass and returns the angle, rad.
    pub fn step(&mut self, command: f64, dt: f64) -> f64 {
        let ServoSettings { dead_time, lag, rate_limit, resolution } = self.settings;
        let quantised = if resolution > 0.0 { (command / resolution).round() * resolution } else { command };
        if self.queue.back().map_or(self.target, |last| last.1) != quantised {
            self.queue.push_back((self.clock + dead_time, quantised));
        }
        // A nanosecond of tolerance, since the clock is a sum of steps.
        while let Some(&(due, target)) = self.queue.front()
            && due <= self.clock + 1e-9
        {
            self.target = target;
            self.queue.pop_front();
        }
        self.clock += dt;
        let reached = if lag > 0.0 { -(-dt / lag).exp_m1() } else { 1.0 };
        let change = (self.target - self.angle) * reached;
        self.angle += change.clamp(-rate_limit * dt, rate_limit * dt);
        self.angle
    }

    /// Dead time and lag together: how far behind a slow ramp the servo is, s.
    pub fn delay(&self) -> f64 {
        self.settings.dead_time + self.settings.lag
    }
}
