//! A field of values on a grid in grey, with a path over it.

use std::path::Path;

use plotters::prelude::*;

use super::{PictureError, draw};

/// A field and a path.
pub struct DensityPicture<'a> {
    /// Above the picture.
    pub title: &'a str,
    /// Label of the horizontal axis, with its unit.
    pub horizontal: &'a str,
    /// Label of the vertical axis, with its unit.
    pub vertical: &'a str,
    /// Place and value of each sample.
    pub samples: &'a [([f64; 2], f64)],
    /// Size of a sample's cell.
    pub cell: [f64; 2],
    /// Corners of the path.
    pub path: Vec<(f64, f64)>,
}

/// Where there is no sample.
const NOTHING: RGBColor = RGBColor(120, 130, 145);
const PATH: RGBColor = RGBColor(213, 94, 0);

/// Draws the field, white where it is largest and black where it is zero or less, and saves the picture.
pub fn save_density(path: &Path, picture: &DensityPicture) -> Result<(), PictureError> {
    let span = |k: usize| {
        let values = picture.samples.iter().map(|(place, _)| place[k]);
        values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (x, y) = (span(0), span(1));
    let most = picture.samples.iter().map(|(_, value)| *value).fold(0.0, f64::max);
    let [half_x, half_y] = picture.cell.map(|side| 0.5 * side);
    let drawn = draw(1000, 760, |area| {
        let area = area.titled(picture.title, ("sans-serif", 28))?;
        let mut chart = ChartBuilder::on(&area)
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(78)
            .build_cartesian_2d(x.0 - half_x..x.1 + half_x, y.0 - half_y..y.1 + half_y)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .x_desc(picture.horizontal)
            .y_desc(picture.vertical)
            .label_style(("sans-serif", 17))
            .axis_desc_style(("sans-serif", 19))
            .draw()?;
        let ground = [(x.0 - half_x, y.0 - half_y), (x.1 + half_x, y.1 + half_y)];
        chart.draw_series(std::iter::once(Rectangle::new(ground, NOTHING.filled())))?;
        chart.draw_series(picture.samples.iter().map(|([u, v], value)| {
            let level = if most > 0.0 { (255.0 * (value / most).clamp(0.0, 1.0)).round() as u8 } else { 0 };
            let cell = [(u - half_x, v - half_y), (u + half_x, v + half_y)];
            Rectangle::new(cell, RGBColor(level, level, level).filled())
        }))?;
        chart.draw_series(LineSeries::new(picture.path.iter().copied(), PATH.stroke_width(4)))?;
        chart.draw_series(picture.path.iter().map(|corner| Circle::new(*corner, 6, PATH.filled())))?;
        Ok(())
    })?;
    drawn.save(path)
}
