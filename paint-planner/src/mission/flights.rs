//! The flights of a mission and what they leave bare.

use super::schedule::schedule;
use super::strokes::Route;
use super::target_outcomes::TargetOutcomes;
use super::team::{Team, Turn};
use crate::error::Error;
use crate::plan::Plan;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::VehicleState;

/// One flight: planned and rehearsed, from take-off or the end of the flight before to the last of its targets.
#[derive(Debug, Clone, PartialEq)]
pub struct MissionFlight {
    /// Its strokes.
    pub route: Route,
    /// Its plan.
    pub plan: Plan,
    /// Clearance of each target since the rehearsal, m; `None` where that gave it up.
    pub clearance: Vec<Option<f64>>,
    /// What it was planned with.
    pub settings: Settings,
    /// Who flies it.
    pub turn: Turn,
    /// When it begins, s after the first of the mission; known once that is [scheduled](MissionPlan::schedule).
    pub start: f64,
}

impl MissionFlight {
    /// Targets that keep more clearance than the settings ask for since the rehearsal.
    pub fn kept_off(&self) -> usize {
        self.clearance.iter().flatten().filter(|clearance| **clearance > self.settings.clearance).count()
    }

    /// Targets, with paint or without, that the rehearsal gave up.
    pub fn excluded(&self) -> usize {
        self.clearance.iter().filter(|clearance| clearance.is_none()).count()
    }
}

/// All flights of a mission.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MissionPlan {
    /// In flying order; those of several robots one robot after the other.
    pub flights: Vec<MissionFlight>,
    /// Paint of strokes that no flight was planned for, m³.
    pub refused_volume: f64,
    /// Their targets.
    pub refused: TargetOutcomes,
}

impl MissionPlan {
    /// Which targets the flights serve, and why not the others.
    pub fn outcomes(&self) -> TargetOutcomes {
        let mut outcomes = self.refused;
        self.flights.iter().for_each(|flight| outcomes.add_flight(&flight.route.targets, &flight.plan));
        outcomes
    }

    /// How many robots fly in a layer: fewer than the team has where there is no room for all.
    pub fn robots(&self, layer: usize) -> usize {
        self.flights
            .iter()
            .filter(|flight| flight.turn.layer == layer)
            .map(|flight| flight.turn.robot + 1)
            .max()
            .unwrap_or(0)
    }

    /// Where a robot is before its next flight: where its last one has ended, the vehicle and the last target. Each layer of a team begins on the
    /// ground.
    pub fn end(&self, turn: Turn, team: &Team) -> (Option<VehicleState>, Option<&Target>) {
        let before = |flight: &&MissionFlight| {
            flight.turn.robot == turn.robot && (team.robots == 1 || flight.turn.layer == turn.layer)
        };
        let Some(last) = self.flights.iter().rfind(before) else { return (None, None) };
        (last.plan.waypoints.last().map(|w| w.state), last.route.targets.last())
    }

    /// Gives every flight its start, the soonest at which no robot of the team comes nearer than [`Team::apart`] to another that flies, planned
    /// with some margin. One robot flies them one after another.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn schedule(&mut self, team: &Team) -> Result<(), Error> {
        team.check()?;
        let flown: Vec<_> = self.flights.iter().map(|flight| (flight.turn, &flight.plan.trajectory)).collect();
        let starts = schedule(&flown, team);
        for (flight, start) in self.flights.iter_mut().zip(starts) {
            flight.start = start;
        }
        Ok(())
    }

    /// From the first take-off to the last landing, s, as it is scheduled.
    pub fn duration(&self) -> f64 {
        self.flights.iter().map(|flight| flight.start + flight.plan.trajectory.duration()).fold(0.0, f64::max)
    }
}
