//! Rows that follow the picture: few metres where wide rows resolve it, the limits' rows where they do not.

use std::f64::consts::TAU;

use paint_net::painters::{AdaptiveRows, RowWidth};
use paint_net::path::{Stroke, StrokeSettings, boustrophedon};
use paint_net::{Deconvolution, Error, Image, Limits, PaintProblem, Painter, Painting, SprayKernel, metrics};

const LIMITS: Limits = Limits { spray_spacing: 2, row_spacing: 3, max_volume: 3.0, min_volume: 0.01, max_sprays: None };

fn paint(painter: &dyn Painter, wanted: &Image) -> Painting {
    let kernel = SprayKernel::new(2.0, 3.5).unwrap();
    painter.paint(&PaintProblem::new(wanted).with_kernel(&kernel).with_limits(&LIMITS)).unwrap()
}

/// Pixels flown with the valve open.
fn length(strokes: &[Stroke]) -> f64 {
    let ways =
        |stroke: &Stroke| stroke.sprays.windows(2).map(|p| (p[1].x - p[0].x).hypot(p[1].y - p[0].y)).sum::<f64>();
    strokes.iter().map(ways).sum()
}

/// Length over that of the limits' rows, the similarities of both, and the painting.
fn against_equal_rows(wanted: &Image) -> (f64, [f64; 2], Painting) {
    let rows = paint(&Deconvolution::default(), wanted);
    let adaptive = paint(&AdaptiveRows::default(), wanted);
    let usual = length(&boustrophedon(&rows.sprays, &StrokeSettings::default()).unwrap());
    let ssim = |painting: &Painting| metrics::ssim(&painting.ink, wanted, None).unwrap();
    (length(&adaptive.strokes) / usual, [ssim(&adaptive), ssim(&rows)], adaptive)
}

/// Bands of a period of 13 pixels, which rows 6 pixels apart cannot follow, nor those 3 apart well.
fn bands(along: f64) -> f64 {
    0.4 + 0.12 * (TAU * along / 13.0).sin()
}

#[test]
fn bands_are_crossed_by_wide_rows() {
    for down in [true, false] {
        let wanted = Image::from_fn(216, 180, |x, y| bands(if down { y as f64 } else { x as f64 }));
        let (length, [ssim, usual], painting) = against_equal_rows(&wanted);
        assert!(length < 0.52 && ssim > usual - 0.01, "{down}: {length} of the way, {ssim} {usual}");
        let wide = painting.sprays.iter().filter(|spray| spray.sigma > 2.8).count();
        assert!(10 * wide > 9 * painting.sprays.len());
        // All rows run across the bands.
        let across =
            |stroke: &Stroke| stroke.sprays.windows(2).all(|p| if down { p[0].x == p[1].x } else { p[0].y == p[1].y });
        assert!(painting.strokes.iter().all(across));
    }
}

#[test]
fn detail_in_both_directions_keeps_the_rows_of_the_limits() {
    let checks = Image::from_fn(108, 108, |x, y| {
        let wave = |at: usize| (TAU * at as f64 / 9.0).sin();
        0.5 + 0.2 * wave(x) * wave(y)
    });
    let (length, [ssim, usual], painting) = against_equal_rows(&checks);
    assert!(length > 0.9 && ssim > usual - 0.01, "{length} of the way, {ssim} {usual}");
    assert!(painting.sprays.iter().all(|spray| spray.sigma <= 2.0));
}

/// Each half has what it needs.
#[test]
fn a_smooth_part_has_wide_rows_beside_a_part_with_detail() {
    let wanted = Image::from_fn(216, 108, |x, y| {
        let detail = (TAU * x as f64 / 9.0).sin() * (TAU * y as f64 / 9.0).sin();
        0.5 + if x < 108 { 0.0 } else { 0.2 * detail }
    });
    let (length, [ssim, usual], painting) = against_equal_rows(&wanted);
    assert!((0.7..0.85).contains(&length) && ssim > usual - 0.01, "{length} of the way, {ssim} {usual}");
    let mean_sigma = |from: f64, to: f64| {
        let there: Vec<f64> =
            painting.sprays.iter().filter(|s| (from..to).contains(&s.x)).map(|spray| spray.sigma).collect();
        there.iter().sum::<f64>() / there.len() as f64
    };
    let [smooth, detailed] = [mean_sigma(0.0, 100.0), mean_sigma(116.0, 216.0)];
    assert!(smooth > 2.6 && detailed < 2.1, "{smooth} {detailed}");
}

#[test]
fn limits_masks_and_small_pictures_are_obeyed() {
    let kernel = SprayKernel::new(2.0, 3.5).unwrap();
    for (width, height) in [(1, 1), (5, 40), (61, 7), (37, 73)] {
        let wanted = Image::from_fn(width, height, |x, y| 0.5 + 0.4 * ((x + 2 * y) as f64).sin());
        let limits = Limits { max_volume: 0.3, max_sprays: Some(9), ..LIMITS };
        let mask: Vec<bool> = (0..width * height).map(|k| k % width < width.div_ceil(2)).collect();
        let problem = PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits).with_paintable(&mask);
        let painting = AdaptiveRows::default().paint(&problem).unwrap();
        assert!((1..=9).contains(&painting.sprays.len()), "{width} x {height}: {}", painting.sprays.len());
        for spray in &painting.sprays {
            assert!((0.01..=0.3).contains(&spray.volume) && spray.x < width.div_ceil(2) as f64, "{spray:?}");
        }
        assert_eq!(painting.strokes.iter().map(|stroke| stroke.sprays.len()).sum::<usize>(), painting.sprays.len());
        assert!(painting == AdaptiveRows::default().paint(&problem).unwrap());
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let wanted = Image::filled(8, 8, 0.5);
    let usual = AdaptiveRows::default();
    for (named, painter) in [
        ("widths", AdaptiveRows { widths: Vec::new(), ..usual.clone() }),
        ("spread", AdaptiveRows { widths: vec![RowWidth { spacing: 2.0, spread: 0.0 }], ..usual.clone() }),
        ("spacing", AdaptiveRows { widths: vec![RowWidth { spacing: f64::NAN, spread: 1.0 }], ..usual.clone() }),
        ("tolerance", AdaptiveRows { tolerance: -0.1, ..usual.clone() }),
        ("turn", AdaptiveRows { turn: f64::INFINITY, ..usual }),
    ] {
        let refused = painter.paint(&PaintProblem::new(&wanted)).unwrap_err();
        assert!(matches!(refused, Error::InvalidSetting { name, .. } if name == named), "{named}: {refused}");
    }
}
