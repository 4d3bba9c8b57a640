//! Ripples of wet paint against Orchard's rate, the yield stress that keeps them, and the account.

use nalgebra::{Point3, Vector3};
use paint_sim::film::wet::{Ground, Levelling, Side, WetFilm, WetPaint};
use paint_sim::{Error, Film, Texel};

use crate::wet::{wall, wet};

fn thin() -> WetPaint {
    WetPaint { viscosity: 0.1, yield_stress: 0.0, evaporation: 0.0, ..WetPaint::default() }
}

/// A level panel of millimetre texels with ripples of `count` texels along its columns.
fn rippled(
    paint: WetPaint,
    columns: usize,
    rows: usize,
    count: f64,
    mean: f64,
    amplitude: f64,
) -> (WetFilm, Levelling) {
    let (texels, sides) = wall(columns, rows, 1e-3, std::f64::consts::FRAC_PI_2);
    let film = Film::new(texels).unwrap();
    let levelling = Levelling::new(&film, &sides).unwrap();
    let mut film = WetFilm::new(film, &sides, paint, Ground::default()).unwrap();
    for k in 0..columns * rows {
        let phase = std::f64::consts::TAU * ((k % columns) as f64 + 0.5) / count;
        wet(&mut film, &paint, k, mean + amplitude * phase.cos());
    }
    (film, levelling)
}

/// Part of the film that goes as the ripples do, m.
fn amplitude(film: &WetFilm, columns: usize, count: f64) -> f64 {
    let texels = film.film().texels().len();
    let part = |k: usize| {
        let phase = std::f64::consts::TAU * ((k % columns) as f64 + 0.5) / count;
        2.0 * phase.cos() * film.wet_thickness(k) / texels as f64
    };
    (0..texels).map(part).sum()
}

#[test]
fn ripples_decay_at_orchards_rate() {
    let paint = thin();
    for (columns, rows, count) in [(48, 1, 12.0), (64, 1, 32.0), (32, 3, 16.0)] {
        let (mean, wavelength) = (120e-6_f64, 1e-3_f64 * count);
        let tau = 3.0 * 0.1 * wavelength.powi(4) / (16.0 * std::f64::consts::PI.powi(4) * 0.03 * mean.powi(3));
        assert!((paint.levelling_time(mean, wavelength) / tau - 1.0).abs() < 1e-12);
        let (mut film, levelling) = rippled(paint, columns, rows, count, mean, 6e-6);
        let before = amplitude(&film, columns, count);
        let balance = (film.film().mass_balance(), film.liquid_balance());
        let flow = levelling.step(&mut film, 0.7 * tau).unwrap();
        assert_eq!(flow.held_back, 0);
        let decay = (before / amplitude(&film, columns, count)).ln();
        assert!((decay / 0.7 - 1.0).abs() < 0.05, "{count}: {decay}");
        assert_eq!((film.film().mass_balance(), film.liquid_balance()), balance);
        assert!(film.film().mass_balance().deposited == film.film().volumes().iter().sum::<u64>());
        assert!(film.liquid_balance().balanced());
    }
}

/// Paint that has lost some of its solvent is thinner and stiffer.
#[test]
fn paint_levels_slower_as_it_dries() {
    let paint = WetPaint { evaporation: 1e-7, ..thin() };
    let count = 16.0;
    let (mut film, levelling) = rippled(paint, 32, 1, count, 120e-6, 6e-6);
    // On the level it dries and does not run.
    film.step(200.0).unwrap();
    let mean = (0..32).map(|k| film.wet_thickness(k)).sum::<f64>() / 32.0;
    assert!((mean / 100e-6 - 1.0).abs() < 0.02, "{mean}");
    let stiffening = ((0.64 - 0.35) / (0.64 - 0.35 * 120e-6 / mean)).powi(2);
    let tau = paint.levelling_time(mean, 1e-3 * count) * stiffening;
    let before = amplitude(&film, 32, count);
    levelling.step(&mut film, 0.5 * tau).unwrap();
    let decay = (before / amplitude(&film, 32, count)).ln();
    assert!((decay / 0.5 - 1.0).abs() < 0.05, "{decay}");
}

