//! A mission that is planned: what can be looked at, exported or flown.

use paint_planner::Plan;
use paint_planner::mission::Route;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::plan::{Planned, plan};

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
        let share = share_out_of_reach(&mission.task, mission.planned.unreachable_paint, mission.layers());
        if share > MAX_UNREACHABLE_SHARE {
            return Err(MissionError::OutOfReach { percent: 100.0 * share });
        }
        Ok(mission)
    }

    /// Time in the air, s.
    pub(super) fn duration(&self) -> f64 {
        self.layers().map(|(_, plan)| plan.trajectory.duration()).sum()
    }

    /// Route and plan of every layer of every coat, in flying order.
    pub fn layers(&self) -> impl Iterator<Item = (&Route, &Plan)> {
        let layers = || self.planned.layers.iter().map(|(route, plan, _)| (route, plan));
        (0..self.planned.coats).flat_map(move |_| layers())
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
