//! Several paints.

use paint_net::colour::{ColourImage, ColourMetric, ColourProblem, ColourSeparation, Paint, Palette};
use paint_net::procedural::lattice;
use paint_net::{Error, Image, Limits, SprayKernel};

fn nozzle() -> SprayKernel {
    SprayKernel::new(2.0, 2.0).unwrap()
}

/// Cyan, magenta, yellow, black, red, green: glazes on white.
fn glazes(count: usize) -> Palette {
    let colours =
        [[0.04, 0.52, 0.75], [0.75, 0.04, 0.35], [0.92, 0.85, 0.05], [0.06; 3], [0.8, 0.15, 0.05], [0.1, 0.45, 0.15]];
    Palette::new([1.0; 3], colours[..count].iter().map(|c| Paint::glaze("glaze", *c)).collect()).unwrap()
}

/// White and umber that cover, and a blue glaze, on a grey wall.
fn covering() -> Palette {
    let paints = vec![
        Paint::opaque("white", [0.9, 0.9, 0.88], 4.0),
        Paint::opaque("umber", [0.2, 0.12, 0.07], 2.0),
        Paint::glaze("blue", [0.1, 0.2, 0.7]),
    ];
    Palette::new([0.4, 0.38, 0.35], paints).unwrap()
}

/// A picture that this palette can paint: smooth depths of every paint.
fn paintable(palette: &Palette, side: usize) -> ColourImage {
    let bumps = |x: usize, y: usize, p: usize| {
        let bump = |k: usize| {
            let of = |salt: i64| lattice(40 + p as u64, k as i64, salt);
            let (dx, dy) = (x as f64 - of(0) * side as f64, y as f64 - of(1) * side as f64);
            0.6 * of(2) * (-(dx * dx + dy * dy) / 40.0).exp()
        };
        (0..12).map(bump).sum::<f64>()
    };
    let colour = |k: usize| {
        let depths: Vec<f64> = (0..palette.paints().len()).map(|p| bumps(k % side, k / side, p)).collect();
        palette.colour(&depths)
    };
    ColourImage::new(side, side, (0..side * side).map(colour).collect()).unwrap()
}

/// Peak signal-to-noise ratio over all bands.
fn psnr(one: &ColourImage, other: &ColourImage) -> f64 {
    let pairs = one.data().iter().flatten().zip(other.data().iter().flatten());
    let sum: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
    -10.0 * (sum / (3 * one.data().len()) as f64).log10()
}

#[test]
fn the_adjoint_is_that_of_differences() {
    for palette in [glazes(6), covering()] {
        let count = palette.paints().len();
        for salt in 0..20 {
            let depths: Vec<f64> = (0..count).map(|p| 1.5 * lattice(7, p as i64, salt)).collect();
            let weight = [0.3, -1.0, 0.8];
            let value = |d: &[f64]| palette.colour(d).iter().zip(weight).map(|(c, w)| c * w).sum::<f64>();
            for (p, found) in palette.adjoint(&depths, weight).into_iter().enumerate() {
                let shifted = |h: f64| {
                    let mut d = depths.clone();
                    d[p] += h;
                    value(&d)
                };
                let expected = (shifted(1e-5) - shifted(-1e-5)) / 2e-5;
                assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "paint {p}: {found} {expected}");
            }
        }
    }
}

#[test]
fn masstones_are_what_they_were_called() {
    let glaze = Palette::new([1.0; 3], vec![Paint::glaze("red", [0.8, 0.1, 0.2])]).unwrap();
    let cover = Palette::new([0.3; 3], vec![Paint::opaque("ochre", [0.6, 0.4, 0.1], 3.0)]).unwrap();
    for (found, expected) in [
        (glaze.colour(&[1.0]), [0.8, 0.1, 0.2]),
        (cover.colour(&[200.0]), [0.6, 0.4, 0.1]),
        (cover.colour(&[]), [0.3; 3]),
    ] {
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-6), "{found:?} is not {expected:?}");
    }
}

#[test]
fn pictures_within_reach_are_painted() {
    for (palette, least) in [(glazes(3), 36.0), (glazes(6), 36.0), (covering(), 34.0)] {
        for metric in [ColourMetric::Ciede2000, ColourMetric::Euclidean] {
            let wanted = paintable(&palette, 40);
            let painter = ColourSeparation { metric, ..ColourSeparation::default() };
            let painting = painter.paint(&ColourProblem::new(&wanted, &palette).with_kernel(&nozzle())).unwrap();
            let quality = psnr(&painting.image, &wanted);
            assert!(quality > least, "{metric:?}, {} paints: {quality} dB", palette.paints().len());
            // The sprays alone give the picture.
            let canvases: Vec<Image> = (painting.sprays.iter())
                .map(|sprays| {
                    let mut canvas = Image::filled(40, 40, 0.0);
                    for spray in sprays {
                        nozzle().stamp(spray, &mut canvas);
                    }
                    canvas
                })
                .collect();
            for k in 0..40 * 40 {
                let depths: Vec<f64> = canvases.iter().map(|c| c.data()[k]).collect();
                let (found, expected) = (painting.image.data()[k], palette.colour(&depths));
                assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-9));
            }
        }
    }
}

