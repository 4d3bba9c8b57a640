//! Properties every painter must have.

mod area_fill;
mod ghost_pixels;

use paint_net::model::MonotoneCurve;
use paint_net::painters::{
    AdaptiveRows, AreaFill, Centrelines, ClosedLoopPainter, FreeSprays, LayerPlanning, Layered, MatchingPursuit,
    ThresholdSpacing,
};
use paint_net::path::{StrokeSettings, boustrophedon};
use paint_net::procedural::{Texture, lattice};
use paint_net::{
    Deconvolution, Error, Feedback, Image, Limits, PaintProblem, Painter, Painting, Saturation, Spray, SprayKernel,
    metrics,
};

fn kernel() -> SprayKernel {
    SprayKernel::new(2.0, 4.0).unwrap()
}

fn painters() -> Vec<Box<dyn Painter>> {
    vec![
        Box::new(Deconvolution::default()),
        Box::new(Centrelines::default()),
        Box::new(AreaFill::default()),
        Box::new(AdaptiveRows::default()),
        Box::new(MatchingPursuit::default()),
        Box::new(Feedback::shipped().unwrap()),
        Box::new(FreeSprays { sprays: 100, ..FreeSprays::default() }),
        Box::new(ClosedLoopPainter::new(Feedback::shipped().unwrap())),
        Box::new(Layered::new(Deconvolution::default())),
        Box::new(Layered { planning: LayerPlanning::Sequential, ..Layered::new(Deconvolution::default()) }),
    ]
}

fn paint(painter: &dyn Painter, problem: &PaintProblem, limits: &Limits) -> Painting {
    painter.paint(&problem.with_kernel(&kernel()).with_limits(limits)).unwrap()
}

/// The canvas by the definition: every spray's Gaussian added pixel by pixel.
fn render(painting: &Painting, kernel: &SprayKernel, bare: &Image) -> Image {
    Image::from_fn(bare.width(), bare.height(), |x, y| {
        let mut depth = bare.at(x, y);
        for s in &painting.sprays {
            let (dx, dy) = (x as f64 - s.x, y as f64 - s.y);
            if dx.abs().max(dy.abs()) <= kernel.cut() * s.sigma {
                depth += s.volume * (-(dx * dx + dy * dy) / (2.0 * s.sigma.powi(2))).exp();
            }
        }
        depth
    })
}

#[test]
fn canvas_is_the_sum_of_the_sprays() {
    let wanted = Texture::Fbm.image(5, 40);
    let before = Image::from_fn(40, 40, |x, _| 0.01 * x as f64);
    let problem = PaintProblem { canvas: Some(&before), ..PaintProblem::new(&wanted) };
    for painter in painters() {
        let painting = paint(&*painter, &problem, &Limits::default());
        let expected = render(&painting, &kernel(), &before);
        for (a, b) in painting.canvas.data().iter().zip(expected.data()) {
            assert!((a - b).abs() < 1e-9, "{}: {a} against {b}", painter.name());
        }
        for (ink, depth) in painting.ink.data().iter().zip(painting.canvas.data()) {
            assert!((ink - depth.tanh()).abs() < 1e-12);
        }
    }
}

#[test]
fn a_thousand_empty_pictures_get_no_spray() {
    for k in 0..1000_u64 {
        let of = |what: i64| lattice(71, k as i64, what);
        let whole = |what: i64, from: usize, to: usize| from + (of(what) * (to - from) as f64) as usize;
        let blank = Image::filled(whole(0, 1, 50), whole(1, 1, 50), 0.0);
        let before = Image::from_fn(blank.width(), blank.height(), |x, y| 4.0 * lattice(k, x as i64, y as i64));
        let canvas = (of(2) < 0.5).then_some(&before);
        let nozzle = SprayKernel::new(0.3 + 5.0 * of(3), 1.0 + 4.0 * of(4)).unwrap();
        let limits = Limits {
            spray_spacing: whole(5, 1, 6),
            row_spacing: whole(6, 1, 6),
            max_volume: 0.01 + 5.0 * of(7),
            min_volume: 0.01 * of(8),
            max_sprays: (of(9) < 0.3).then_some(whole(10, 0, 500)),
        };
        let curve =
            if of(11) < 0.5 { Saturation::Tanh } else { Saturation::BeerLambert { density: 0.1 + 3.0 * of(12) } };
        let painters = painters();
        let painter = &painters[k as usize % painters.len()];
        let problem = PaintProblem { canvas, ..PaintProblem::new(&blank) };
        let painting =
            painter.paint(&problem.with_kernel(&nozzle).with_saturation(&curve).with_limits(&limits)).unwrap();
        assert!(painting.sprays.is_empty(), "picture {k}: {} sprays by {}", painting.sprays.len(), painter.name());
    }
}

