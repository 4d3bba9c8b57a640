//! From strokes on a surface to flights: plan, rehearse, and fly once more what was given up although a pose reaches it.

use super::cells::Cells;
use super::flights::{MissionFlight, MissionPlan};
use super::rehearse::Rehearsal;
use super::retry::take_unserved;
use super::strokes::{LiftedStrokes, Route};
use super::team::{Team, Turn};
use crate::error::Error;
use crate::not_served::NotServed;
use crate::plan::{OptimalPlanner, Plan, Planner};
use crate::raise_clearance::{Raise, Shortfall, until_clear};
use crate::settings::Settings;
use crate::target::Target;
use crate::world::{Surface, Tool};

/// What a mission can be told (all defaults ours).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct MissionSettings {
    /// The planner's settings.
    pub planner: Settings,
    /// Robots that fly at the same time (default one).
    pub team: Team,
    /// Flights over the same strokes (default 3). The first gives stretches up that a pose reaches, since all of a stroke is one
    /// program; those become strokes of the next.
    pub flights: usize,
    /// Weights `c_a` and `c_b` between neighbours of what is flown once more, against those of the first flight (default 0.1): nozzles
    /// stay nearer to their normals.
    pub retry_weight: f64,
    /// Shortest stretch worth another flight, m (default 0.05).
    pub shortest_retry: f64,
    /// Plans that are rehearsed before what still comes too near is left out (default 4).
    pub rounds: usize,
    /// More clearance than is missing in a rehearsal, m (default 0.01): the next plan comes near elsewhere.
    pub beyond: f64,
}

impl Default for MissionSettings {
    fn default() -> Self {
        Self {
            planner: Settings::default(),
            team: Team::default(),
            flights: 3,
            retry_weight: 0.1,
            shortest_retry: 0.05,
            rounds: 4,
            beyond: 0.01,
        }
    }
}

/// Plans a mission step by step: layer after layer, each of which may take several flights.
pub struct MissionPlanner<'a, R: ?Sized> {
    /// Who plans each flight.
    pub planner: &'a dyn Planner,
    /// The surface to paint, with whatever else is in the way.
    pub surface: &'a dyn Surface,
    /// The vehicle with its gun.
    pub tool: &'a dyn Tool,
    /// What flies the plans before they count.
    pub rehearsal: &'a R,
    /// Settings.
    pub settings: MissionSettings,
}

/// Plans a mission over strokes on a surface, each of at least two targets, in the order that is flown soonest, by one robot or a team.
///
/// # Errors
/// As [`Cells::of_equal_work`] and [`MissionPlan::schedule`]. Of the first flight as [`Planner::plan`]; what keeps later ones from being planned is counted in the outcomes instead. Those of the
/// rehearsal.
pub fn plan_mission<R: Rehearsal + ?Sized>(
    strokes: &[Vec<Target>],
    surface: &dyn Surface,
    tool: &dyn Tool,
    rehearsal: &R,
    settings: MissionSettings,
) -> Result<MissionPlan, R::Error> {
    let mut mission = MissionPlan::default();
    let team = settings.team;
    let planner = MissionPlanner { planner: &OptimalPlanner::default(), surface, tool, rehearsal, settings };
    planner.add_strokes(&LiftedStrokes { strokes: strokes.to_vec(), lost_volume: 0.0 }, &mut mission)?;
    if mission.flights.is_empty() {
        return Err(Error::NothingReachable { count: mission.refused.targets }.into());
    }
    mission.schedule(&team)?;
    Ok(mission)
}

/// Why there is no plan for a flight: none of its targets can be served, or an error.
enum Refusal<E> {
    NotServed(Error),
    Failed(E),
}

impl<E: From<Error>> From<Error> for Refusal<E> {
    fn from(error: Error) -> Self {
        match error {
            Error::NothingReachable { .. } | Error::NoTransit { .. } | Error::Collision { .. } => {
                Self::NotServed(error)
            }
            error => Self::Failed(error.into()),
        }
    }
}

