//! What goes wrong in a flight.

use nalgebra::Vector3;

use crate::error::{Error, check_not_negative, check_range};

/// Faults at given times of the reference; none by default. What has failed stays so.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Faults {
    /// From this time on no pose arrives, s: the estimate goes on by the model.
    pub pose_lost: Option<f64>,
    /// From this time on pan and tilt stay where they are, s.
    pub servos_stuck: Option<f64>,
    /// From this time on the wind blows harder.
    pub gust: Option<Gust>,
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

    /// What is added to the wind at a time, m/s.
    pub(super) fn gust(&self, time: f64) -> Vector3<f64> {
        self.gust.filter(|gust| time >= gust.time).map_or_else(Vector3::zeros, |gust| gust.velocity)
    }
}
