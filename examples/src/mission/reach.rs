//! Which texels the robot can serve, before the painter decides: paint that cannot be sprayed must not be counted on beside it.

use paint_planner::constraints::FlightConstraints;
use paint_planner::mission::reachable_texels;

use super::error::MissionError;
use super::planned_robot::{PlannedRobot, elevation};
use super::settings::MissionSettings;
use crate::adapters::MeshSurface;
use crate::surface::PaintSurface;

/// Whether the robot can paint each texel, row by row: it lies on the surface, its chart is not stretched beyond use there, and
/// some pose of the robot serves it.
pub(super) fn texels_in_reach(surface: &PaintSurface, settings: &MissionSettings) -> Result<Vec<bool>, MissionError> {
    let occupied: Vec<bool> = surface.coverage().data().iter().map(|&covered| covered > 0.0).collect();
    let mesh = MeshSurface(&surface.world);
    let obstacles = settings.constraints.around(&mesh);
    let robot = PlannedRobot::new(settings)?;
    let reached = reachable_texels(&occupied, surface.width(), surface, &obstacles, robot.tool(), &settings.planner)?;
    // The planner may lean the spray by its incidence angle to reach what the joints alone cannot.
    let steepest = (elevation(settings) + 0.8 * settings.planner.nozzle.incidence).min(std::f64::consts::FRAC_PI_2);
    Ok(surface.paintable(steepest).into_iter().zip(reached).map(|(paintable, reached)| paintable && reached).collect())
}

/// The texels that would be in reach but for keep-out volumes and tether.
pub(super) fn texels_lost_to_constraints(
    in_reach: &[bool],
    surface: &PaintSurface,
    settings: &MissionSettings,
) -> Result<Vec<bool>, MissionError> {
    if settings.constraints.is_empty() {
        return Ok(vec![false; in_reach.len()]);
    }
    let free = MissionSettings { constraints: FlightConstraints::default(), ..settings.clone() };
    let mut lost = texels_in_reach(surface, &free)?;
    lost.iter_mut().zip(in_reach).for_each(|(lost, reached)| *lost &= !reached);
    Ok(lost)
}
