//! Where a flown robot touches what is around it.

use paint_planner::Surface;
use paint_sim::flight::FlightLog;

use super::rehearsal::{GAP_STEP, gap_at};
use crate::adapters::Robot;

/// Moments of a flight at which the robot overlaps the surface or is in a keep-out volume.
pub(super) fn collisions(robot: &Robot, obstacles: &dyn Surface, log: &FlightLog) -> usize {
    log.every(GAP_STEP).filter(|sample| gap_at(robot, obstacles, sample, 0.0) < 0.0).count()
}

#[cfg(test)]
mod tests {
    use ptu_kinematics::{CollisionBody, Ptu};

    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::adapters::MeshSurface;

    #[test]
    fn collisions_are_counted() {
        let settings = MissionSettings::default();
        let (_, flight) = test_panel::flown(&settings);
        let surface = test_panel::surface();
        let world = &MeshSurface(&surface.world);
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        assert_eq!(collisions(&robot, world, &flight), 0);
        let checked = flight.samples.len().div_ceil(5);
        assert_eq!(
            collisions(&Robot { body: CollisionBody { vehicle_radius: 3.0, ..robot.body }, ..robot }, world, &flight),
            checked
        );
    }
}
