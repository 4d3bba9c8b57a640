//! Films over each other, paints from drawdowns, reflectances from colours.

use paint_sim::colour::{BANDS, linear_srgb_lab, spectrum_lab, spectrum_linear_srgb, spectrum_of_linear_srgb};
use paint_sim::paint::{Drawdown, FilmStack, PIGMENTS};
use paint_sim::{Error, Paint, Substrate, km};

const UNIT: f64 = 20e-6;

/// Numbers in `[0, 1)` that do not repeat soon.
fn number(k: usize) -> f64 {
    (0.5 + k as f64 * 0.618_033_988_749_895).fract()
}

fn pigments() -> Vec<Paint> {
    PIGMENTS.iter().map(|pigment| pigment.paint(UNIT).unwrap()).collect()
}

/// The same films one by one in double precision.
fn exact(paints: &[Paint], depths: &[f64], ground: &Substrate) -> [f64; 3] {
    let films = paints.iter().zip(depths);
    let wall = films.fold(*ground, |below, (paint, depth)| paint.over(depth * UNIT, &below).unwrap());
    spectrum_lab(wall.reflectance())
}

/// Blue below yellow and yellow below blue on a ground of 0.9, Kubelka-Munk in 40 digits by another program.
#[test]
fn the_order_of_two_films_is_that_of_the_printed_colours() {
    let (yellow, blue) = (Paint::yellow(UNIT).unwrap(), Paint::blue(UNIT).unwrap());
    let ground = [0.9; BANDS].map(|r: f64| r as f32);
    for (paints, depths, expected) in [
        ([blue, yellow], [0.3, 0.7], [75.410_98, -9.357_10, 57.033_37]),
        ([yellow, blue], [0.7, 0.3], [68.700_89, -15.058_26, 39.130_09]),
    ] {
        let found = FilmStack::new(&paints, UNIT, 4.0).unwrap().lab(&depths, &ground, &mut []);
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 2e-3), "{found:?}, expected {expected:?}");
    }
}

#[test]
fn colours_and_their_slopes_are_those_of_films_one_by_one() {
    let (paints, ground) = (pigments(), Substrate::sandstone());
    let (stack, bands) = (FilmStack::new(&paints, UNIT, 4.0).unwrap(), FilmStack::bands(ground.reflectance()));
    for case in 0..60 {
        let order: Vec<usize> = (0..6).map(|k| (case + 5 * k) % paints.len()).collect();
        let films: Vec<Paint> = order.iter().map(|&k| paints[k]).collect();
        let depths: Vec<f64> = (0..6).map(|k| 1e-3 + 3.9 * number(31 * case + k).powi(3)).collect();
        let mut slopes = [[0.0; 3]; 6];
        let found = stack.select(&order).lab(&depths, &bands, &mut slopes);
        let expected = exact(&films, &depths, &ground);
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 0.01), "{case}: {found:?} {expected:?}");
        for k in 0..6 {
            let shifted = |h: f64| {
                let mut depths = depths.clone();
                depths[k] += h;
                exact(&films, &depths, &ground)
            };
            let (up, down) = (shifted(1e-5), shifted(-1e-5));
            for c in 0..3 {
                let expected = (up[c] - down[c]) / 2e-5;
                assert!(
                    (slopes[k][c] - expected).abs() < 0.02 + 2e-3 * expected.abs(),
                    "{case}, film {k}, {c}: {} {expected}",
                    slopes[k][c]
                );
            }
        }
    }
}

#[test]
fn stacks_are_put_together_from_others() {
    let paints = pigments();
    let all = FilmStack::new(&paints[..3], UNIT, 4.0).unwrap();
    let each: Vec<FilmStack> = paints[..3].iter().map(|paint| FilmStack::new(&[*paint], UNIT, 4.0).unwrap()).collect();
    let (ground, depths) = ([0.4; BANDS], [0.3, 0.2, 0.5]);
    let joined = FilmStack::stacked(&each);
    assert_eq!(joined.films(), 3);
    assert_eq!(joined.lab(&depths, &ground, &mut []), all.lab(&depths, &ground, &mut []));
    let thirteen = vec![paints[0]; 13];
    assert!(matches!(FilmStack::new(&thirteen, UNIT, 4.0), Err(Error::OutOfRange { .. })));
}

