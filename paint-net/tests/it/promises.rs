//! What limits and metrics promise, to the last bit, and that every part of a problem counts.

use paint_net::colour::{ColourImage, ColourProblem, ColourSeparation, MAX_PAINTS, Paint, Palette};
use paint_net::model::MonotoneCurve;
use paint_net::painters::{ClosedLoopPainter, FreeSprays, Layered, MatchingPursuit, SlewLimited};
use paint_net::procedural::{Texture, lattice};
use paint_net::{
    Deconvolution, Feedback, Image, Limits, Observer, PaintProblem, Painter, Saturation, Spray, SprayKernel, metrics,
};

fn painters() -> Vec<Box<dyn Painter>> {
    vec![
        Box::new(Deconvolution::default()),
        Box::new(MatchingPursuit::default()),
        Box::new(Feedback::shipped().unwrap()),
        Box::new(FreeSprays { sprays: 120, ..FreeSprays::default() }),
        Box::new(ClosedLoopPainter::new(Deconvolution::default())),
    ]
}

fn psnr(ink: &Image, wanted: &Image) -> f64 {
    metrics::psnr(ink, wanted, None).unwrap()
}

#[test]
fn no_spray_is_smaller_than_the_smallest_volume() {
    let mut sprays = [0; 5];
    for (texture, seed) in [(Texture::Worley, 2), (Texture::Fbm, 5), (Texture::Stripes, 3), (Texture::Glyph, 4)] {
        let wanted = texture.image(seed, 40);
        for min_volume in [0.02, 0.1, 0.2, 0.35] {
            let limits = Limits { min_volume, ..Limits::default() };
            for (painter, count) in painters().iter().zip(&mut sprays) {
                let painting = painter.paint(&PaintProblem::new(&wanted).with_limits(&limits)).unwrap();
                *count += painting.sprays.len();
                for s in &painting.sprays {
                    assert!(s.volume >= min_volume, "{}: {} of at least {min_volume}", painter.name(), s.volume);
                }
                // What is left out is not on the canvas either.
                let again = paint_net::Painting::render(&PaintProblem::new(&wanted), painting.sprays.clone());
                for (a, b) in painting.canvas.data().iter().zip(again.canvas.data()) {
                    assert!((a - b).abs() < 1e-9, "{}, at least {min_volume}: {a} {b}", painter.name());
                }
            }
        }
    }
    assert!(sprays.iter().all(|&count| count > 200), "{sprays:?}");
}

#[test]
fn no_spray_is_larger_than_the_largest_volume_in_any_digit() {
    // Ink that nothing but the largest volume everywhere comes near to; volumes that single precision rounds up and down.
    let wanted = Image::filled(24, 24, 0.95);
    let colour = ColourImage::new(24, 24, vec![[0.02; 3]; 24 * 24]).unwrap();
    let palette = Palette::new([1.0; 3], vec![Paint::glaze("black", [0.1; 3])]).unwrap();
    let mut at_the_top = 0;
    for k in 0..40 {
        let limits = Limits { max_volume: 0.02 + 0.1 * lattice(5, k, 0), ..Limits::default() };
        let problem = PaintProblem::new(&wanted).with_limits(&limits);
        let check = |name: &str, sprays: &[Spray]| {
            for s in sprays {
                let excess = s.volume - limits.max_volume;
                assert!(s.volume <= limits.max_volume, "{name}: {excess:e} more than {}", limits.max_volume);
            }
            sprays.iter().filter(|s| s.volume == limits.max_volume).count()
        };
        for painter in painters() {
            at_the_top += check(painter.name(), &painter.paint(&problem).unwrap().sprays);
        }
        let separation = ColourSeparation { iterations: 20, ..ColourSeparation::default() };
        let painting = separation.paint(&ColourProblem::new(&colour, &palette).with_limits(&limits)).unwrap();
        at_the_top += check("colour separation", &painting.sprays[0]);
    }
    assert!(at_the_top > 10_000, "{at_the_top}");
}