#[test]
fn none_may_be_asked_for() {
    let wanted = Texture::Worley.image(2, 32);
    let before = wanted.map(|ink| 0.5 * ink);
    let problem = PaintProblem { canvas: Some(&before), ..PaintProblem::new(&wanted) };
    for painter in painters() {
        let painting = paint(&*painter, &problem, &Limits { max_sprays: Some(0), ..Limits::default() });
        assert!(painting.sprays.is_empty() && painting.canvas == before, "{}", painter.name());
    }
}

#[test]
fn masks_and_limits_hold() {
    let wanted = Texture::Worley.image(2, 48);
    let paintable: Vec<bool> = (0..48 * 48).map(|k| (k % 48) < 24).collect();
    let weight = Image::from_fn(48, 48, |_, y| if y < 30 { 1.0 } else { 0.0 });
    let problem = PaintProblem { paintable: Some(&paintable), weight: Some(&weight), ..PaintProblem::new(&wanted) };
    let limits = Limits { max_volume: 0.2, min_volume: 0.02, max_sprays: Some(120), ..Limits::default() };
    for painter in painters() {
        let painting = paint(&*painter, &problem, &limits);
        if !["layered", "closed loop"].contains(&painter.name()) {
            assert!(painting.sprays.len() <= 120, "{} sprays by {}", painting.sprays.len(), painter.name());
        }
        if painter.name() != "layered" {
            assert!(painting.sprays.iter().all(|s| s.volume >= 0.02));
        }
        assert!(painting.sprays.len() > 40);
        assert!(painting.sprays.iter().all(|s| s.volume <= 0.2 + 1e-12 && s.x < 23.5));
        // A nozzle that reaches 8 px has no reason to go deep into the part nobody looks at.
        assert!(painting.sprays.iter().all(|s| s.y <= 40.0), "{}", painter.name());
    }
}

#[test]
fn deconvolution_meets_the_optimality_conditions() {
    // At the optimum of the convex part the gradient vanishes on sprays and is not negative elsewhere.
    let wanted = Texture::Stripes.image(3, 32);
    let exact = Deconvolution { iterations: 5000, tolerance: 0.0 };
    let painting = paint(&exact, &PaintProblem::new(&wanted), &Limits::default());
    let k = kernel();
    let slope = |cx: i64, cy: i64| -> f64 {
        let mut sum = 0.0;
        for y in 0..32_i64 {
            for x in 0..32_i64 {
                if (x - cx).abs() <= k.radius() as i64 && (y - cy).abs() <= k.radius() as i64 {
                    let (a, r2) = (painting.ink.at(x as usize, y as usize), ((x - cx).pow(2) + (y - cy).pow(2)) as f64);
                    sum += (a - wanted.at(x as usize, y as usize)) * (1.0 - a * a) * (-r2 / 8.0).exp();
                }
            }
        }
        sum
    };
    for cy in (0..32).step_by(2) {
        for cx in (0..32).step_by(2) {
            let spray = painting.sprays.iter().find(|s| s.x == cx as f64 && s.y == cy as f64);
            let gradient = slope(cx, cy);
            match spray {
                Some(s) if s.volume < 3.0 => assert!(gradient.abs() < 2e-4, "({cx}, {cy}): {gradient}"),
                Some(_) => assert!(gradient < 2e-4),
                None => assert!(gradient > -2e-4, "({cx}, {cy}): {gradient}"),
            }
        }
    }
}

#[test]
fn the_first_greedy_spray_is_the_best_single_spray() {
    let wanted = Texture::Glyph.image(9, 24);
    let one = MatchingPursuit { placements: 1, min_gain: 1e-12, refit: 0, ..MatchingPursuit::default() };
    let limits = Limits { spray_spacing: 1, row_spacing: 1, ..Limits::default() };
    let painting = paint(&one, &PaintProblem::new(&wanted), &limits);
    let k = kernel();
    // On a bare wall the linearisation is exact at zero: the best cell maximises <g, y>² / <g, g>.
    let score = |cx: usize, cy: usize| -> f64 {
        let (mut gy, mut gg) = (0.0, 0.0);
        for y in 0..24_usize {
            for x in 0..24_usize {
                if x.abs_diff(cx) <= k.radius() && y.abs_diff(cy) <= k.radius() {
                    let g = (-((x.abs_diff(cx).pow(2) + y.abs_diff(cy).pow(2)) as f64) / 8.0).exp();
                    gy += g * wanted.at(x, y);
                    gg += g * g;
                }
            }
        }
        gy * gy / gg
    };
    let best = (0..24 * 24).map(|c| score(c % 24, c / 24)).fold(0.0, f64::max);
    let chosen = painting.sprays[0];
    assert!((score(chosen.x as usize, chosen.y as usize) - best).abs() < 1e-9);
}

