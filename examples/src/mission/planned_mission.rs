//! A mission that is planned: what can be looked at, exported or flown.

use paint_planner::Plan;
use paint_planner::mission::Route;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::plan::{Planned, PlannedLayer, plan};

/// A mission is given up when more of the wanted paint than this is out of reach.
const MAX_UNREACHABLE_SHARE: f64 = 0.9;

/// What was decided, with a plan for every layer.
pub struct PlannedMission {
    pub(super) task: PaintingTask,
    pub(super) planned: Planned,
}

impl PlannedMission {
    /// Plans what was decided. An error where nearly all of the paint is out of reach.
    pub fn new(task: PaintingTask) -> Result<Self, MissionError> {
        let planned = plan(&task)?;
        Self::checked(task, planned)
    }

    /// The same of a plan that was made.
    pub(super) fn checked(task: PaintingTask, planned: Planned) -> Result<Self, MissionError> {
        let mission = Self { task, planned };
        let share = share_out_of_reach(&mission.task, mission.planned.unreachable_paint, mission.plans());
        if share > MAX_UNREACHABLE_SHARE {
            return Err(MissionError::OutOfReach { percent: 100.0 * share });
        }
        Ok(mission)
    }

    /// Time from the first take-off to the last landing without that on the ground between coats, s.
    pub(super) fn duration(&self) -> f64 {
        self.planned.coats as f64 * self.planned.coat_duration()
    }

    /// Every layer of every coat with its start, s, in flying order; those of several robots one robot after the other.
    pub fn layers(&self) -> impl Iterator<Item = (f64, &PlannedLayer)> {
        let coat = self.planned.coat_duration();
        (0..self.planned.coats).flat_map(move |k| {
            let begun = k as f64 * coat;
            self.planned.layers.iter().map(move |layer| (begun + layer.start, layer))
        })
    }

    /// Routes and plans of all flights.
    pub(super) fn plans(&self) -> impl Iterator<Item = (&Route, &Plan)> {
        self.layers().map(|(_, layer)| (&layer.route, &layer.plan))
    }
}

/// Share of the wanted paint that is not planned: no pose of the robot, or no surface below the spray. `unreachable`: paint of
/// layers without a plan, m³.
pub(super) fn share_out_of_reach<'a>(
    task: &PaintingTask,
    unreachable: f64,
    layers: impl Iterator<Item = (&'a Route, &'a Plan)>,
) -> f64 {
    let (mut planned, mut wanted) = (0.0, unreachable + task.wanted_out_of_reach());
    for (route, plan) in layers {
        wanted += route.lost_volume + route.volume();
        planned += (0..route.targets.len()).map(|k| plan.volume(k)).sum::<f64>();
    }
    if wanted > 0.0 { (1.0 - planned / wanted).max(0.0) } else { 0.0 }
}
