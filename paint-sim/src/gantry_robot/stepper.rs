//! The stepper motor that moves the nozzle along its slide.

use crate::error::{Error, check_positive};

/// Limits of the slide.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct StepperSettings {
    /// Length of a micro-step, m (default 12.5 um: 200 steps, 16 micro-steps, 40 mm per turn).
    pub step: f64,
    /// Fastest movement, m/s (default 0.25).
    pub max_speed: f64,
    /// Largest acceleration, m/s^2 (default 8).
    pub max_acceleration: f64,
    /// Length between the limit switches, m (default 0.1).
    pub travel: f64,
}

impl Default for StepperSettings {
    fn default() -> Self {
        Self { step: 1.25e-5, max_speed: 0.25, max_acceleration: 8.0, travel: 0.1 }
    }
}

/// A slide that follows positions as fast as it may, in whole micro-steps, and stops at its limit switches.
#[derive(Debug, Clone)]
pub struct Stepper {
    settings: StepperSettings,
    position: f64,
    speed: f64,
    /// Times that the nozzle ran into a limit switch.
    pub limit_hits: usize,
    at_limit: bool,
}

impl Stepper {
    /// At rest at a position, m.
    ///
    /// # Errors
    /// Limits that are not positive, or a position beside the slide.
    pub fn new(settings: StepperSettings, position: f64) -> Result<Self, Error> {
        check_positive("stepper.step", settings.step)?;
        check_positive("stepper.max_speed", settings.max_speed)?;
        check_positive("stepper.max_acceleration", settings.max_acceleration)?;
        check_positive("stepper.travel", settings.travel)?;
        if !(0.0..=settings.travel).contains(&position) {
            let allowed = "between 0 and stepper.travel";
            return Err(Error::OutOfRange { what: "stepper position", value: position, allowed });
        }
        Ok(Self { settings, position, speed: 0.0, limit_hits: 0, at_limit: false })
    }

    /// Where the nozzle is, m: a whole number of micro-steps.
    pub fn position(&self) -> f64 {
        (self.position / self.settings.step).round() * self.settings.step
    }

    /// How fast it moves, m/s.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Moves for `dt` seconds towards `position`, which it would reach with `speed` at their end.
    pub fn step(&mut self, position: f64, speed: f64, dt: f64) {
        let StepperSettings { max_speed, max_acceleration, travel, .. } = self.settings;
        // The speed that catches up with the setpoint in this step, no faster than can still be braked to the setpoint's own.
        let gap = position - self.position - speed * dt;
        let brakes = (2.0 * max_acceleration * gap.abs()).sqrt();
        let wanted = (speed + (gap / dt).clamp(-brakes, brakes)).clamp(-max_speed, max_speed);
        let change = (wanted - self.speed).clamp(-max_acceleration * dt, max_acceleration * dt);
        self.speed += change;
        self.position += self.speed * dt;
        let stopped = !(0.0..=travel).contains(&self.position);
        if stopped {
            self.position = self.position.clamp(0.0, travel);
            self.speed = 0.0;
            self.limit_hits += usize::from(!self.at_limit);
        }
        self.at_limit = stopped;
    }
}
