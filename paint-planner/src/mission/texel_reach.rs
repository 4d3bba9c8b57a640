//! Which texels of a chart can be served, before a painter decides: paint that cannot be sprayed must not be counted on beside it.

use super::reach::reachable_targets;
use super::strokes::Chart;
use crate::error::Error;
use crate::settings::Settings;
use crate::target::Target;
use crate::world::{Surface, Tool};

/// Texels between two places that are asked about, along both axes: less than a spot is wide. At the edge of what is in reach all are.
const STRIDE: usize = 3;

/// Whether some pose of the vehicle serves each texel of a chart, row by row; `occupied`: whether the surface has one there, `width`
/// in each row. Places of the chart are counted in texels. Every ninth texel is asked about as by [`reachable_targets`], all of them at
/// the edge of what is in reach.
///
/// # Errors
/// As [`reachable_targets`].
pub fn reachable_texels(
    occupied: &[bool],
    width: usize,
    chart: &dyn Chart,
    surface: &dyn Surface,
    tool: &dyn Tool,
    settings: &Settings,
) -> Result<Vec<bool>, Error> {
    let height = occupied.len() / width.max(1);
    let (columns, rows) = (width.div_ceil(STRIDE), height.div_ceil(STRIDE));
    let texels = |cell: usize| {
        let (left, top) = (cell % columns * STRIDE, cell / columns * STRIDE);
        let inside = (top..(top + STRIDE).min(height))
            .flat_map(move |y| (left..(left + STRIDE).min(width)).map(move |x| (x, y)));
        inside.map(|(x, y)| y * width + x).filter(|&texel| occupied[texel]).collect::<Vec<usize>>()
    };
    let ask = |texels: &[usize]| -> Result<Vec<Option<bool>>, Error> {
        let target = |texel: &usize| {
            let (point, normal) = chart.lift([(texel % width) as f64, (texel / width) as f64])?;
            Some(Target { point, normal, dose: 0.0, time: None, stand_off: None })
        };
        let targets: Vec<Option<Target>> = texels.iter().map(target).collect();
        let asked: Vec<Target> = targets.iter().flatten().copied().collect();
        let mut answers = reachable_targets(&asked, surface, tool, settings)?.into_iter();
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
    // A cell at the edge holds some texels that no pose paints. Those of a cell that is out of reach stay so: the few that a pose paints are painted at the end of a joint, and badly.
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
    Ok(in_reach)
}
