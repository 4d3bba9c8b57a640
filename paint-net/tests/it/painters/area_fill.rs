//! Where a filled area is sprayed from.

use super::kernel;
use paint_net::painters::AreaFill;
use paint_net::{Image, PaintProblem, Painter};

/// Thin rings, stars and zigzags, out of whose corners a smoothed line would cut: every spray lies on a pixel that shall have paint.
#[test]
fn sprays_lie_where_paint_is_wanted() {
    let kernel = kernel();
    let ring = |x: f64, y: f64| ((x % 24.0 - 12.0).hypot(y % 24.0 - 12.0) - (3.0 + x / 24.0 + y / 12.0)).abs();
    let zigzag = |x: f64, y: f64| (y % 16.0 - 8.0 - 1.5 * ((x % 10.0) - 5.0).abs() + 4.0).abs() / 1.8;
    let star = |x: f64, y: f64| {
        let (x, y) = ((x % 32.0 - 16.0).abs(), (y % 32.0 - 16.0).abs());
        (x * y).sqrt() - 2.0
    };
    let shapes: [&dyn Fn(f64, f64) -> f64; 3] = [&ring, &zigzag, &star];
    for (shape, distance) in shapes.iter().enumerate() {
        for width in [0.6, 0.9, 1.4] {
            let wanted = Image::from_fn(64, 64, |x, y| if distance(x as f64, y as f64) <= width { 0.6 } else { 0.0 });
            let painting = AreaFill::default().paint(&PaintProblem::new(&wanted).with_kernel(&kernel)).unwrap();
            assert!(painting.sprays.len() > 10, "{}", painting.sprays.len());
            for spray in &painting.sprays {
                let [x, y] = [spray.x, spray.y].map(|c| c.round() as usize);
                assert!(wanted.at(x, y) > 0.0, "shape {shape}, {width}: a spray at {} {}", spray.x, spray.y);
            }
        }
    }
}
/// Across the rows the depth varies by no more than is asked for.
#[test]
fn an_even_area_is_as_even_as_it_is_told() {
    let (kernel, wanted) = (kernel(), Image::filled(64, 64, 0.4));
    for ripple in [0.005, 0.05] {
        let painting =
            AreaFill { ripple, ..AreaFill::default() }.paint(&PaintProblem::new(&wanted).with_kernel(&kernel)).unwrap();
        // Away from the rims.
        let depths: Vec<f64> =
            (20..44).flat_map(|y| (20..44).map(move |x| (x, y))).map(|(x, y)| painting.canvas.at(x, y)).collect();
        let mean = depths.iter().sum::<f64>() / depths.len() as f64;
        let deviation = (depths.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / depths.len() as f64).sqrt();
        assert!(deviation < 2.0 * ripple * mean, "{deviation} of {mean}, {ripple} asked");
    }
}