#[test]
fn metrics_clip_the_ink_first() {
    let reference = Image::from_fn(12, 12, |x, y| if (x + y) % 2 == 0 { 1.0 } else { 0.0 });
    let beyond = reference.map(|v| 3.0 * v - 1.0);
    assert_eq!(beyond.at(0, 0), 2.0);
    assert_eq!(psnr(&beyond, &reference), psnr(&reference, &reference));
    for ssim in [metrics::ssim, metrics::ssim_gaussian] {
        assert!((ssim(&beyond, &reference, None).unwrap() - 1.0).abs() < 1e-12);
    }
    let bce = |ink: &Image| metrics::binary_cross_entropy(ink, &reference).unwrap();
    assert_eq!(bce(&beyond), bce(&reference));
}

#[test]
fn a_palette_has_no_more_paints_than_promised() {
    let paints = |count: usize| (0..count).map(|_| Paint::glaze("red", [0.8, 0.1, 0.2])).collect::<Vec<_>>();
    assert!(Palette::new([1.0; 3], paints(MAX_PAINTS)).is_ok());
    assert!(Palette::new([1.0; 3], paints(MAX_PAINTS + 1)).is_err() && Palette::new([1.0; 3], paints(0)).is_err());
}

#[test]
fn a_footprint_is_the_gaussian_of_its_sigma() {
    let kernel = SprayKernel::new(2.5, 4.0).unwrap();
    let mut canvas = Image::filled(41, 41, 0.0);
    kernel.stamp(&Spray { x: 20.0, y: 20.0, volume: 0.7, sigma: 2.5 }, &mut canvas);
    // Mass and second moment of a Gaussian, all but its cut tails.
    let mass: f64 = canvas.data().iter().sum();
    let second: f64 = canvas.data().iter().enumerate().map(|(k, c)| c * ((k % 41) as f64 - 20.0).powi(2)).sum();
    assert!((mass / (0.7 * std::f64::consts::TAU * 2.5 * 2.5) - 1.0).abs() < 1e-3);
    assert!((second / mass - 2.5 * 2.5).abs() < 0.02);
    assert!((kernel.mass() / (mass / 0.7) - 1.0).abs() < 1e-12);
    assert_eq!(canvas.at(20, 20), 0.7);
}

#[test]
fn paint_that_is_there_is_not_sprayed_again() {
    let wanted = Texture::Fbm.image(8, 48);
    for painter in painters() {
        let all = painter.paint(&PaintProblem::new(&wanted)).unwrap();
        // All of it is there already: hardly anything is left to do.
        let rest = painter.paint(&PaintProblem::new(&wanted).with_canvas(&all.canvas)).unwrap();
        let volume = |sprays: &[Spray]| sprays.iter().map(|s| s.volume * s.sigma.powi(2)).sum::<f64>();
        let (rest, all) = (volume(&rest.sprays), volume(&all.sprays));
        assert!(rest < 0.1 * all, "{}: {rest} after {all}", painter.name());
    }
}

#[test]
fn what_weighs_more_is_painted_better() {
    // The left half asks for light where the right asks for dark, cell by cell: the border is where weights decide.
    let wanted = Image::from_fn(48, 48, |x, y| if (x / 3 + y / 3) % 2 == 0 { 0.9 } else { 0.05 });
    let heavy = |dark: bool| Image::from_fn(48, 48, |x, y| if (wanted.at(x, y) > 0.5) == dark { 1.0 } else { 0.02 });
    for painter in painters().into_iter().take(4) {
        let error_on_dark = |weight: &Image| {
            let ink = painter.paint(&PaintProblem::new(&wanted).with_weight(weight)).unwrap().ink;
            let dark = wanted.map(|v| if v > 0.5 { 1.0 } else { 0.0 });
            metrics::psnr(&ink, &wanted, Some(&dark)).unwrap()
        };
        let (favoured, neglected) = (error_on_dark(&heavy(true)), error_on_dark(&heavy(false)));
        assert!(favoured > neglected + 3.0, "{}: {favoured} dB and {neglected} dB", painter.name());
    }
}

