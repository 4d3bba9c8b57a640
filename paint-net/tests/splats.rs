//! Sprays at free places.
#![allow(clippy::unwrap_used)]

use paint_net::procedural::{Texture, lattice};
use paint_net::{
    Deconvolution, Error, FreeSplats, Image, Limits, Painter, Painting, Saturation, SprayKernel, Task, metrics,
};

fn nozzle() -> SprayKernel {
    SprayKernel::new(2.0, 5.0).unwrap()
}

fn paint(painter: &FreeSplats, task: &Task, limits: &Limits) -> Painting {
    painter.paint(task, &nozzle(), &Saturation::Tanh, limits, &mut |_| ()).unwrap()
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
    let painter = FreeSplats { sprays: 5, rounds: 6, iterations: 60, moved: 0.4, ..FreeSplats::default() };
    let painting = paint(&painter, &Task::on_bare_wall(&wanted), &Limits::default());
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
        let task = Task::on_bare_wall(&wanted);
        let quality = |p: &Painting| metrics::psnr(&p.ink, &wanted, None).unwrap();
        // 16 x 16 cells, and as many sprays of the same nozzle that may lie and open as they like.
        let limits = Limits { along: 4, row_spacing: 4, ..Limits::default() };
        let grid = Deconvolution::default().paint(&task, &nozzle(), &Saturation::Tanh, &limits, &mut |_| ()).unwrap();
        let free = paint(&FreeSplats { sprays: 256, ..FreeSplats::default() }, &task, &Limits::default());
        assert!(free.sprays.len() <= 256);
        let (grid, free) = (quality(&grid), quality(&free));
        assert!(free > grid + 1.0, "{texture:?}: {free} dB free, {grid} dB on the grid");
    }
}

#[test]
fn rounds_and_iterations_help() {
    let wanted = Texture::Worley.image(3, 64);
    let task = Task::on_bare_wall(&wanted);
    let run = |rounds, moved| {
        let painter = FreeSplats { sprays: 120, rounds, moved, ..FreeSplats::default() };
        metrics::psnr(&paint(&painter, &task, &Limits::default()).ink, &wanted, None).unwrap()
    };
    let (none, one, moving, staying) = (run(0, 0.1), run(1, 0.1), run(4, 0.1), run(4, 0.0));
    assert!(one > none + 1.0 && moving > one, "{none} {one} {moving}");
    assert!(moving > staying, "{moving} dB where splats are put elsewhere, {staying} dB where none is");
}

#[test]
fn sprays_stay_over_paintable_pixels_and_within_their_bounds() {
    let wanted = Texture::Fbm.image(8, 48);
    // Islands and single pixels.
    let mask: Vec<bool> = (0..48 * 48).map(|k| lattice(5, (k % 48) / 5, (k / 48) / 7) < 0.6 || k % 97 == 0).collect();
    let task = Task { paintable: Some(&mask), ..Task::on_bare_wall(&wanted) };
    let limits = Limits { max_volume: 0.4, min_volume: 0.03, ..Limits::default() };
    let painting = paint(&FreeSplats { sprays: 150, largest_spread: 1.5, ..FreeSplats::default() }, &task, &limits);
    assert!(painting.sprays.len() > 60);
    for s in &painting.sprays {
        assert!(mask[s.y.round() as usize * 48 + s.x.round() as usize], "{s:?} is not over a paintable pixel");
        assert!((2.0..=3.0).contains(&s.sigma) && (0.03..=0.4).contains(&s.volume), "{s:?}");
    }
}

#[test]
fn odd_boards_and_settings_do_not_break_it() {
    for (width, height) in [(1, 1), (1, 40), (33, 2), (7, 3)] {
        let wanted = Image::from_fn(width, height, |x, y| 0.9 * lattice(4, x as i64, y as i64));
        let task = Task::on_bare_wall(&wanted);
        for sprays in [0, 1, 50] {
            let painting = paint(&FreeSplats { sprays, ..FreeSplats::default() }, &task, &Limits::default());
            assert!(painting.sprays.len() <= sprays);
            assert!(painting.ink.data().iter().all(|a| a.is_finite()));
        }
        for sigma in [1e-3, 1e4] {
            let kernel = SprayKernel::new(sigma, 4.0).unwrap();
            let painter = FreeSplats { sprays: 20, ..FreeSplats::default() };
            let painting = painter.paint(&task, &kernel, &Saturation::Tanh, &Limits::default(), &mut |_| ()).unwrap();
            assert!(painting.ink.data().iter().all(|a| a.is_finite()), "sigma {sigma}");
        }
    }
    let wanted = Image::filled(8, 8, 0.5);
    let refused = |painter: FreeSplats| {
        painter.paint(&Task::on_bare_wall(&wanted), &nozzle(), &Saturation::Tanh, &Limits::default(), &mut |_| ())
    };
    for spread in [0.0, 0.99, -1.0, f64::NAN, f64::INFINITY] {
        let bad = refused(FreeSplats { largest_spread: spread, ..FreeSplats::default() });
        assert!(matches!(bad, Err(Error::InvalidSetting { name: "largest_spread", .. })));
    }
    for moved in [-0.1, 1.1, f64::NAN] {
        let bad = refused(FreeSplats { moved, ..FreeSplats::default() });
        assert!(matches!(bad, Err(Error::InvalidSetting { name: "moved", .. })));
    }
    let bad = refused(FreeSplats { sprays: usize::MAX, ..FreeSplats::default() });
    assert!(matches!(bad, Err(Error::InvalidSetting { name: "sprays", .. })));
}
