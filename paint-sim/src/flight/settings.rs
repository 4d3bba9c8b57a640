//! The flight's settings. No constant of the real vehicle's attitude loop, wind or hose is printed in the papers.

use nalgebra::Vector3;

use super::airframe::Airframe;
use super::faults::Faults;
use super::hose::HoseModel;
use super::interlock::Interlock;
use crate::error::{Error, check_not_negative, check_positive, check_range};

/// Wind as a mean and gusts; each axis of the gusts is an Ornstein-Uhlenbeck process.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Wind {
    /// Mean velocity of the air in the world, m/s. Default 2 along x.
    pub mean: Vector3<f64>,
    /// Standard deviation of the gusts per axis, m/s. Default 0.5.
    pub gust_sigma: f64,
    /// Time constant of the gusts, s. Default 1.5.
    pub gust_time: f64,
}

impl Default for Wind {
    fn default() -> Self {
        Self { mean: Vector3::new(2.0, 0.0, 0.0), gust_sigma: 0.5, gust_time: 1.5 }
    }
}

impl Wind {
    /// Air at rest.
    pub fn calm() -> Self {
        Self { mean: Vector3::zeros(), gust_sigma: 0.0, gust_time: 1.0 }
    }
}

/// The error of the pose that the controller is given: a slow Ornstein-Uhlenbeck drift plus white noise at 100 Hz, each
/// axis by itself. The presets are engineering values.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Localisation {
    /// White noise of the position, m.
    pub position_noise: f64,
    /// Slow error of the position, m.
    pub position_drift: f64,
    /// White noise of roll, pitch and yaw, rad.
    pub attitude_noise: f64,
    /// Slow error of roll, pitch and yaw, rad.
    pub attitude_drift: f64,
    /// Time constant of the slow errors, s.
    pub drift_time: f64,
}

impl Localisation {
    /// Motion capture: 0.5 mm and 0.05 degrees of noise, 1 mm and 0.1 degrees of slow error.
    pub fn mocap() -> Self {
        Self {
            position_noise: 5e-4,
            position_drift: 1e-3,
            attitude_noise: 0.05_f64.to_radians(),
            attitude_drift: 0.1_f64.to_radians(),
            drift_time: 10.0,
        }
    }

    /// Localisation by vision whose position error is 7 cm RMS over the three axes together (Paper II, Section 7.1).
    pub fn slam_7cm() -> Self {
        Self {
            position_noise: 0.003,
            position_drift: 0.0403,
            attitude_noise: 0.1_f64.to_radians(),
            attitude_drift: 0.4_f64.to_radians(),
            drift_time: 10.0,
        }
    }

    /// The truth.
    pub fn perfect() -> Self {
        Self { position_noise: 0.0, position_drift: 0.0, attitude_noise: 0.0, attitude_drift: 0.0, drift_time: 1.0 }
    }
}

impl Default for Localisation {
    fn default() -> Self {
        Self::mocap()
    }
}

/// The delay between a valve command and the paint, and how early the command is given.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Valve {
    /// Time from the command to the paint, s. Default 50 ms.
    pub dead_time: f64,
    /// How much earlier than the reference says the command is given, s. Default 50 ms: the dead time is known.
    pub lead: f64,
    /// What keeps it shut although the reference asks for paint; `None` (default) follows the reference alone.
    pub interlock: Option<Interlock>,
}

impl Default for Valve {
    fn default() -> Self {
        Self { dead_time: 0.05, lead: 0.05, interlock: None }
    }
}

/// Everything about a simulated flight but its reference and its pan-tilt unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct FlightSettings {
    /// The vehicle.
    pub airframe: Airframe,
    /// What the observer takes it for; `None` (default): what it is.
    pub model: Option<Airframe>,
    /// The air.
    pub wind: Wind,
    /// The hose; `None` for a free flight (default).
    pub hose: Option<HoseModel>,
    /// The error of the pose estimate. Default [`Localisation::mocap`].
    pub localisation: Localisation,
    /// The valve.
    pub valve: Valve,
    /// What goes wrong. Default nothing.
    pub faults: Faults,
    /// Keeps pan and tilt at zero. Default false.
    pub ptu_locked: bool,
    /// Without a pose for longer than this, s, the flight ends: by its model alone the vehicle drifts. Default `None`: it flies on.
    pub longest_without_pose: Option<f64>,
    /// Hover at the start before the reference begins, s; the observer learns wind and hose. Default 5.
    pub settle: f64,
    /// Samples per second of the log; a divisor of 1000. Default 100 Hz.
    pub log_rate: u32,
    /// Seed of wind and localisation error.
    pub seed: u64,
}

impl Default for FlightSettings {
    fn default() -> Self {
        Self {
            airframe: Airframe::default(),
            model: None,
            wind: Wind::default(),
            hose: None,
            localisation: Localisation::default(),
            valve: Valve::default(),
            faults: Faults::default(),
            ptu_locked: false,
            longest_without_pose: None,
            settle: 5.0,
            log_rate: 100,
            seed: 0,
        }
    }
}

impl FlightSettings {
    /// What the observer takes the vehicle for.
    pub fn model(&self) -> Airframe {
        self.model.unwrap_or(self.airframe)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        self.airframe.check()?;
        self.model().check()?;
        for (what, value) in
            [("wind.gust_time", self.wind.gust_time), ("localisation.drift_time", self.localisation.drift_time)]
        {
            check_positive(what, value)?;
        }
        for (what, value) in [
            ("wind.gust_sigma", self.wind.gust_sigma),
            ("localisation.position_noise", self.localisation.position_noise),
            ("localisation.position_drift", self.localisation.position_drift),
            ("localisation.attitude_noise", self.localisation.attitude_noise),
            ("localisation.attitude_drift", self.localisation.attitude_drift),
            ("valve.dead_time", self.valve.dead_time),
            ("valve.lead", self.valve.lead),
            ("longest_without_pose", self.longest_without_pose.unwrap_or_default()),
        ] {
            check_not_negative(what, value)?;
        }
        self.valve.interlock.map_or(Ok(()), |interlock| interlock.check())?;
        self.faults.check()?;
        for speed in &self.wind.mean {
            check_range("wind.mean", *speed, -100.0, 100.0, "below 100 m/s")?;
        }
        check_range("settle", self.settle, 0.0, 3600.0, "between 0 and an hour")?;
        let divides = self.log_rate > 0 && 1000 % self.log_rate == 0;
        if divides {
            self.hose.as_ref().map_or(Ok(()), HoseModel::check)
        } else {
            Err(Error::OutOfRange { what: "log_rate", value: f64::from(self.log_rate), allowed: "a divisor of 1000" })
        }
    }
}
