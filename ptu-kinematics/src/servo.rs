//! A position-controlled servo in time.

use std::collections::VecDeque;

use crate::error::{Error, finite};
use crate::joints::Range;

/// Constants of one position-controlled servo.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ServoSettings {
    /// Smallest command step in radians; 0 for none. Default 300°/1023 = 0.293° (AX-12A data sheet).
    pub resolution: f64,
    /// Largest speed in rad/s. Default 354°/s: 59 rpm without load at 12 V (AX-12A data sheet).
    pub max_rate: f64,
    /// Time constant of the first-order response in seconds. Default 0.03.
    pub time_constant: f64,
    /// Time from command to the start of the motion in seconds. Default 0.02 (bus and firmware cycle).
    pub dead_time: f64,
    /// Mechanical limits in radians. Default ±150° (AX-12A data sheet).
    pub limits: Range,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self {
            resolution: (300.0_f64 / 1023.0).to_radians(),
            max_rate: 354.0_f64.to_radians(),
            time_constant: 0.03,
            dead_time: 0.02,
            limits: Range::symmetric(150.0_f64.to_radians()),
        }
    }
}

/// A servo in time: clamps and quantises the command, waits its dead time, then follows with first-order lag and a
/// limited rate. Deterministic; exact for a constant command whatever the step.
#[derive(Debug, Clone)]
pub struct Servo {
    settings: ServoSettings,
    angle: f64,
    goal: f64,
    clock: f64,
    pending: VecDeque<(f64, f64)>,
}

impl Servo {
    /// A servo at rest at `angle` (clamped to the limits).
    pub fn new(settings: ServoSettings, angle: f64) -> Result<Self, Error> {
        finite("servo angle", [angle])?;
        let positive = "it must be finite and not negative";
        for (name, value) in [
            ("resolution", settings.resolution),
            ("time_constant", settings.time_constant),
            ("dead_time", settings.dead_time),
            ("max_rate", settings.max_rate),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::InvalidSetting { name, value, rule: positive });
            }
        }
        if settings.max_rate == 0.0 {
            return Err(Error::InvalidSetting { name: "max_rate", value: 0.0, rule: "a servo must be able to move" });
        }
        finite("servo limits", [settings.limits.min, settings.limits.max])?;
        let angle = settings.limits.clamp(angle);
        Ok(Self { settings, angle, goal: angle, clock: 0.0, pending: VecDeque::new() })
    }

    /// Present angle in radians.
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// Constants.
    pub fn settings(&self) -> &ServoSettings {
        &self.settings
    }

    /// Time from a command to 63 % of its effect in seconds: what a pointing controller should look ahead.
    pub fn delay(&self) -> f64 {
        self.settings.dead_time + self.settings.time_constant
    }

    /// The command that the hardware can represent nearest to `angle`.
    pub fn quantise(&self, angle: f64) -> f64 {
        let clamped = self.settings.limits.clamp(angle);
        if self.settings.resolution == 0.0 {
            return clamped;
        }
        // Steps are counted from the lower limit, as the servo's own register does.
        let steps = ((clamped - self.settings.limits.min) / self.settings.resolution).round();
        self.settings.limits.clamp(self.settings.limits.min + steps * self.settings.resolution)
    }

    /// Sends `command` (radians) and moves on by `dt` seconds; returns the new angle. A command that is not finite is
    /// ignored, as a servo ignores a corrupt packet; a negative or non-finite `dt` moves nothing.
    pub fn step(&mut self, command: f64, dt: f64) -> f64 {
        if command.is_finite() {
            self.pending.push_back((self.clock + self.settings.dead_time, self.quantise(command)));
        }
        if !(dt.is_finite() && dt > 0.0) {
            return self.angle;
        }
        let end = self.clock + dt;
        while let Some(&(due, goal)) = self.pending.front() {
            if due > end {
                break;
            }
            self.follow((due - self.clock).max(0.0));
            self.clock = self.clock.max(due);
            self.goal = goal;
            self.pending.pop_front();
        }
        self.follow(end - self.clock);
        self.clock = end;
        self.angle
    }

    /// Moves towards the goal for `dt`: at the rate limit while the lag would ask for more, then exponentially.
    fn follow(&mut self, dt: f64) {
        let error = self.goal - self.angle;
        let linear_zone = self.settings.max_rate * self.settings.time_constant;
        let saturated = ((error.abs() - linear_zone) / self.settings.max_rate).max(0.0).min(dt);
        let moved = error.signum() * self.settings.max_rate * saturated;
        let rest = error - moved;
        let decay = if self.settings.time_constant > 0.0 {
            (-(dt - saturated) / self.settings.time_constant).exp()
        } else if dt > saturated {
            0.0
        } else {
            1.0
        };
        self.angle = self.goal - rest * decay;
    }
}
