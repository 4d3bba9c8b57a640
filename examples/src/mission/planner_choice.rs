//! Who plans the flights, and whether the gun turns: ours, and the baselines that the papers compare with.

use clap::ValueEnum;
use paint_planner::plan::SmoothingPlanner;
use paint_planner::{OptimalPlanner, Planner};
use serde::{Deserialize, Serialize};

/// The planners to choose from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum PlannerChoice {
    /// Nozzle states by a quadratic program, headings without collisions, rehearsed in wind
    #[default]
    Optimal,
    /// The earlier planner of the thesis: facing the wall horizontally and smoothed. It ignores collisions and is not rehearsed
    Smoothing,
    /// The same flown with pan and tilt at zero, which is what that plan asks of them
    SmoothingLocked,
}

impl PlannerChoice {
    /// The planner itself.
    pub(super) fn planner(self) -> Box<dyn Planner> {
        match self {
            Self::Optimal => Box::new(OptimalPlanner::default()),
            Self::Smoothing | Self::SmoothingLocked => Box::new(SmoothingPlanner),
        }
    }

    /// Whether pan and tilt stay at zero.
    pub(super) fn locks_gun(self) -> bool {
        self == Self::SmoothingLocked
    }

    /// Whether its plans are flown in simulated winds before they count.
    pub(super) fn is_rehearsed(self) -> bool {
        self == Self::Optimal
    }

    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

#[cfg(test)]
mod tests {
    use paint_planner::mission::Rehearsal as _;
    use ptu_kinematics::Ptu;

    use super::super::flight_conditions::counted_flight;
    use super::super::rehearsal::WindRehearsal;
    use super::super::settings::MissionSettings;
    use super::super::simulated_flight::fly_plan;
    use super::super::test_panel;
    use super::*;
    use crate::adapters::{MeshSurface, Robot};

    /// Paper II, sections 6.2 and 7.2: the baseline's gun is level and straight ahead by plan; unlocked it turns to correct what the body
    /// does, locked it stays there.
    #[test]
    fn the_smoothing_planner_flies_with_the_gun_turning_and_locked() {
        let surface = test_panel::surface();
        let fly = |path_planner: PlannerChoice| {
            let settings = MissionSettings { path_planner, threads: 1, ..MissionSettings::default() };
            let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
            let mesh = MeshSurface(&surface.world);
            let plan = path_planner.planner().plan(&test_panel::targets(), &mesh, &robot, &settings.planner).unwrap();
            let conditions = counted_flight(&plan, &robot, &settings, 0);
            let log = fly_plan(&plan, &surface.world, &robot, &settings, &conditions).unwrap();
            (plan, log)
        };
        let [(optimal, _), (smoothing, turning), (same, locked)] =
            [PlannerChoice::Optimal, PlannerChoice::Smoothing, PlannerChoice::SmoothingLocked].map(fly);
        assert_eq!(smoothing, same);
        assert!(smoothing.vehicle.iter().all(|v| v.pan.abs() < 1e-9 && v.tilt.abs() < 1e-9));
        assert!(optimal.vehicle.iter().any(|v| v.tilt.abs() > 0.1));
        assert!(turning.samples.iter().any(|s| s.pan_tilt[1].abs() > 0.01));
        // Zero lies between two steps of the servo.
        let step = 0.5 * MissionSettings::default().servo.resolution + 1e-12;
        assert!(locked.samples.iter().all(|s| s.pan_tilt.iter().all(|angle| angle.abs() <= step)));
        // The interlock is that of every flight that counts: paint beyond a spot's deviation is held back, not counted.
        let [turning, locked] = [turning, locked].map(|log| log.statistics());
        assert!(locked.held_samples > turning.held_samples, "{} {}", locked.held_samples, turning.held_samples);
        assert!(locked.hit_error_rms > 2.0 * turning.hit_error_rms, "{locked:?} {turning:?}");
    }

    /// A robot too large for its distance comes too near in every wind; the planner that ignores clearances is not asked to keep more.
    #[test]
    fn only_the_optimal_planner_is_rehearsed() {
        let surface = test_panel::surface();
        let near_misses = |path_planner| {
            let settings = MissionSettings { path_planner, threads: 1, ..MissionSettings::default() };
            let mut robot = Robot::new(Ptu::new(settings.ptu).unwrap());
            let plan = test_panel::plan(&surface, &robot, &settings);
            robot.body.vehicle_radius = 3.0;
            WindRehearsal { surface: &surface, robot: &robot, settings: &settings }.near_misses(&plan).unwrap().len()
        };
        assert!(near_misses(PlannerChoice::Optimal) > 0);
        assert_eq!(near_misses(PlannerChoice::Smoothing) + near_misses(PlannerChoice::SmoothingLocked), 0);
    }
}
