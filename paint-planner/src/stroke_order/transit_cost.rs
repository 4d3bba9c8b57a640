//! Estimated duration of a transit between two ends of strokes.

use super::stroke::StrokeEnds;
use crate::settings::{Settings, TimingPolicy};
use crate::target::Target;
use crate::timing::RestToRest;
use nalgebra::Point3;
use std::f64::consts::TAU;

/// Length of a unit normal seen from above below which it gives no heading.
const MIN_LEVEL_NORMAL: f64 = 0.3;

/// An end of a stroke: `2 k` where stroke `k` begins as drawn, `2 k + 1` where it ends.
pub(super) type End = usize;

/// The end at the other side of the same stroke.
pub(super) fn other(end: End) -> End {
    end ^ 1
}

/// Where the nozzle is at an end, and the way the surface faces there seen from above.
#[derive(Debug, Clone, Copy)]
struct Place {
    nozzle: Point3<f64>,
    /// Azimuth of the normal; `None` on floors and ceilings, where any heading will do.
    facing: Option<f64>,
}

/// Durations between all ends, symmetric.
pub(super) struct TransitCost {
    places: Vec<Place>,
    from: Option<Place>,
    flight: RestToRest,
    break_length: f64,
    /// Of a stroke that goes on with the valve shut: s/m and s/rad.
    per_metre: f64,
    per_radian: f64,
}

impl TransitCost {
    pub(super) fn new(strokes: &[StrokeEnds], from: Option<&Target>, settings: &Settings) -> Self {
        let place = |target: &Target| {
            let level = target.normal.xy();
            Place {
                nozzle: target.point + target.normal.into_inner() * target.stand_off_or(settings.nozzle.stand_off),
                facing: (level.norm() > MIN_LEVEL_NORMAL).then(|| level.y.atan2(level.x)),
            }
        };
        let speed = match settings.timing.policy {
            TimingPolicy::Uniform { speed } => speed.min(settings.timing.max_speed),
            TimingPolicy::GradientPreserving => settings.timing.max_speed,
        };
        Self {
            places: strokes.iter().flat_map(|stroke| [place(&stroke.first), place(&stroke.last)]).collect(),
            from: from.map(place),
            flight: RestToRest::new(&settings.timing),
            break_length: settings.break_length,
            per_metre: 1.0 / speed,
            per_radian: 1.0 / settings.timing.max_heading_rate,
        }
    }

    /// Number of strokes.
    pub(super) fn strokes(&self) -> usize {
        self.places.len() / 2
    }

    /// Whether the flight has a place that it comes from.
    pub(super) fn has_start(&self) -> bool {
        self.from.is_some()
    }

    /// Seconds between two ends.
    pub(super) fn between(&self, a: End, b: End) -> f64 {
        self.duration(&self.places[a], &self.places[b])
    }

    /// Seconds to the first end of a flight; 0 where it may begin anywhere.
    pub(super) fn first(&self, end: End) -> f64 {
        self.from.map_or(0.0, |from| self.duration(&from, &self.places[end]))
    }

    fn duration(&self, a: &Place, b: &Place) -> f64 {
        let travel = (b.nozzle - a.nozzle).norm();
        // Both lie within half a turn of zero, so that the way round is one turn less at most.
        let turn = a.facing.zip(b.facing).map_or(0.0, |(a, b)| (b - a).abs());
        let turn = turn.min((TAU - turn).abs());
        if travel <= self.break_length {
            // No flight of its own.
            return (self.per_metre * travel).max(self.per_radian * turn);
        }
        self.flight.duration(travel, turn)
    }
}