#[test]
fn a_thousand_bare_walls_get_no_spray() {
    for k in 0..1000 {
        let of = |what: i64| lattice(72, k, what);
        let whole = |what: i64, from: usize, to: usize| from + (of(what) * (to - from) as f64) as usize;
        let colour = |what: i64| [0, 1, 2].map(|band| 0.02 + 0.96 * of(what + band));
        let paints = (0..whole(0, 1, 7) as i64).map(|p| match of(10 + p) {
            kind if kind < 0.5 => Paint::glaze("glaze", colour(20 + 3 * p)),
            _ => Paint::opaque("cover", colour(20 + 3 * p), 0.1 + 5.0 * of(40 + p)),
        });
        let palette = Palette::new(colour(50), paints.collect()).unwrap();
        let (width, height) = (whole(1, 1, 40), whole(2, 1, 40));
        let wanted = ColourImage::new(width, height, vec![palette.substrate(); width * height]).unwrap();
        let painter = ColourSeparation {
            metric: if of(3) < 0.5 { ColourMetric::Ciede2000 } else { ColourMetric::Euclidean },
            ..ColourSeparation::default()
        };
        let limits = Limits { spray_spacing: whole(4, 1, 5), row_spacing: whole(5, 1, 5), ..Limits::default() };
        let nozzle = SprayKernel::new(0.3 + 4.0 * of(6), 1.0 + 3.0 * of(7)).unwrap();
        let painting =
            painter.paint(&ColourProblem::new(&wanted, &palette).with_kernel(&nozzle).with_limits(&limits)).unwrap();
        assert!(painting.sprays.iter().all(Vec::is_empty), "wall {k}, {} paints", palette.paints().len());
    }
}

#[test]
fn limits_and_masks_hold() {
    let palette = glazes(4);
    let wanted = paintable(&palette, 32);
    let mask: Vec<bool> = (0..32 * 32).map(|k| k % 32 < 20).collect();
    let limits = Limits { max_volume: 0.1, min_volume: 0.01, max_sprays: Some(60), ..Limits::default() };
    let kernel = nozzle();
    let problem = ColourProblem::new(&wanted, &palette).with_kernel(&kernel).with_limits(&limits);
    let problem = ColourProblem { paintable: Some(&mask), ..problem };
    let painting = ColourSeparation::default().paint(&problem).unwrap();
    for sprays in &painting.sprays {
        assert!(sprays.len() <= 60);
        assert!(sprays.iter().all(|s| (0.01..=0.1).contains(&s.volume) && s.x < 20.0));
    }
    assert!(painting.sprays.iter().map(Vec::len).sum::<usize>() > 60);
}

#[test]
fn bad_palettes_and_pictures_are_named() {
    let paint = || Paint::glaze("red", [0.8, 0.1, 0.2]);
    assert!(matches!(Palette::new([1.0; 3], vec![]), Err(Error::InvalidSetting { name: "paints", .. })));
    assert!(matches!(Palette::new([1.0; 3], vec![paint(); 7]), Err(Error::InvalidSetting { name: "paints", .. })));
    assert!(matches!(
        Palette::new([1.0, f64::NAN, 0.0], vec![paint()]),
        Err(Error::InvalidSetting { name: "substrate", .. })
    ));
    let black = Paint::glaze("hole", [0.0, 0.5, 0.5]);
    assert!(matches!(Palette::new([1.0; 3], vec![black]), Err(Error::InvalidSetting { name: "absorption", .. })));
    let nothing = Paint { name: "water".into(), absorption: [0.0; 3], scattering: [0.0; 3] };
    assert!(matches!(Palette::new([1.0; 3], vec![nothing]), Err(Error::InvalidSetting { name: "absorption", .. })));
    assert!(matches!(
        ColourImage::new(2, 1, vec![[0.5; 3], [0.0, f64::NAN, 0.0]]),
        Err(Error::Pixel { x: 1, y: 0, .. })
    ));
    assert!(matches!(ColourImage::new(2, 1, vec![[0.5; 3]]), Err(Error::ImageSize { values: 1, .. })));
    let wanted = ColourImage::new(4, 4, vec![[0.5; 3]; 16]).unwrap();
    let other = Image::filled(3, 4, 1.0);
    let palette = glazes(1);
    let problem = ColourProblem { weight: Some(&other), ..ColourProblem::new(&wanted, &palette) };
    let refused = ColourSeparation::default().paint(&problem);
    assert!(matches!(refused, Err(Error::Mismatch { what: "weight", .. })));
}
