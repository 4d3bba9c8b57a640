//! Several robots on one surface.

use serde::Serialize;

/// Figures of the robots of a mission.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TeamFigures {
    /// How many fly at the same time: fewer than asked for where there is no room.
    pub robots: usize,
    /// Least distance between two of them while they fly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robots_nearest_m: Option<f64>,
    /// Time in the air of all together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robots_flight_time_s: Option<f64>,
}

impl TeamFigures {
    /// Of missions that follow each other.
    pub(crate) fn of_all(missions: impl Iterator<Item = Self>) -> Self {
        let both = |a: Option<f64>, b: Option<f64>, join: fn(f64, f64) -> f64| a.into_iter().chain(b).reduce(join);
        let join = |a: Self, b: Self| Self {
            robots: a.robots.max(b.robots),
            robots_nearest_m: both(a.robots_nearest_m, b.robots_nearest_m, f64::min),
            robots_flight_time_s: both(a.robots_flight_time_s, b.robots_flight_time_s, |a, b| a + b),
        };
        missions.reduce(join).unwrap_or_default()
    }

    /// A line of several robots; nothing of one.
    pub(crate) fn summary(&self) -> String {
        let Self { robots, robots_nearest_m, robots_flight_time_s } = self;
        let Some(seconds) = robots_flight_time_s else { return String::new() };
        let nearest =
            robots_nearest_m.map_or_else(String::new, |nearest| format!(", never nearer than {nearest:.2} m"));
        format!("{robots} robots, {:.1} min in the air together{nearest}.\n\n", seconds / 60.0)
    }
}