#[test]
fn layers_go_from_light_to_dark() {
    let wanted = Texture::Fbm.image(11, 48);
    let painter = Layered::new(Deconvolution::default());
    let problem = PaintProblem::new(&wanted);
    let thresholds = painter.thresholds(&problem).unwrap();
    assert!(thresholds.windows(2).all(|t| t[0] < t[1]));
    let layers = painter.paint(&problem).unwrap().into_layers();
    // The base goes nearly everywhere, the last layer only where it is dark.
    let mean_ink = |sprays: &[Spray]| {
        let inks = sprays.iter().map(|s| wanted.at(s.x as usize, s.y as usize));
        inks.sum::<f64>() / sprays.len() as f64
    };
    let means: Vec<f64> = layers.iter().map(|l| mean_ink(&l.sprays)).collect();
    assert!(means.windows(2).all(|m| m[1] > m[0] + 0.03), "{means:?}");
    assert!(layers[0].sprays.len() > 2 * layers[layers.len() - 1].sprays.len());
}

/// A nozzle that gives a share of what it is asked for.
struct WeakNozzle(Image, f64);

impl Observer for WeakNozzle {
    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, paint_net::Error> {
        for s in sprays {
            SprayKernel::default().stamp(&Spray { volume: self.1 * s.volume, ..*s }, &mut self.0);
        }
        Ok(Some(self.0.map(|c| Saturation::Tanh.forward(c))))
    }
}

#[test]
fn the_later_coats_make_good_for_a_weak_nozzle() {
    let wanted = Texture::Worley.image(4, 48);
    let problem = PaintProblem::new(&wanted);
    let painter = ClosedLoopPainter::new(Deconvolution::default());
    let painting = painter.paint_observed(&problem, &mut WeakNozzle(problem.initial_canvas(), 0.5)).unwrap();
    assert!((painting.flow_gain - 0.5).abs() < 0.01, "{}", painting.flow_gain);
    let open = painter.paint(&problem).unwrap();
    assert!(psnr(&painting.ink, &wanted) > psnr(&open.ink, &wanted) - 1.0);
    assert_eq!(open.flow_gain, 1.0);
    // A twentieth is a nozzle that is clogged, not one that gives little: no more than five times as much is asked of it.
    let clogged = painter.paint_observed(&problem, &mut WeakNozzle(problem.initial_canvas(), 0.05)).unwrap();
    assert_eq!(clogged.flow_gain, 0.2);
}

#[test]
fn a_slew_limit_holds_in_both_directions() {
    // A step up and a step down along a row.
    let wanted = Image::from_fn(48, 8, |x, _| if (16..32).contains(&x) { 0.8 } else { 0.0 });
    let painting = SlewLimited::new(Deconvolution::default(), 0.02).paint(&PaintProblem::new(&wanted)).unwrap();
    let steps: Vec<f64> = painting.waypoints.windows(2).map(|p| p[1].volume - p[0].volume).collect();
    assert!(steps.iter().all(|s| s.abs() <= 0.02), "{:?}", steps.iter().fold(0.0_f64, |m, s| m.max(s.abs())));
    assert!(steps.iter().any(|s| *s > 0.019) && steps.iter().any(|s| *s < -0.019));
}

