//! Strokes drawn row by row, in the order and the directions that take the least time between them.

use paint_planner::nalgebra::{Point3, Vector3};
use paint_planner::stroke_order::{StrokeEnds, order_strokes, transit_lower_bound};
use paint_planner::{Error, Settings, Target};

fn main() -> Result<(), Error> {
    let target = |y: f64, z: f64| Target {
        point: Point3::new(0.0, y, z),
        normal: -Vector3::x_axis(),
        dose: 0.0,
        time: None,
        stand_off: None,
    };
    // Rows of a picture, each broken in two where nothing is painted; all drawn from left to right.
    let stroke = |row: f64, from: f64, to: f64| StrokeEnds { first: target(from, row), last: target(to, row) };
    let rows = (0..12).map(|k| (0.1 * f64::from(k), 0.6 + 0.3 * f64::from(k).sin()));
    let strokes: Vec<StrokeEnds> =
        rows.flat_map(|(row, gap)| [stroke(row, 0.0, gap), stroke(row, gap + 0.4, 2.0)]).collect();
    let settings = Settings::default();
    let order = order_strokes(&strokes, None, &settings)?;
    for stroke in &order.strokes {
        let StrokeEnds { first, last } = strokes[stroke.index];
        let [from, to] = if stroke.reversed { [last, first] } else { [first, last] };
        println!("row {:.1} m: {:4.2} m to {:4.2} m", from.point.z, from.point.y, to.point.y);
    }
    let bound = transit_lower_bound(&strokes, None, &settings, 200)?;
    println!("{:.1} s between the strokes; no order takes less than {bound:.1} s", order.transit_time);
    Ok(())
}