/// What is level in the end is the surface, not the film: over a dry ripple it is thinner on the crests.
#[test]
fn paint_levels_over_what_is_dry() {
    let (count, columns, paint) = (16.0, 32, thin());
    let (ripples, levelling) =
        rippled(WetPaint { solids: 1.0, touch_dry: 1.0, packing: 1.0, ..paint }, columns, 1, count, 6e-5, 2e-5);
    let dry = ripples.into_film();
    let below: Vec<f64> = (0..columns).map(|k| dry.thickness(k)).collect();
    let (_, sides) = wall(columns, 1, 1e-3, std::f64::consts::FRAC_PI_2);
    let mut film = WetFilm::new(dry, &sides, paint, Ground::default()).unwrap();
    (0..columns).for_each(|k| wet(&mut film, &paint, k, 120e-6));
    let surface = |film: &WetFilm| (0..columns).map(|k| below[k] + film.wet_thickness(k)).collect::<Vec<_>>();
    let range = |heights: &[f64]| heights.iter().fold(0.0_f64, |m, h| m.max((h - heights[0]).abs()));
    assert!(range(&surface(&film)) > 3.8e-5);
    levelling.step(&mut film, 8.0 * paint.levelling_time(120e-6, 1e-3 * count)).unwrap();
    assert!(range(&surface(&film)) < 1e-6, "{:?}", surface(&film));
}

#[test]
fn ripples_stay_that_do_not_reach_the_yield_stress() {
    let (count, mean) = (24.0, 120e-6_f64);
    let paint = WetPaint { yield_stress: 1e-3, ..thin() };
    let lasting = 1e-3 / (0.03 * mean * (std::f64::consts::TAU / (1e-3 * count)).powi(3));
    assert!((paint.lasting_ripple(mean, 1e-3 * count) / lasting - 1.0).abs() < 1e-12 && lasting < 0.2 * mean);
    for (share, moves) in [(0.85, false), (1.15, true)] {
        let (mut film, levelling) = rippled(paint, 48, 1, count, mean, share * lasting);
        let before = film.film().volumes().to_vec();
        levelling.step(&mut film, 10.0).unwrap();
        assert_eq!(film.film().volumes() != before, moves, "{share}");
    }
}

#[test]
fn without_surface_tension_nothing_moves() {
    let (mut film, levelling) = rippled(WetPaint { surface_tension: 0.0, ..thin() }, 16, 1, 8.0, 1e-4, 5e-5);
    let before = film.film().volumes().to_vec();
    assert_eq!(levelling.step(&mut film, 1e4).unwrap().steps, 0);
    assert_eq!(film.film().volumes(), before);
}

/// A bump on dry ground with texels numbered one way and another: to the last femtolitre the same, and no paint on what was dry.
#[test]
fn the_numbering_changes_nothing_and_the_film_keeps_its_edge() {
    let (columns, rows, paint) = (12, 9, thin());
    let (texels, sides) = wall(columns, rows, 1e-3, 0.0);
    let count = texels.len();
    let other = |k: usize| (k * 31 + 7) % count;
    let levelled = |number: &dyn Fn(usize) -> usize| {
        let mut own: Vec<Texel> = texels.clone();
        (0..count).for_each(|k| own[number(k)] = texels[k]);
        let side = |s: &Side| Side {
            texel: number(s.texel as usize) as u32,
            beyond: s.beyond.map(|k| number(k as usize) as u32),
        };
        let mut sides: Vec<Side> = sides.iter().map(side).collect();
        sides.sort_unstable_by_key(|s| (s.texel, s.beyond));
        let film = Film::new(own).unwrap();
        let levelling = Levelling::new(&film, &sides).unwrap();
        let mut film = WetFilm::new(film, &sides, paint, Ground::default()).unwrap();
        for row in 2..6 {
            for column in 2..9 {
                let bump = 1e-4 + 3e-5 * ((row * 7 + column * 5) % 11) as f64 / 11.0;
                wet(&mut film, &paint, number(row * columns + column), bump);
            }
        }
        let painted = film.film().volumes().iter().filter(|volume| **volume > 0).count();
        let before = film.film().volumes().to_vec();
        assert!(levelling.step(&mut film, 5.0).unwrap().steps > 1 && film.film().volumes() != before);
        assert_eq!(film.film().volumes().iter().filter(|volume| **volume > 0).count(), painted);
        (0..count).map(|k| (film.film().volumes()[number(k)], film.wet_thickness(number(k)))).collect::<Vec<_>>()
    };
    assert_eq!(levelled(&|k| k), levelled(&other));
}

#[test]
fn a_film_of_other_texels_is_refused() {
    let (mut film, _) = rippled(thin(), 4, 1, 4.0, 1e-4, 0.0);
    let texel =
        |k: i32| Texel { point: Point3::new(0.0, f64::from(k) * 1e-3, 0.0), normal: -Vector3::x_axis(), area: 1e-6 };
    let other = Film::new((0..3).map(texel).collect()).unwrap();
    let levelling = Levelling::new(&other, &[]).unwrap();
    assert!(matches!(
        levelling.step(&mut film, 1.0),
        Err(Error::WrongLength { what: "texels", expected: 3, found: 4 })
    ));
    assert!(Levelling::new(&other, &[Side { texel: 0, beyond: Some(3) }]).is_err());
    assert!(levelling.step(&mut film, f64::NAN).is_err());
}
