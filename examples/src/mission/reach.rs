//! Which texels the robot can serve, before the painter decides: paint that cannot be sprayed must not be counted on beside it.

use paint_planner::{Target, reachable_targets};

use super::error::MissionError;
use super::settings::MissionSettings;
use crate::adapters::{MeshSurface, Robot};
use crate::flight_constraints::FlightConstraints;
use crate::surface::PaintSurface;

/// Texels between two places that are asked about, along both axes: less than a spot is wide. At the edge of what is in reach all are.
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
    let texels = |cell: usize| {
        let (left, top) = (cell % columns * STRIDE, cell / columns * STRIDE);
        let inside = (top..(top + STRIDE).min(height))
            .flat_map(move |y| (left..(left + STRIDE).min(width)).map(move |x| (x, y)));
        inside.filter(|&(x, y)| surface.texels.at(x, y).is_some()).map(|(x, y)| y * width + x).collect::<Vec<usize>>()
    };
    let mesh = MeshSurface(&surface.world);
    let ask = |texels: &[usize]| -> Result<Vec<Option<bool>>, MissionError> {
        let target = |texel: &usize| {
            let (point, normal) = surface.lift((texel % width) as f64, (texel / width) as f64)?;
            Some(Target { point, normal, dose: 0.0, time: None })
        };
        let targets: Vec<Option<Target>> = texels.iter().map(target).collect();
        let asked: Vec<Target> = targets.iter().flatten().copied().collect();
        let mut answers =
            reachable_targets(&asked, &settings.constraints.around(&mesh), robot, &settings.planner)?.into_iter();
        Ok(targets.iter().map(|target| target.and_then(|_| answers.next())).collect())
    };
    // A cell is asked about in the middle of the part of the surface that it holds.
    let cells: Vec<Vec<usize>> = (0..columns * rows).map(texels).collect();
    let held: Vec<usize> = (0..cells.len()).filter(|&cell| !cells[cell].is_empty()).collect();
    let middles: Vec<usize> = held.iter().map(|&cell| cells[cell][cells[cell].len() / 2]).collect();
    let mut reached = vec![None; cells.len()];
    for (&cell, answer) in held.iter().zip(ask(&middles)?) {
        reached[cell] = answer;
    }
    let mut in_reach = vec![false; width * height];
    // At the edge of what is in reach every texel is asked about, as a cell there holds some that no pose paints. Those of a cell that is out of reach stay
    // so: the few that a pose paints are painted at the end of a joint, and badly.
    let mut edge: Vec<usize> = Vec::new();
    for &cell in &held {
        let (x, y) = (cell % columns, cell / columns);
        let mut about = (y.saturating_sub(1)..(y + 2).min(rows))
            .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(columns)).map(move |x| y * columns + x));
        if about.any(|other| !cells[other].is_empty() && reached[other] != reached[cell]) {
            edge.extend(&cells[cell]);
        } else {
            cells[cell].iter().for_each(|&texel| in_reach[texel] = reached[cell] == Some(true));
        }
    }
    for (&texel, answer) in edge.iter().zip(ask(&edge)?) {
        let cell = texel / width / STRIDE * columns + texel % width / STRIDE;
        in_reach[texel] = answer == Some(true) && reached[cell] == Some(true);
    }
    let tilt = settings.ptu.tilt_limits.min.abs().min(settings.ptu.tilt_limits.max);
    // The planner may lean the spray by its incidence angle to reach what the tilt servo alone cannot.
    let steepest = (tilt + 0.8 * settings.planner.nozzle.incidence).min(std::f64::consts::FRAC_PI_2);
    let mut paintable = surface.paintable(steepest);
    for (k, paintable) in paintable.iter_mut().enumerate() {
        *paintable &= in_reach[k];
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