#[test]
fn layers_climb_and_cost_little() {
    let wanted = Texture::Fbm.image(11, 64);
    let problem = PaintProblem::new(&wanted);
    let psnr = |p: &Painting| metrics::psnr(&p.ink, &wanted, None).unwrap();
    let direct = psnr(&paint(&Deconvolution::default(), &problem, &Limits::default()));
    for (planning, loss) in [(LayerPlanning::Joint, 1e-6), (LayerPlanning::Sequential, 1.5)] {
        let painter = Layered { planning, ..Layered::new(Deconvolution::default()) };
        let thresholds = painter.thresholds(&problem).unwrap();
        let layers = paint(&painter, &problem, &Limits::default()).into_layers();
        assert_eq!(layers.len(), thresholds.len());
        assert!(layers.len() >= 3);
        for pair in layers.windows(2) {
            assert!(pair[0].canvas.data().iter().zip(pair[1].canvas.data()).all(|(a, b)| *b >= *a - 1e-12));
        }
        for (layer, top) in layers.iter().zip(&thresholds) {
            let highest = layer.ink.data().iter().fold(0.0_f64, |m, &v| m.max(v));
            assert!(highest < top + 0.1, "layer up to {top} reaches {highest}");
        }
        let reached = psnr(&layers[layers.len() - 1]);
        assert!(reached >= direct - loss, "{planning:?}: {reached} against {direct}");
    }
}

/// Layers of a painting along lines are flown along them, too.
#[test]
fn a_layer_keeps_the_strokes_of_the_plan() {
    // A bow that grows darker, thin enough to be a line.
    let wanted = Image::from_fn(90, 60, |x, y| {
        let away = ((x as f64 - 45.0).hypot(y as f64 - 70.0) - 50.0).abs();
        (0.3 + 0.6 * x as f64 / 90.0) * f64::from(u8::from(away < 2.0))
    });
    let kernel = SprayKernel::new(2.0, 3.5).unwrap();
    let layered = Layered::new(Centrelines::default());
    let painting = layered.paint(&PaintProblem::new(&wanted).with_kernel(&kernel)).unwrap();
    assert!(painting.layers.len() >= 3);
    for layer in &painting.layers {
        let of = |sprays: &mut dyn Iterator<Item = Spray>| {
            let mut all: Vec<[u64; 3]> = sprays.map(|s| [s.x, s.y, s.volume].map(f64::to_bits)).collect();
            all.sort_unstable();
            all
        };
        let along = layer.strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied());
        assert_eq!(of(&mut { along }), of(&mut layer.sprays.iter().copied()));
        assert!(3 * layer.strokes.len() <= layer.sprays.len(), "{} of {}", layer.strokes.len(), layer.sprays.len());
        assert!(layer.strokes.iter().all(|stroke| !stroke.sprays.is_empty()));
    }
}

#[test]
fn thresholds_follow_both_readings() {
    // Ink 0.00, 0.01, … 0.99: the 20th percentile by linear interpolation is 0.198.
    let ramp = Image::from_fn(100, 1, |x, _| x as f64 / 100.0);
    let problem = PaintProblem::new(&ramp);
    let step = 50.0 / 255.0;
    let from_base = Layered::new(Deconvolution::default());
    let expected = [0.198, 0.198 + step, 0.198 + 2.0 * step, 0.198 + 3.0 * step, 0.198 + 4.0 * step, 1.0];
    let found = from_base.thresholds(&problem).unwrap();
    assert_eq!(found.len(), expected.len());
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    let absolute = Layered { spacing: ThresholdSpacing::Absolute, ..from_base };
    let found = absolute.thresholds(&problem).unwrap();
    let expected = [0.198, 2.0 * step, 3.0 * step, 4.0 * step, 5.0 * step, 1.0];
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
}