/// A dark bar beside a pale one: without a ceiling the fit goes beyond what is wanted on both, to make the edge sharper.
#[test]
fn ink_keeps_below_its_ceiling() {
    let wanted = Image::from_fn(48, 32, |x, _| if (16..28).contains(&x) { 0.6 } else { 0.05 });
    let ceiling = Image::from_fn(48, 32, |x, _| if (12..32).contains(&x) { 0.62 } else { 0.07 });
    let kernel = SprayKernel::new(2.0, 3.5).unwrap();
    let problem = PaintProblem::new(&wanted).with_kernel(&kernel);
    let above = |problem: &PaintProblem| {
        let ink = Deconvolution::default().paint(problem).unwrap().ink;
        ink.data().iter().zip(ceiling.data()).map(|(ink, ceiling)| ink - ceiling).fold(f64::MIN, f64::max)
    };
    let (free, kept) = (above(&problem), above(&problem.with_ceiling(&ceiling)));
    assert!(free > 0.03 && kept < 0.01, "{free} above without a ceiling, {kept} with one");
}

/// Missing ink of a dot that counts more is missing less, and surplus is not punished for it.
#[test]
fn missing_ink_can_count_more_than_surplus() {
    let wanted = Image::from_fn(32, 32, |x, y| if (x as f64 - 15.5).hypot(y as f64 - 15.5) < 2.5 { 0.8 } else { 0.0 });
    let weight = wanted.map(|ink| if ink > 0.0 { 20.0 } else { 1.0 });
    let least = |problem: &PaintProblem| {
        let ink = Deconvolution::default().paint(problem).unwrap().ink;
        let on_dot = ink.data().iter().zip(wanted.data()).filter(|(_, wanted)| **wanted > 0.0);
        on_dot.map(|(ink, _)| *ink).fold(f64::MAX, f64::min)
    };
    let problem = PaintProblem::new(&wanted);
    let (plain, heeded) = (least(&problem), least(&problem.with_missing_weight(&weight)));
    assert!(heeded > plain + 0.1, "{plain}, {heeded} with weights");
}

/// Knots between which a plain cubic would fall again.
#[test]
fn a_curve_through_any_knots_rises_and_ends_at_its_last() {
    let knots = [(0.0, 0.0), (1.0, 0.01), (1.1, 0.85), (2.0, 0.86), (4.0, 0.9)];
    let curve = Saturation::Curve(MonotoneCurve::new(&knots).unwrap());
    let ink: Vec<f64> = (0..=4000).map(|k| curve.forward(0.001 * f64::from(k))).collect();
    assert!(ink.windows(2).all(|pair| pair[1] >= pair[0] - 1e-15));
    assert!(knots.iter().all(|(depth, ink)| (curve.forward(*depth) - ink).abs() < 1e-12));
    assert_eq!((curve.forward(7.0), curve.derivative(7.0)), (0.9, 0.0));
}

/// One window of 7 x 7 pixels by the definition.
#[test]
fn similarity_about_a_pixel_is_that_of_its_window() {
    let image = |a: usize, b: usize| Image::from_fn(11, 9, |x, y| ((a * x + b * y) % 17) as f64 / 16.0);
    let (picture, wanted) = (image(5, 3), image(7, 11));
    for (cx, cy) in [(4, 4), (3, 3), (7, 5)] {
        let at: Vec<[f64; 2]> = (cy - 3..=cy + 3)
            .flat_map(|y| (cx - 3..=cx + 3).map(move |x| (x, y)))
            .map(|(x, y)| [picture.at(x, y), wanted.at(x, y)])
            .collect();
        let [p, w] = [0, 1].map(|k| at.iter().map(|pair| pair[k]).sum::<f64>() / 49.0);
        let about = |k: usize, l: usize| {
            let mean = [p, w];
            at.iter().map(|pair| (pair[k] - mean[k]) * (pair[l] - mean[l])).sum::<f64>() / 48.0
        };
        let (c1, c2) = (1e-4, 9e-4);
        let expected =
            (2.0 * p * w + c1) * (2.0 * about(0, 1) + c2) / ((p * p + w * w + c1) * (about(0, 0) + about(1, 1) + c2));
        let centres: Vec<bool> = (0..99).map(|k| k == cy * 11 + cx).collect();
        let found = metrics::ssim_at(&picture, &wanted, None, &centres).unwrap();
        assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
    }
}
