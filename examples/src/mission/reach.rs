//! Which texels the robot can serve, before the painter decides: paint that cannot be sprayed must not be counted on beside it.

use paint_planner::{Target, reachable_targets};

use super::error::MissionError;
use super::settings::MissionSettings;
use crate::adapters::{MeshSurface, Robot};
use crate::flight_constraints::FlightConstraints;
use crate::surface::PaintSurface;

/// Texels between two places that are asked about, along both axes: less than a spot is wide.
const STRIDE: usize = 3;

/// Whether the robot can paint each texel, row by row: it lies on the surface, its chart is not stretched beyond use there, and
/// some pose of the robot serves it.
pub(super) fn texels_in_reach(
    surface: &PaintSurface,
    robot: &Robot,
    settings: &MissionSettings,
) -> Result<Vec<bool>, MissionError> {
    let (width, height) = (surface.width(), surface.height());
    let (columns, rows) = (width.div_ceil(STRIDE), height.div_ceil(STRIDE));
    // A cell is asked about in the middle of the part of the surface that it holds.
    let place = |cell: usize| {
        let (left, top) = (cell % columns * STRIDE, cell / columns * STRIDE);
        let texels = (top..(top + STRIDE).min(height))
            .flat_map(|y| (left..(left + STRIDE).min(width)).map(move |x| (x, y)))
            .filter(|&(x, y)| surface.texels.at(x, y).is_some());
        let held: Vec<(usize, usize)> = texels.collect();
        let &(x, y) = held.get(held.len() / 2)?;
        let (point, normal) = surface.lift(x as f64, y as f64)?;
        Some(Target { point, normal, dose: 0.0, time: None })
    };
    let (cells, targets): (Vec<usize>, Vec<Target>) =
        (0..columns * rows).filter_map(|cell| Some((cell, place(cell)?))).unzip();
    let mesh = MeshSurface(&surface.world);
    let reached = reachable_targets(&targets, &settings.constraints.around(&mesh), robot, &settings.planner)?;
    let mut in_reach = vec![false; columns * rows];
    for (cell, reached) in cells.into_iter().zip(reached) {
        in_reach[cell] = reached;
    }
    let tilt = settings.ptu.tilt_limits.min.abs().min(settings.ptu.tilt_limits.max);
    // The planner may lean the spray by its incidence angle to reach what the tilt servo alone cannot.
    let steepest = (tilt + 0.8 * settings.planner.nozzle.incidence).min(std::f64::consts::FRAC_PI_2);
    let mut paintable = surface.paintable(steepest);
    for (k, paintable) in paintable.iter_mut().enumerate() {
        *paintable &= in_reach[k / width / STRIDE * columns + k % width / STRIDE];
    }
    Ok(paintable)
}

/// The texels that would be in reach but for keep-out volumes and tether.
pub(super) fn texels_lost_to_constraints(
    in_reach: &[bool],
    surface: &PaintSurface,
    robot: &Robot,
    settings: &MissionSettings,
) -> Result<Vec<bool>, MissionError> {
    if settings.constraints.is_empty() {
        return Ok(vec![false; in_reach.len()]);
    }
    let free = MissionSettings { constraints: FlightConstraints::default(), ..settings.clone() };
    let unbound = Robot { tether: None, ..robot.clone() };
    let mut lost = texels_in_reach(surface, &unbound, &free)?;
    lost.iter_mut().zip(in_reach).for_each(|(lost, reached)| *lost &= !reached);
    Ok(lost)
}
