//! What goes wrong in a flight.

use nalgebra::Vector3;

use crate::error::{Error, check_not_negative, check_range};

/// Faults at given times of the reference; none by default. What has failed stays so unless said.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Faults {
    /// From this time on no pose arrives, s: the estimate goes on by the model.
    pub pose_lost: Option<f64>,
    /// From this time on pan and tilt stay where they are, s.
    pub servos_stuck: Option<f64>,
    /// From this time on the wind blows harder.
    pub gust: Option<Gust>,
    /// The nozzle gives less than it is asked for.
    pub clogged: Option<Clog>,
    /// The poses are off, and nobody knows.
    pub mislocalised: Option<Mislocalised>,
}

/// A nozzle that is partly clogged for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Clog {
    /// Since when, s.
    pub from: f64,
    /// Until when, s.
    pub until: f64,
    /// Share of the flow that comes out, 0 to 1.
    pub flow: f64,
}

/// A localisation that errs for a while and believes itself.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Mislocalised {
    /// Since when, s.
    pub from: f64,
    /// Until when, s.
    pub until: f64,
    /// What is added to every position, m.
    pub shift: Vector3<f64>,
}

/// A gust that sets in at once and stays.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Gust {
    /// When, s.
    pub time: f64,
    /// What it adds to the velocity of the air in the world, m/s.
    pub velocity: Vector3<f64>,
}

impl Faults {
    pub(super) fn check(&self) -> Result<(), Error> {
        let times = [self.pose_lost, self.servos_stuck, self.gust.map(|g| g.time)];
        for (what, time) in ["faults.pose_lost", "faults.servos_stuck", "faults.gust.time"].into_iter().zip(times) {
            time.map_or(Ok(()), |time| check_not_negative(what, time))?;
        }
        if let Some(Clog { from, until, flow }) = self.clogged {
            check_not_negative("faults.clogged.from", from)?;
            check_not_negative("faults.clogged.until", until)?;
            check_range("faults.clogged.flow", flow, 0.0, 1.0, "between 0 and 1")?;
        }
        if let Some(Mislocalised { from, until, shift }) = self.mislocalised {
            check_not_negative("faults.mislocalised.from", from)?;
            check_not_negative("faults.mislocalised.until", until)?;
            for off in &shift {
                check_range("faults.mislocalised.shift", *off, -10.0, 10.0, "within 10 m")?;
            }
        }
        // Each by itself: the largest of several numbers hides one that is not a number.
        self.gust.map_or(Ok(()), |gust| {
            gust.velocity
                .iter()
                .try_for_each(|v| check_range("faults.gust.velocity", *v, -100.0, 100.0, "below 100 m/s"))
        })
    }

    /// Whether the pose is lost at a time.
    pub(super) fn pose_lost(&self, time: f64) -> bool {
        self.pose_lost.is_some_and(|from| time >= from)
    }

    /// Whether the servos are stuck at a time.
    pub(super) fn servos_stuck(&self, time: f64) -> bool {
        self.servos_stuck.is_some_and(|from| time >= from)
    }

    /// Share of the flow that comes out at a time.
    pub(super) fn flow_share(&self, time: f64) -> f64 {
        self.clogged.filter(|clog| (clog.from..clog.until).contains(&time)).map_or(1.0, |clog| clog.flow)
    }

    /// What is added to the position that is reported at a time, m.
    pub(super) fn shift(&self, time: f64) -> Vector3<f64> {
        let wrong = self.mislocalised.filter(|wrong| (wrong.from..wrong.until).contains(&time));
        wrong.map_or_else(Vector3::zeros, |wrong| wrong.shift)
    }

    /// What is added to the wind at a time, m/s.
    pub(super) fn gust(&self, time: f64) -> Vector3<f64> {
        self.gust.filter(|gust| time >= gust.time).map_or_else(Vector3::zeros, |gust| gust.velocity)
    }
}