#[test]
fn saturation_laws_invert_and_differentiate() {
    let knots: Vec<(f64, f64)> =
        (0..=40).map(|k| 0.1 * f64::from(k)).map(|c| (c, 0.9 * (1.0 - (-1.3 * c).exp()))).collect();
    let curves = [
        Saturation::Tanh,
        Saturation::BeerLambert { density: 1.7 },
        Saturation::Curve(MonotoneCurve::new(&knots).unwrap()),
    ];
    for curve in &curves {
        assert_eq!(curve.forward(0.0), 0.0);
        for k in 1..200 {
            let depth = 0.01 * f64::from(k);
            let ink = curve.forward(depth);
            assert!((curve.inverse(ink) - depth).abs() < 1e-9, "{curve:?} at {depth}");
            let difference = (curve.forward(depth + 1e-6) - curve.forward(depth - 1e-6)) / 2e-6;
            assert!((curve.derivative(depth) - difference).abs() < 1e-6 + 1e-6 / depth, "{curve:?} at {depth}");
        }
        assert!((curve.forward(curve.inverse(1.0)) - curve.max_ink()).abs() < 1e-12);
    }
    // The curve reproduces the curve it was sampled from.
    let curve = &curves[2];
    assert!(
        (0..390).map(|k| 0.01 * f64::from(k)).all(|c| (curve.forward(c) - 0.9 * (1.0 - (-1.3 * c).exp())).abs() < 2e-4)
    );
    for bad in [
        vec![(0.0, 0.0)],
        vec![(0.0, 0.1), (1.0, 0.5)],
        vec![(0.0, 0.0), (1.0, 0.5), (1.0, 0.6)],
        vec![(0.0, 0.0), (1.0, 1.5)],
    ] {
        assert!(matches!(MonotoneCurve::new(&bad), Err(Error::Curve { .. })));
    }
}

#[test]
fn a_curve_that_is_tanh_gives_the_same_painting() {
    let knots: Vec<(f64, f64)> = (0..=600).map(|k| 0.01 * f64::from(k)).map(|c| (c, c.tanh())).collect();
    let curve = Saturation::Curve(MonotoneCurve::new(&knots).unwrap());
    let wanted = Texture::Fbm.image(21, 40);
    let problem = PaintProblem::new(&wanted);
    for painter in painters() {
        let psnr = |curve: &Saturation| {
            let p = painter.paint(&problem.with_kernel(&kernel()).with_saturation(curve)).unwrap();
            metrics::psnr(&p.ink, &wanted, None).unwrap()
        };
        assert!((psnr(&curve) - psnr(&Saturation::Tanh)).abs() < 0.2, "{}", painter.name());
    }
}

#[test]
fn strokes_keep_every_spray_and_alternate() {
    let wanted = Texture::Glyph.image(4, 60);
    let painting = paint(
        &Deconvolution::default(),
        &PaintProblem::new(&wanted),
        &Limits { min_volume: 0.02, ..Limits::default() },
    );
    let strokes = boustrophedon(&painting.sprays, &StrokeSettings::default()).unwrap();
    assert_eq!(strokes.iter().map(|s| s.sprays.len()).sum::<usize>(), painting.sprays.len());
    let total = |sprays: &mut dyn Iterator<Item = f64>| sprays.sum::<f64>();
    let (a, b) = (
        total(&mut strokes.iter().flat_map(|s| s.sprays.iter().map(|p| p.volume))),
        total(&mut painting.sprays.iter().map(|p| p.volume)),
    );
    assert!((a - b).abs() < 1e-9);
    assert!(strokes.len() > 20);
    let mut direction_of_row = std::collections::BTreeMap::new();
    for stroke in &strokes {
        assert!(stroke.sprays.windows(2).all(|p| p[0].y == p[1].y && (p[0].x - p[1].x).abs() <= 8.0));
        if stroke.sprays.len() > 1 {
            let forward = stroke.sprays[1].x > stroke.sprays[0].x;
            assert_eq!(*direction_of_row.entry(stroke.sprays[0].y as i64).or_insert(forward), forward);
        }
    }
    let directions: Vec<bool> = direction_of_row.into_values().collect();
    assert!(directions.windows(2).filter(|d| d[0] != d[1]).count() * 2 > directions.len());
}

/// A ring, a stem and a dot, four pixels wide.
fn line_art() -> Image {
    let soft = |distance: f64| 0.85 / (1.0 + ((distance - 2.0) / 0.3).exp());
    Image::from_fn(110, 70, |x, y| {
        let (x, y) = (x as f64, y as f64);
        let ring = ((x - 35.0).hypot(y - 35.0) - 20.0).abs();
        let stem = (x - 75.0).hypot(y - y.clamp(15.0, 55.0));
        let dot = (x - 95.0).hypot(y - 20.0);
        soft(ring.min(stem).min(dot))
    })
}

