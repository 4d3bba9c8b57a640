//! Draws the route over the strokes of a picture, in the painter's order and in that of `order_strokes`, for the planner's chapter:
//!
//! ```text
//! cargo run --release -p paintcopter --example stroke_order_figure -- docs/src/images/stroke-order.png
//! ```

use std::error::Error;
use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use paint_net::path::{Stroke, StrokeSettings, boustrophedon};
use paint_net::procedural::Texture;
use paint_net::{Deconvolution, Limits, PaintProblem, Painter, SprayKernel};
use paint_planner::stroke_order::{StrokeEnds, order_strokes};
use paint_planner::{Settings, Target};
use paintcopter::pictures::{PathPanel, save_paths};

/// Metres, as those of a mission.
const TEXEL: f64 = 0.0125;
const SPOT: f64 = 0.025;
/// Texels along each side of the picture, and its seed.
const SIDE: usize = 200;
const SEED: u64 = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let picture = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("stroke-order.png"), PathBuf::from);
    let strokes = strokes()?;
    let settings = Settings::default();
    let ends: Vec<StrokeEnds> = strokes.iter().map(|stroke| ends_of(&stroke[..])).collect();
    let order = order_strokes(&ends, None, &settings)?;
    let ordered: Vec<Vec<(f64, f64)>> = order
        .strokes
        .iter()
        .map(|stroke| {
            let mut points = strokes[stroke.index].clone();
            if stroke.reversed {
                points.reverse();
            }
            points
        })
        .collect();
    let names = [("row by row", &strokes), ("in order", &ordered)].map(|(name, route)| {
        format!(
            "{name}: {:.0} m of strokes, {:.0} m between them",
            route.iter().map(|s| length(s)).sum::<f64>(),
            between(route)
        )
    });
    println!("{}\n{}", names[0], names[1]);
    let panel = |name, route: &[Vec<(f64, f64)>]| PathPanel {
        horizontal: "along the wall, m",
        vertical: "up, m",
        curves: vec![(name, route.concat())],
    };
    save_paths(
        &picture,
        "The same strokes before and after they are ordered",
        &[panel(&names[0], &strokes), panel(&names[1], &ordered)],
    )?;
    Ok(())
}

/// Strokes of a drawing, as places on a wall.
fn strokes() -> Result<Vec<Vec<(f64, f64)>>, paint_net::Error> {
    let wanted = Texture::Glyph.image(SEED, SIDE);
    let kernel = SprayKernel::new(SPOT / TEXEL, 3.5)?;
    let limits = Limits { row_spacing: 3, min_volume: 0.01, ..Limits::default() };
    let painting =
        Deconvolution::default().paint(&PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits))?;
    let place = |x: f64, y: f64| (x * TEXEL, (SIDE as f64 - y) * TEXEL);
    let on_wall = |stroke: Stroke| stroke.sprays.iter().map(|spray| place(spray.x, spray.y)).collect();
    Ok(boustrophedon(&painting.sprays, &StrokeSettings::default())?.into_iter().map(on_wall).collect())
}

fn ends_of(stroke: &[(f64, f64)]) -> StrokeEnds {
    let target = |&(y, z): &(f64, f64)| Target {
        point: Point3::new(0.0, y, z),
        normal: -Vector3::x_axis(),
        dose: 0.0,
        time: None,
        stand_off: None,
    };
    StrokeEnds { first: target(&stroke[0]), last: target(&stroke[stroke.len() - 1]) }
}

fn length(stroke: &[(f64, f64)]) -> f64 {
    stroke.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

fn between(route: &[Vec<(f64, f64)>]) -> f64 {
    route.windows(2).map(|pair| distance(pair[0][pair[0].len() - 1], pair[1][0])).sum()
}

fn distance(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0).hypot(a.1 - b.1)
}
