//! Localisation as the flight asks for it.

use nalgebra::Isometry3;

use super::sample::FlightSample;
use super::vehicle::Vehicle;
use crate::error::Error;

/// Where the vehicle takes itself to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalisedPose {
    /// The pose, which controller and pan-tilt unit follow.
    pub world_from_body: Isometry3<f64>,
    /// Whether it is known well enough to paint by: otherwise the [`Interlock`](super::Interlock) shuts the valve.
    pub trusted: bool,
    /// Standard deviations of position (m) and attitude (rad) along the axes where they are known least, as they are told to an autopilot;
    /// infinite where that is not known.
    pub sigma: [f64; 2],
}

/// What tells controller, pan-tilt unit and interlock where the vehicle is: motion capture, a noise model, or estimators on simulated sensors.
///
/// It is shown the truth, to simulate its sensors with, and the flight sees nothing of the truth but what it returns. Times are those of the
/// reference, s, below zero while the vehicle hovers at the start.
pub trait PoseSource {
    /// The vehicle after another step of the physics, 1 ms: for sensors that are faster than the control. Default: nothing.
    ///
    /// # Errors
    /// [`Error::Localisation`] ends the flight.
    fn moved(&mut self, _time: f64, _truth: &Vehicle) -> Result<(), Error> {
        Ok(())
    }

    /// A sample of the log as it is taken, with the paint that leaves the nozzle until the next one, `interval` seconds later: for cameras that
    /// see what is painted. Default: nothing.
    fn sprayed(&mut self, _sample: &FlightSample, _interval: f64) {}

    /// The pose at a control step, every 10 ms; `None` while there is none: then the observer goes on by its model, and the interlock shuts the
    /// valve. The first one must be there.
    ///
    /// # Errors
    /// [`Error::Localisation`] ends the flight.
    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error>;
}
