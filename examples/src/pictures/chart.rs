//! What all charts have in common: axes, the colours of curves, the legend.

use plotters::chart::SeriesAnno;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// Dark enough to read on white, apart for colour-blind readers too (Okabe and Ito's palette).
pub(super) const COLOURS: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

type Backend<'a> = BitMapBackend<'a>;
type Chart<'a, 'b> = ChartContext<'a, Backend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

pub(super) fn draw_axes(chart: &mut Chart, horizontal: &str, vertical: &str) -> Drawn {
    chart
        .configure_mesh()
        .light_line_style(RGBColor(238, 238, 238))
        .x_desc(horizontal)
        .y_desc(vertical)
        .label_style(("sans-serif", 17))
        .axis_desc_style(("sans-serif", 19))
        .draw()?;
    Ok(())
}

/// Puts a curve into the legend.
pub(super) fn name_curve<'a, 'b: 'a>(curve: &mut SeriesAnno<'a, Backend<'b>>, name: &str, colour: RGBColor) {
    curve.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(3)));
}

pub(super) fn draw_legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Drawn {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .label_font(("sans-serif", 18))
        .draw()?;
    Ok(())
}
