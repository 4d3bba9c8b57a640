//! A planner of one's own: whatever turns targets into a plan, and a mission is planned with it.

use std::cell::Cell;

use paint_planner::mission::{MissionPlan, MissionPlanner, MissionSettings, NoRehearsal, Route};
use paint_planner::{Error, OptimalPlanner, Plan, Planner, Settings, Surface, Target, Tool};

use crate::walls::{Arm, Wall};

/// The optimal planner, asked to keep farther off, and a count of what it was asked.
struct Cautious {
    more: f64,
    asked: Cell<usize>,
}

impl Planner for Cautious {
    fn name(&self) -> &'static str {
        "cautious"
    }

    fn plan_with_clearance(
        &self,
        targets: &[Target],
        clearance: &[Option<f64>],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        self.asked.set(self.asked.get() + 1);
        let farther: Vec<Option<f64>> = clearance.iter().map(|kept| kept.map(|kept| kept + self.more)).collect();
        OptimalPlanner::default().plan_with_clearance(targets, &farther, surface, tool, settings)
    }
}

#[test]
fn a_mission_is_planned_by_whoever_is_given() {
    let (wall, arm, settings) = (Wall::flat(), Arm::default(), MissionSettings::default());
    let strokes = [wall.rows(1.0, 1, 0.2)];
    let planner = Cautious { more: 0.05, asked: Cell::new(0) };
    let mut mission = MissionPlan::default();
    let missions = MissionPlanner {
        planner: &planner,
        surface: &wall,
        tool: &arm,
        rehearsal: &NoRehearsal,
        settings: settings.clone(),
    };
    missions.add_layer(Route::ordered(&strokes, None, &settings.planner).unwrap(), &mut mission).unwrap();
    assert_eq!((planner.asked.get(), mission.flights.len()), (1, 1));
    let farther = Settings { clearance: settings.planner.clearance + 0.05, ..settings.planner };
    let expected = OptimalPlanner::default().plan(&strokes[0], &wall, &arm, &farther).unwrap();
    assert_eq!(mission.flights[0].plan.waypoints, expected.waypoints);
    assert_eq!(mission.outcomes().not_served(), 0);
}
