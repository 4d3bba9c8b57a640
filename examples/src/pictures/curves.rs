//! Curves over a common horizontal axis.

use std::path::Path;

use plotters::prelude::*;

use super::chart::{COLOURS, draw_axes, draw_legend, name_curve};
use super::{PictureError, draw};

/// One panel of curves over a shared horizontal axis.
pub struct Panel<'a> {
    /// Label of the vertical axis, with its unit.
    pub label: &'a str,
    /// Curves: name and points.
    pub curves: Vec<(&'a str, Vec<(f64, f64)>)>,
}

/// Draws the panels under each other over one horizontal axis and saves the picture.
pub fn save_curves(path: &Path, title: &str, horizontal: &str, panels: &[Panel]) -> Result<(), PictureError> {
    let height = 70 + 260 * panels.len() as u32;
    let picture = draw(1400, height, |area| {
        let area = area.titled(title, ("sans-serif", 28))?;
        for (cell, panel) in area.split_evenly((panels.len(), 1)).iter().zip(panels) {
            let points = || panel.curves.iter().flat_map(|(_, c)| c.iter()).filter(|p| p.1.is_finite());
            let (left, right) = range(points().map(|p| p.0), 0.0);
            let (low, high) = range(points().map(|p| p.1), 0.08);
            let mut chart = ChartBuilder::on(cell)
                .margin(8)
                .x_label_area_size(42)
                .y_label_area_size(78)
                .build_cartesian_2d(left..right, low..high)?;
            draw_axes(&mut chart, horizontal, panel.label)?;
            for ((name, curve), colour) in panel.curves.iter().zip(COLOURS) {
                // A gap in the data (NaN) is a gap in the line.
                for piece in curve.split(|p| !p.1.is_finite()).filter(|piece| piece.len() > 1) {
                    chart.draw_series(LineSeries::new(piece.iter().copied(), colour.stroke_width(1)))?;
                }
                name_curve(chart.draw_series(std::iter::empty::<PathElement<(f64, f64)>>())?, name, colour);
            }
            draw_legend(&mut chart)?;
        }
        Ok(())
    })?;
    picture.save(path)
}

/// Smallest and largest value with a margin; never an empty range.
fn range(values: impl Iterator<Item = f64>, margin: f64) -> (f64, f64) {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let pad = margin * (high - low) + if high - low < 1e-12 { 1e-3 } else { 0.0 };
    (low - pad, high + pad)
}