impl<R: Rehearsal + ?Sized> MissionPlanner<'_, R> {
    /// Adds the flights of a layer of paint, each robot's from where its own have ended so far. A team divides the strokes into [cells](Cells)
    /// of equal work; where there is no room for all of its robots, the first ones fly ([`MissionPlan::robots`]).
    ///
    /// # Errors
    /// As [`plan_mission`]; a layer of which nothing is reachable is none, it adds to what the mission refused.
    pub fn add_strokes(&self, lifted: &LiftedStrokes, mission: &mut MissionPlan) -> Result<(), R::Error> {
        let (team, settings) = (&self.settings.team, &self.settings.planner);
        team.check()?;
        let cells = Cells::of_equal_work(&lifted.strokes, team, settings)?;
        let layer = next_layer(mission);
        if cells.count() == 1 {
            let turn = Turn { layer, ..Turn::default() };
            return self.add_route(lifted.ordered(mission.end(turn, team).1, settings)?, turn, mission);
        }
        let mut lost_volume = lifted.lost_volume;
        for (cell, strokes) in
            cells.divide(&lifted.strokes).iter().enumerate().filter(|(_, strokes)| !strokes.is_empty())
        {
            let turn = Turn { layer, robot: cell / 2, shift: cell % 2 };
            let mut route = Route::ordered(strokes, mission.end(turn, team).1, settings)?;
            route.lost_volume = std::mem::take(&mut lost_volume);
            self.add_route(route, turn, mission)?;
        }
        Ok(())
    }

    /// Adds the flights of a layer of paint by the first robot alone: its route, and what is given up there once more by itself. It begins where
    /// the robot's flights end so far.
    ///
    /// # Errors
    /// As [`add_strokes`](Self::add_strokes).
    pub fn add_layer(&self, route: Route, mission: &mut MissionPlan) -> Result<(), R::Error> {
        let turn = Turn { layer: next_layer(mission), ..Turn::default() };
        self.add_route(route, turn, mission)
    }

    fn add_route(&self, route: Route, turn: Turn, mission: &mut MissionPlan) -> Result<(), R::Error> {
        let first = mission.flights.len();
        let mut next = Some(route);
        while let Some(route) = next.take() {
            let again = mission.flights.len() > first;
            let mut settings = self.settings.planner.clone();
            if again {
                settings.nozzle.ca *= self.settings.retry_weight;
                settings.nozzle.cb *= self.settings.retry_weight;
            }
            let clearance = vec![Some(settings.clearance); route.targets.len()];
            if !self.add_flight(again, turn, route, clearance, settings, mission)? {
                break;
            }
            if mission.flights.len() - first < self.settings.flights {
                next = self.retry(mission)?;
            }
        }
        Ok(())
    }

    /// Plans the flights from the `first` on again, for doses that were changed in their routes. Doses change the speed of the spot at
    /// most, so nozzles and clearances stay as they were rehearsed.
    ///
    /// # Errors
    /// As [`add_layer`](Self::add_layer).
    pub fn replan(&self, first: usize, mission: &mut MissionPlan) -> Result<(), R::Error> {
        for flight in mission.flights.split_off(first) {
            let again = mission.flights.len() > first;
            self.add_flight(again, flight.turn, flight.route, flight.clearance, flight.settings, mission)?;
        }
        Ok(())
    }

    /// Plans and rehearses one flight; whether there is one. What is flown once more (`again`) may also lie where no flight leads to.
    fn add_flight(
        &self,
        again: bool,
        turn: Turn,
        route: Route,
        mut clearance: Vec<Option<f64>>,
        settings: Settings,
        mission: &mut MissionPlan,
    ) -> Result<bool, R::Error> {
        let settings =
            Settings { start: mission.end(turn, &self.settings.team).0.or(self.settings.planner.start), ..settings };
        let refused = if route.targets.len() < 2 {
            NotServed::OutOfReach
        } else {
            match self.rehearsed_plan(&route.targets, &mut clearance, &settings) {
                Ok(plan) => {
                    mission.flights.push(MissionFlight { route, plan, clearance, settings, turn, start: 0.0 });
                    return Ok(true);
                }
                Err(Refusal::NotServed(Error::NothingReachable { .. })) => NotServed::NoHeading,
                Err(Refusal::NotServed(Error::NoTransit { .. })) if again => NotServed::NoTransit,
                Err(Refusal::NotServed(Error::Collision { .. })) if again => NotServed::TooNear,
                Err(Refusal::NotServed(error)) => return Err(error.into()),
                Err(Refusal::Failed(error)) => return Err(error),
            }
        };
        mission.refused_volume += route.volume() + route.lost_volume;
        mission.refused.add_refused(&route.targets, refused);
        Ok(false)
    }

    /// Plans, flies, and plans again until no rehearsal comes too near, `settings.rounds` times at most; then what still does is left
    /// out. `clearance` of each target, m, is what the plan keeps in the end.
    fn rehearsed_plan(
        &self,
        targets: &[Target],
        clearance: &mut [Option<f64>],
        settings: &Settings,
    ) -> Result<Plan, Refusal<R::Error>> {
        let raise = Raise { beyond: self.settings.beyond, most: f64::INFINITY };
        until_clear(clearance, raise, |clearance, attempt| {
            let plan = self.planner.plan_with_clearance(targets, clearance, self.surface, self.tool, settings)?;
            let mut missing = vec![0.0_f64; targets.len()];
            if attempt <= self.settings.rounds {
                for miss in self.rehearsal.near_misses(&plan).map_err(Refusal::Failed)? {
                    let passed = plan.waypoints.partition_point(|w| w.time <= miss.time);
                    for target in plan.targets_about(passed.saturating_sub(1)).into_iter().flatten() {
                        missing[target] = missing[target].max(miss.missing);
                    }
                }
            }
            let hopeless = attempt == self.settings.rounds;
            let short = missing.iter().enumerate().filter(|(_, missing)| **missing > 0.0);
            Ok((plan, short.map(|(target, &missing)| Shortfall { target, missing, hopeless }).collect()))
        })
    }

    /// What the last flight gave up although a pose reaches it, as a route of its own.
    fn retry(&self, mission: &mut MissionPlan) -> Result<Option<Route>, Error> {
        let Some(MissionFlight { route, plan, .. }) = mission.flights.last_mut() else { return Ok(None) };
        let shortest = self.settings.shortest_retry;
        let strokes =
            take_unserved(&mut route.targets, plan, shortest, self.surface, self.tool, &self.settings.planner)?;
        if strokes.is_empty() {
            return Ok(None);
        }
        Route::ordered(&strokes, route.targets.last(), &self.settings.planner).map(Some)
    }
}

/// Number of a layer that follows those of a mission.
fn next_layer(mission: &MissionPlan) -> usize {
    mission.flights.last().map_or(0, |flight| flight.turn.layer + 1)
}