#[test]
fn lines_become_strokes_along_them_and_nearer_to_the_drawing_than_rows() {
    let wanted = line_art();
    let limits = Limits { row_spacing: 3, min_volume: 0.01, ..Limits::default() };
    let lines = paint(&Centrelines::default(), &PaintProblem::new(&wanted), &limits);
    let rows = paint(&Deconvolution::default(), &PaintProblem::new(&wanted), &limits);
    let psnr = |painting: &Painting| metrics::psnr(&painting.ink, &wanted, None).unwrap();
    assert!(psnr(&lines) > psnr(&rows) + 0.3, "{} against {}", psnr(&lines), psnr(&rows));
    // Every spray lies in one stroke, in order.
    let flown: Vec<_> = lines.strokes.iter().flat_map(|stroke| stroke.sprays.iter().copied()).collect();
    assert_eq!(flown, lines.sprays);
    let in_rows = boustrophedon(&rows.sprays, &StrokeSettings::default()).unwrap();
    assert!(rows.strokes.is_empty() && lines.strokes.len() <= 6, "{} strokes", lines.strokes.len());
    assert!(in_rows.len() > 4 * lines.strokes.len(), "{} in rows", in_rows.len());
    // The ring goes round once, on its middle, without a gap.
    let ring = lines.strokes.iter().max_by_key(|stroke| stroke.sprays.len()).unwrap();
    for pair in ring.sprays.windows(2) {
        let radius = (pair[0].x - 35.0).hypot(pair[0].y - 35.0);
        assert!((radius - 20.0).abs() < 1.0, "radius {radius}");
        assert!((pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y) < 1.5 * limits.spray_spacing as f64);
    }
    let around = std::f64::consts::TAU * 20.0 / limits.spray_spacing as f64;
    assert!((ring.sprays.len() as f64 / around - 1.0).abs() < 0.1, "{} sprays for {around}", ring.sprays.len());
}

#[test]
fn a_picture_without_lines_is_painted_as_by_deconvolution() {
    let wanted = Texture::Fbm.image(5, 40).map(|ink| 0.4 + 0.2 * ink);
    let psnr = |painter: &dyn Painter| {
        let painting = paint(painter, &PaintProblem::new(&wanted), &Limits::default());
        metrics::psnr(&painting.ink, &wanted, None).unwrap()
    };
    let (lines, rows) = (psnr(&Centrelines::default()), psnr(&Deconvolution::default()));
    assert!((lines - rows).abs() < 0.5, "{lines} against {rows}");
}

#[test]
fn bad_input_is_named() {
    let wanted = Image::filled(8, 8, 0.5);
    let other = Image::filled(9, 8, 0.5);
    let run = |problem: &PaintProblem, limits: &Limits| {
        Deconvolution::default().paint(&problem.with_kernel(&kernel()).with_limits(limits))
    };
    let problem = PaintProblem::new(&wanted);
    let mismatched = PaintProblem { canvas: Some(&other), ..problem };
    assert!(matches!(run(&mismatched, &Limits::default()), Err(Error::Mismatch { what: "canvas", .. })));
    let negative = Image::filled(8, 8, -0.1);
    let task_negative = PaintProblem { canvas: Some(&negative), ..problem };
    assert!(matches!(run(&task_negative, &Limits::default()), Err(Error::Pixel { what: "canvas", x: 0, y: 0, .. })));
    let over = Image::filled(8, 8, 1.5);
    assert!(matches!(run(&PaintProblem::new(&over), &Limits::default()), Err(Error::Pixel { what: "reference", .. })));
    let nowhere = vec![false; 64];
    let task_nowhere = PaintProblem { paintable: Some(&nowhere), ..problem };
    assert!(matches!(run(&task_nowhere, &Limits::default()), Err(Error::EmptyProblem(_))));
    let zero = Limits { spray_spacing: 0, ..Limits::default() };
    assert!(matches!(run(&problem, &zero), Err(Error::InvalidSetting { name: "spray_spacing", .. })));
    assert!(matches!(Image::new(2, 2, vec![0.0, 0.0, 0.0, f64::NAN]), Err(Error::Pixel { x: 1, y: 1, .. })));
    assert!(matches!(Image::new(2, 2, vec![0.0]), Err(Error::ImageSize { values: 1, .. })));
    assert!(matches!(SprayKernel::new(f64::NAN, 2.0), Err(Error::InvalidSetting { name: "sigma", .. })));
    assert!(matches!(metrics::ssim(&wanted, &other, None), Err(Error::Mismatch { .. })));
}
