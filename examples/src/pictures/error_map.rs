//! A map of errors in colours, with its colour bar.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};

use super::{PictureError, draw};

/// What a map of errors shows.
pub struct ErrorScale<'a> {
    /// Title of the picture.
    pub title: &'a str,
    /// Label of the colour bar.
    pub label: &'a str,
    /// Errors above this share one colour.
    pub ceiling: f64,
}

/// CIEDE2000: 20 is a plainly different colour.
pub const COLOUR_DIFFERENCE: ErrorScale<'static> = ErrorScale {
    title: "Colour difference, painted against wanted",
    label: "CIEDE2000 (20 and above share a colour)",
    ceiling: 20.0,
};

/// Saves a map of errors over the texture with its colour bar. `difference` holds one value per texel, row 0 at
/// the top; `None` where there is no surface. `texel` is the side of one in the unit of the axes, which is named.
pub fn save_error_map(
    path: &Path,
    width: usize,
    difference: &[Option<f64>],
    (texel, unit): (f64, &str),
    scale: &ErrorScale,
) -> Result<(), PictureError> {
    let height = difference.len() / width.max(1);
    let zoom = (1200.0 / width as f64).min(900.0 / height as f64);
    let (map_width, map_height) = ((width as f64 * zoom) as u32, (height as f64 * zoom) as u32);
    let picture = draw(map_width + 260, map_height + 130, |area| {
        let (left, right) = area.split_horizontally(map_width + 120);
        let mut chart = ChartBuilder::on(&left)
            .caption(scale.title, ("sans-serif", 28))
            .margin(10)
            .x_label_area_size(50)
            .y_label_area_size(70)
            .build_cartesian_2d(0.0..width as f64 * texel, 0.0..height as f64 * texel)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .x_desc(format!("along the surface, {unit}"))
            .y_desc(format!("up the surface, {unit}"))
            .label_style(("sans-serif", 18))
            .axis_desc_style(("sans-serif", 20))
            .draw()?;
        let plot = chart.plotting_area();
        let (columns, rows) = plot.get_pixel_range();
        for py in rows.clone() {
            for px in columns.clone() {
                let column = (px - columns.start) as usize * width / (columns.end - columns.start) as usize;
                let row = (py - rows.start) as usize * height / (rows.end - rows.start) as usize;
                if let Some(value) = difference.get(row * width + column).copied().flatten() {
                    left.draw_pixel((px, py - left.get_base_pixel().1), &colour(value / scale.ceiling))?;
                }
            }
        }
        let mut bar = ChartBuilder::on(&right)
            .margin(10)
            .margin_top(60)
            .margin_bottom(58)
            .y_label_area_size(70)
            .build_cartesian_2d(0.0..1.0, 0.0..scale.ceiling)?;
        bar.configure_mesh()
            .disable_mesh()
            .disable_x_axis()
            .y_desc(scale.label)
            .label_style(("sans-serif", 18))
            .axis_desc_style(("sans-serif", 20))
            .draw()?;
        bar.draw_series((0..200).map(|k| {
            let (low, high) = (f64::from(k) / 200.0, f64::from(k + 1) / 200.0);
            Rectangle::new([(0.0, low * scale.ceiling), (1.0, high * scale.ceiling)], colour(low).filled())
        }))?;
        Ok(())
    })?;
    picture.save(path)
}

fn colour(share: f64) -> RGBColor {
    ViridisRGB.get_color(share.clamp(0.0, 1.0) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first value is that of the upper left cell, and none leaves the paper white.
    #[test]
    fn every_cell_has_its_own_place_and_colour() {
        let path = std::env::temp_dir().join(format!("paintcopter-{}-error-map.png", std::process::id()));
        let difference = [Some(2.0), Some(8.0), None, Some(14.0), Some(30.0), Some(20.0)];
        save_error_map(&path, 3, &difference, (0.1, "m"), &COLOUR_DIFFERENCE).unwrap();
        let picture = image::open(&path).unwrap().to_rgb8();
        std::fs::remove_file(&path).unwrap();
        // The scale stands on the right, 140 pixels wide.
        let (mut middles, right) = (Vec::new(), picture.width() - 140);
        for value in [2.0, 8.0, 14.0, 20.0] {
            let RGBColor(r, g, b) = colour(value / COLOUR_DIFFERENCE.ceiling);
            let places: Vec<_> = picture
                .enumerate_pixels()
                .filter(|(x, _, c)| *x < right && c.0 == [r, g, b])
                .map(|(x, y, _)| (x, y))
                .collect();
            let mean = |of: &dyn Fn(&(u32, u32)) -> u32| {
                places.iter().map(|at| f64::from(of(at))).sum::<f64>() / places.len() as f64
            };
            middles.push([mean(&|at| at.0), mean(&|at| at.1), places.len() as f64]);
        }
        let [two, eight, fourteen, twenty] = middles[..] else { panic!() };
        // Above and above the ceiling share a colour: two cells side by side.
        assert!((twenty[2] / two[2] - 2.0).abs() < 0.02, "{middles:?}");
        assert!((two[1] - eight[1]).abs() < 1.5 && (two[0] - fourteen[0]).abs() < 1.5, "{middles:?}");
        let side = two[2].sqrt();
        assert!((eight[0] - two[0] - side).abs() < 0.03 * side, "{middles:?}");
        assert!((fourteen[1] - two[1] - side).abs() < 0.03 * side, "{middles:?}");
        assert!((twenty[0] - two[0] - 1.5 * side).abs() < 0.03 * side, "{middles:?}");
        // The scale goes on evenly from nothing, below, to its ceiling.
        let height = |share: f64| {
            let RGBColor(r, g, b) = colour(share);
            let rows =
                picture.enumerate_pixels().filter(|(x, _, c)| *x >= right && c.0 == [r, g, b]).map(|(_, y, _)| y);
            let rows: Vec<f64> = rows.map(f64::from).collect();
            rows.iter().sum::<f64>() / rows.len() as f64
        };
        let [low, middle, high] = [0.1, 0.5, 0.9].map(height);
        assert!(low - middle > 50.0 && ((low - middle) / (middle - high) - 1.0).abs() < 0.02, "{low} {middle} {high}");
    }
}