#[test]
fn a_drawdown_tells_what_a_paint_absorbs_and_scatters() {
    let card = |over_black: f64, over_white: f64, [black, white]: [f64; 2]| Drawdown {
        black: [black; BANDS],
        white: [white; BANDS],
        over_black: [over_black; BANDS],
        over_white: [over_white; BANDS],
        thickness: 0.2,
    };
    // K = 0, S = 5: the film reflects 1/2 over black and 2/3 over a grey of 1/2.
    let clear = Paint::from_drawdown(&card(0.5, 2.0 / 3.0, [0.0, 0.5])).unwrap();
    assert!((clear.scattering()[7] - 5.0).abs() < 1e-9 && clear.absorption()[7].abs() < 1e-9, "{clear:?}");
    // S = 0, K = 1.5: exp(-0.6) of the light comes back.
    let glaze = Paint::from_drawdown(&card(0.05 * (-0.6_f64).exp(), 0.9 * (-0.6_f64).exp(), [0.05, 0.9])).unwrap();
    assert!((glaze.absorption()[0] - 1.5).abs() < 1e-6 && glaze.scattering()[0] < 1e-6, "{glaze:?}");
    for k in 0..200 {
        let (absorption, scattering) = (8.0 * number(3 * k).powi(2), 0.05 + 12.0 * number(3 * k + 1));
        let over = |ground: f64| km::reflectance(absorption, scattering, 0.2, ground);
        let paint = Paint::from_drawdown(&card(over(0.04), over(0.86), [0.04, 0.86])).unwrap();
        let found = [paint.absorption()[3], paint.scattering()[3]];
        let near = |f: f64, e: f64| (f - e).abs() < 1e-6 * (1.0 + e);
        assert!(near(found[0], absorption) && near(found[1], scattering), "{found:?}, {absorption} {scattering}");
    }
    for (over_black, over_white, grounds) in
        [(0.6, 0.6, [0.0, 1.0]), (0.7, 0.5, [0.0, 1.0]), (0.1, 1.2, [0.0, 1.0]), (0.1, 0.2, [0.5, 0.5])]
    {
        assert!(Paint::from_drawdown(&card(over_black, over_white, grounds)).is_err(), "{over_black} {over_white}");
    }
}

#[test]
fn a_reflectance_has_the_colour_that_it_is_made_from() {
    for k in 0..200 {
        let colour = [0, 1, 2].map(|c| 0.03 + 0.9 * number(3 * k + c));
        let spectrum = spectrum_of_linear_srgb(colour);
        assert!(spectrum.iter().all(|r| (0.0..=1.0).contains(r)), "{colour:?}");
        let found = spectrum_linear_srgb(&spectrum);
        let far = found.iter().zip(colour).map(|(f, e)| (f - e).abs()).fold(0.0, f64::max);
        assert!(far < 1e-5, "{colour:?} became {found:?}");
    }
    // Grey is flat.
    let grey = spectrum_of_linear_srgb([0.5; 3]);
    assert!(grey.iter().all(|r| (r - 0.5).abs() < 0.01), "{grey:?}");
    assert!(spectrum_of_linear_srgb([0.0, 1.0, f64::NAN]).iter().all(|r| r.is_finite()));
}

/// CIELAB of the primaries of sRGB under D65, as printed by Lindbloom's calculator.
#[test]
fn the_primaries_of_srgb_are_where_they_are_printed() {
    for (colour, expected) in [
        ([1.0, 0.0, 0.0], [53.24, 80.09, 67.20]),
        ([0.0, 1.0, 0.0], [87.73, -86.18, 83.18]),
        ([0.0, 0.0, 1.0], [32.30, 79.19, -107.86]),
    ] {
        let found = linear_srgb_lab(colour);
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 0.02), "{found:?} {expected:?}");
    }
}
