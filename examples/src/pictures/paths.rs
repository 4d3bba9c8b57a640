//! Paths in two planes, at one scale.

use std::path::Path;

use plotters::prelude::*;

use super::chart::{COLOURS, draw_axes, draw_legend, name_curve};
use super::{PictureError, draw};

/// Paths in a plane, drawn with the same scale on both axes.
pub struct PathPanel<'a> {
    /// Label of the horizontal axis, with its unit.
    pub horizontal: &'a str,
    /// Label of the vertical axis, with its unit.
    pub vertical: &'a str,
    /// Paths: name and points.
    pub curves: Vec<(&'a str, Vec<(f64, f64)>)>,
}

/// Width of a panel and height of the picture, pixels.
const SIZE: (u32, u32) = (760, 800);
/// What labels and margins take of a panel in each direction, pixels.
const FRAME: (u32, u32) = (106, 108);

/// Draws the panels side by side and saves the picture.
pub fn save_paths(path: &Path, title: &str, panels: &[PathPanel]) -> Result<(), PictureError> {
    let picture = draw(SIZE.0 * panels.len() as u32, SIZE.1, |area| {
        let area = area.titled(title, ("sans-serif", 28))?;
        for (cell, panel) in area.split_evenly((1, panels.len())).iter().zip(panels) {
            let (horizontal, vertical) = ranges(panel);
            let mut chart = ChartBuilder::on(cell)
                .margin(14)
                .x_label_area_size(42)
                .y_label_area_size(78)
                .build_cartesian_2d(horizontal, vertical)?;
            draw_axes(&mut chart, panel.horizontal, panel.vertical)?;
            for ((name, curve), colour) in panel.curves.iter().zip(COLOURS) {
                let line = LineSeries::new(curve.iter().copied(), colour.stroke_width(2));
                name_curve(chart.draw_series(line)?, name, colour);
            }
            draw_legend(&mut chart)?;
        }
        Ok(())
    })?;
    picture.save(path)
}

/// Ranges around all points, a metre on one axis as long as on the other; at least a centimetre across.
fn ranges(panel: &PathPanel) -> (std::ops::Range<f64>, std::ops::Range<f64>) {
    let points = || panel.curves.iter().flat_map(|(_, curve)| curve.iter());
    let span = |pick: fn(&(f64, f64)) -> f64| {
        points().map(pick).fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (x, y) = (span(|p| p.0), span(|p| p.1));
    if x.0 > x.1 || y.0 > y.1 {
        return (0.0..1.0, 0.0..1.0);
    }
    let shape = f64::from(SIZE.0 - FRAME.0) / f64::from(SIZE.1 - FRAME.1);
    let height = (1.1 * f64::max(y.1 - y.0, (x.1 - x.0) / shape)).max(0.01);
    let around = |(low, high): (f64, f64), size: f64| {
        let middle = 0.5 * (low + high);
        middle - 0.5 * size..middle + 0.5 * size
    };
    (around(x, height * shape), around(y, height))
}
