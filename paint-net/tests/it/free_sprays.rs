//! Sprays at free places.

use paint_net::painters::FreeSprays;
use paint_net::procedural::{Texture, lattice};
use paint_net::{Deconvolution, Error, Image, Limits, PaintProblem, Painter, Painting, SprayKernel, metrics};

fn nozzle() -> SprayKernel {
    SprayKernel::new(2.0, 5.0).unwrap()
}

fn paint(painter: &FreeSprays, problem: &PaintProblem, limits: &Limits) -> Painting {
    painter.paint(&problem.with_kernel(&nozzle()).with_limits(limits)).unwrap()
}

#[test]
fn a_picture_made_of_few_sprays_is_painted_with_as_many() {
    // Five footprints far from each other, nowhere on a grid.
    let made = [
        (9.3, 11.8, 0.5, 2.0),
        (40.6, 8.2, 0.9, 3.1),
        (22.4, 30.5, 0.3, 4.0),
        (47.1, 41.7, 0.7, 2.5),
        (8.8, 46.0, 0.6, 2.2),
    ];
    let wanted = Image::from_fn(56, 56, |x, y| {
        let depth = |&(cx, cy, v, s): &(f64, f64, f64, f64)| {
            v * (-((x as f64 - cx).powi(2) + (y as f64 - cy).powi(2)) / (2.0 * s * s)).exp()
        };
        made.iter().map(depth).sum::<f64>().tanh()
    });
    let painter = FreeSprays { sprays: 5, rounds: 6, iterations: 60, reseed_fraction: 0.4, ..FreeSprays::default() };
    let painting = paint(&painter, &PaintProblem::new(&wanted), &Limits::default());
    assert!(painting.sprays.len() <= 5);
    let quality = metrics::psnr(&painting.ink, &wanted, None).unwrap();
    assert!(quality > 45.0, "{quality} dB");
    for (x, y, volume, sigma) in made {
        let found = painting.sprays.iter().any(|s| {
            (s.x - x).hypot(s.y - y) < 0.1 && (s.volume - volume).abs() < 0.03 && (s.sigma - sigma).abs() < 0.1
        });
        assert!(found, "no spray at ({x}, {y}) among {:?}", painting.sprays);
    }
}

#[test]
fn free_places_are_worth_more_than_a_grid() {
    for texture in [Texture::Fbm, Texture::Worley, Texture::Glyph] {
        let wanted = texture.image(7, 64);
        let problem = PaintProblem::new(&wanted);
        let quality = |p: &Painting| metrics::psnr(&p.ink, &wanted, None).unwrap();
        // 16 x 16 cells, and as many sprays of the same nozzle that may lie and open as they like.
        let limits = Limits { spray_spacing: 4, row_spacing: 4, ..Limits::default() };
        let grid = Deconvolution::default().paint(&problem.with_kernel(&nozzle()).with_limits(&limits)).unwrap();
        let free = paint(&FreeSprays { sprays: 256, ..FreeSprays::default() }, &problem, &Limits::default());
        assert!(free.sprays.len() <= 256);
        let (grid, free) = (quality(&grid), quality(&free));
        assert!(free > grid + 1.0, "{texture:?}: {free} dB free, {grid} dB on the grid");
    }
}

#[test]
fn rounds_and_iterations_help() {
    let wanted = Texture::Worley.image(3, 64);
    let problem = PaintProblem::new(&wanted);
    let run = |rounds, reseed_fraction| {
        let painter = FreeSprays { sprays: 120, rounds, reseed_fraction, ..FreeSprays::default() };
        metrics::psnr(&paint(&painter, &problem, &Limits::default()).ink, &wanted, None).unwrap()
    };
    let (none, one, moving, staying) = (run(0, 0.1), run(1, 0.1), run(4, 0.1), run(4, 0.0));
    assert!(one > none + 1.0 && moving > one, "{none} {one} {moving}");
    assert!(moving > staying, "{moving} dB where sprays are reseeded, {staying} dB where none is");
}

#[test]
fn sprays_stay_over_paintable_pixels_and_within_their_bounds() {
    let wanted = Texture::Fbm.image(8, 48);
    // Islands and single pixels.
    let mask: Vec<bool> = (0..48 * 48).map(|k| lattice(5, (k % 48) / 5, (k / 48) / 7) < 0.6 || k % 97 == 0).collect();
    let problem = PaintProblem { paintable: Some(&mask), ..PaintProblem::new(&wanted) };
    let limits = Limits { max_volume: 0.4, min_volume: 0.03, ..Limits::default() };
    let painting = paint(&FreeSprays { sprays: 150, max_sigma_ratio: 1.5, ..FreeSprays::default() }, &problem, &limits);
    assert!(painting.sprays.len() > 60);
    for s in &painting.sprays {
        assert!(mask[s.y.round() as usize * 48 + s.x.round() as usize], "{s:?} is not over a paintable pixel");
        assert!((2.0..=3.0).contains(&s.sigma) && (0.03..=0.4).contains(&s.volume), "{s:?}");
    }
}

#[test]
fn odd_images_and_settings_do_not_break_it() {
    for (width, height) in [(1, 1), (1, 40), (33, 2), (7, 3)] {
        let wanted = Image::from_fn(width, height, |x, y| 0.9 * lattice(4, x as i64, y as i64));
        let problem = PaintProblem::new(&wanted);
        for sprays in [0, 1, 50] {
            let painting = paint(&FreeSprays { sprays, ..FreeSprays::default() }, &problem, &Limits::default());
            assert!(painting.sprays.len() <= sprays);
            assert!(painting.ink.data().iter().all(|a| a.is_finite()));
        }
        for sigma in [1e-3, 1e4] {
            let kernel = SprayKernel::new(sigma, 4.0).unwrap();
            let painter = FreeSprays { sprays: 20, ..FreeSprays::default() };
            let painting = painter.paint(&problem.with_kernel(&kernel)).unwrap();
            assert!(painting.ink.data().iter().all(|a| a.is_finite()), "sigma {sigma}");
        }
    }
    let wanted = Image::filled(8, 8, 0.5);
    let refused = |painter: FreeSprays| painter.paint(&PaintProblem::new(&wanted).with_kernel(&nozzle()));
    for spread in [0.0, 0.99, -1.0, f64::NAN, f64::INFINITY] {
        let bad = refused(FreeSprays { max_sigma_ratio: spread, ..FreeSprays::default() });
        assert!(matches!(bad, Err(Error::InvalidSetting { name: "max_sigma_ratio", .. })));
    }
    for reseed_fraction in [-0.1, 1.1, f64::NAN] {
        let bad = refused(FreeSprays { reseed_fraction, ..FreeSprays::default() });
        assert!(matches!(bad, Err(Error::InvalidSetting { name: "reseed_fraction", .. })));
    }
    let bad = refused(FreeSprays { sprays: usize::MAX, ..FreeSprays::default() });
    assert!(matches!(bad, Err(Error::InvalidSetting { name: "sprays", .. })));
}
