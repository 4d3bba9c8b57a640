//! Kubelka-Munk against values worked out with 40 digits, and against its own laws.

use paint_sim::km::{
    Layer, absorption_over_scattering, gradient, opaque_reflectance, reflectance, reflectance_f32, saunderson,
    saunderson_inverse,
};

/// (K, S, d, Rg, R), R from the textbook formula in 40-digit arithmetic.
const EXACT: [(f64, f64, f64, f64, f64); 11] = [
    (0.1, 5.0, 0.3, 0.04, 0.59197395625936641),
    (0.5, 2.0, 0.1, 0.8, 0.73439568430927627),
    (2.0, 0.05, 1.0, 0.9, 0.0270867470226284),
    (0.0, 5.0, 0.2, 0.0, 0.5),
    (0.0, 5.0, 0.2, 0.5, 2.0 / 3.0),
    (1e-9, 5.0, 0.2, 0.5, 0.6666666664962963),
    (1.0, 0.0, 0.7, 0.8, 0.19727757115328518),
    (3.0, 4.0, 1e-7, 0.25, 0.250000074999955),
    (0.02, 10.0, 1e4, 0.04, 0.9387228319217745),
    (1e-4, 1e3, 1.0, 0.0, 0.99893524054080154),
    (50.0, 1e-6, 0.5, 1.0, 9.9999998000001979e-9),
];

fn assert_close(value: f64, expected: f64, relative: f64) {
    assert!((value - expected).abs() <= relative * expected.abs(), "{value:e} instead of {expected:e}");
}

/// A deterministic sweep: uniform in 0..1.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn reflectance_has_the_exact_values() {
    for (k, s, d, rg, r) in EXACT {
        assert_close(reflectance(k, s, d, rg), r, 2e-15);
        let single = f64::from(reflectance_f32(k as f32, s as f32, d as f32, rg as f32));
        assert!((single - r).abs() < 3e-7, "{single} instead of {r}");
    }
}

#[test]
fn a_chart_of_layers_darkens_as_computed() {
    // K = 0.5, S = 2, 0.1 per layer over 0.8: the chart of 1, 2, 4, 8, 16 layers.
    for (layers, r) in
        [(1.0, 0.7343956843), (2.0, 0.6809741796), (4.0, 0.6050385766), (8.0, 0.5332648038), (16.0, 0.5030798186)]
    {
        assert_close(reflectance(0.5, 2.0, 0.1 * layers, 0.8), r, 1e-10);
    }
    assert_close(reflectance(0.5, 2.0, 1e3, 0.8), 0.5, 1e-15);
}

#[test]
fn sweep_is_finite_bounded_and_the_same_in_both_precisions() {
    let mut state = 1;
    for case in 0..300_000 {
        let mut log_uniform = || 10.0_f64.powf(-8.0 + 11.0 * uniform(&mut state));
        let (k, s, d) = (log_uniform() as f32, log_uniform() as f32, log_uniform() as f32);
        let rg = match case % 4 {
            0 => 0.0,
            1 => 1.0,
            _ => uniform(&mut state) as f32,
        };
        let double = reflectance(f64::from(k), f64::from(s), f64::from(d), f64::from(rg));
        let single = reflectance_f32(k, s, d, rg);
        assert!((0.0..=1.0).contains(&double) && (0.0..=1.0).contains(&single), "{k} {s} {d} {rg}");
        assert!((f64::from(single) - double).abs() <= 3e-7, "{k} {s} {d} {rg}: {single} {double}");
    }
}

#[test]
fn both_forms_agree_where_they_meet() {
    // Either side of K = S/4 a different form is used; the true jump is of the order of the step in K.
    for (s, d, rg) in [(1.0, 0.3, 0.2), (7.0, 2.0, 0.9), (0.01, 50.0, 0.0)] {
        let (low, high) = (0.25 * s * (1.0 - 1e-15), 0.25 * s);
        assert_close(reflectance(low, s, d, rg), reflectance(high, s, d, rg), 1e-14);
    }
}

#[test]
fn nonsense_is_moved_into_the_domain() {
    for bad in [f64::NAN, f64::NEG_INFINITY, f64::INFINITY, -1.0] {
        for i in 0..4 {
            let mut x = [1.0, 1.0, 1.0, 0.5];
            x[i] = bad;
            assert!((0.0..=1.0).contains(&reflectance(x[0], x[1], x[2], x[3])), "{x:?}");
        }
        assert!((0.0..=1.0).contains(&opaque_reflectance(bad)));
    }
    assert!(Layer::new(-1.0, 1.0, 1.0).is_err() && Layer::new(1.0, f64::NAN, 1.0).is_err());
}

#[test]
fn opaque_films_have_the_exact_values() {
    for (q, r) in [
        (0.01, 0.86822553121242175),
        (0.1, 0.641742430504416),
        (1.0, 0.26794919243112271),
        (10.0, 0.045548849896677731),
    ] {
        assert_close(opaque_reflectance(q), r, 2e-15);
        assert_close(absorption_over_scattering(r), q, 1e-13);
    }
}

#[test]
fn gradients_have_the_exact_values_and_match_differences() {
    let g = gradient(0.7, 2.3, 0.4, 0.35);
    assert_close(g.absorption, -0.166743852, 5e-9);
    assert_close(g.scattering, 0.0668756854, 5e-9);
    assert_close(g.thickness, 0.0927334497, 5e-9);
    assert_close(g.ground, 0.192492890, 5e-9);

    let mut state = 5;
    for _ in 0..2000 {
        let mut log_uniform = |low: f64, high: f64| low * (high / low).powf(uniform(&mut state));
        let x = [log_uniform(1e-6, 10.0), log_uniform(1e-3, 10.0), log_uniform(1e-3, 3.0), log_uniform(0.01, 0.99)];
        let g = gradient(x[0], x[1], x[2], x[3]);
        for (i, analytic) in [g.absorption, g.scattering, g.thickness, g.ground].into_iter().enumerate() {
            let step = 1e-5 * x[i];
            let at = |sign: f64| {
                let mut y = x;
                y[i] += sign * step;
                reflectance(y[0], y[1], y[2], y[3])
            };
            let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
            // Rounding of R by a few 1e-16 over the step, and the step's own square.
            let tolerance = 1e-15 / step + 1e-7 * analytic.abs() + 1e-9;
            assert!((analytic - difference).abs() < tolerance, "{x:?} {i}: {analytic} {difference}");
        }
    }
}

#[test]
fn layers_compose() {
    let one = Layer::new(0.5, 2.0, 0.1).unwrap();
    assert_close(one.reflectance, 0.159047145490912, 2e-15);
    assert_close(one.transmittance, 0.79226140304922549, 2e-15);
    let two = Layer::new(0.05, 8.0, 0.2).unwrap();
    assert_close(two.reflectance, 0.6105292239845737, 2e-15);
    assert_close(two.transmittance, 0.37954692736241613, 2e-15);
    let both = one.over(&two);
    assert_close(both.reflectance, 0.58347630242570361, 2e-15);
    assert_close(both.transmittance, 0.33303949175467755, 2e-15);
    assert_close(both.reflectance_below, 0.63590495693920513, 2e-15);
    assert_close(both.on_ground(0.04).unwrap(), 0.58802871050292477, 2e-15);
    // Nesting grounds is the same as composing layers.
    assert_close(reflectance(0.5, 2.0, 0.1, reflectance(0.05, 8.0, 0.2, 0.04)), 0.58802871050292477, 2e-15);
    // Semigroup: a thick film is two thin ones.
    let thick = Layer::new(0.7, 3.0, 0.5).unwrap();
    let stacked = Layer::new(0.7, 3.0, 0.2).unwrap().over(&Layer::new(0.7, 3.0, 0.3).unwrap());
    assert_close(stacked.reflectance, thick.reflectance, 1e-14);
    assert_close(stacked.transmittance, thick.transmittance, 1e-14);
}

#[test]
fn air_changes_what_is_measured() {
    assert_close(saunderson(0.5, 0.04, 0.6).unwrap(), 0.3142857142857143, 1e-15);
    assert_close(saunderson(0.5, 0.04, 0.4).unwrap(), 0.4, 1e-15);
    for i in 0..=10 {
        let inner = f64::from(i) / 10.0;
        let measured = saunderson(inner, 0.04, 0.59635).unwrap();
        assert!((saunderson_inverse(measured, 0.04, 0.59635).unwrap() - inner).abs() < 1e-14);
    }
    assert!(saunderson(1.5, 0.04, 0.6).is_err() && saunderson_inverse(0.01, 0.04, 0.6).is_err());
}

#[test]
fn three_band_paints_over_white_and_black() {
    // K and S of Curtis et al. 1997; the reflectances from the textbook formula in 40-digit arithmetic.
    let paints = [
        ([1.78, 0.21, 0.06], [0.009, 0.88, 0.50], [0.030446, 0.687556, 0.889003], [0.002445, 0.395641, 0.316233]),
        ([0.63, 0.47, 1.55], [0.035, 0.05, 0.01], [0.289281, 0.396564, 0.047358], [0.01936, 0.031099, 0.003064]),
        ([1.68, 1.08, 0.14], [0.018, 0.015, 0.77], [0.038807, 0.118698, 0.769963], [0.005123, 0.006083, 0.38748]),
    ];
    for (k, s, white, black) in paints {
        for i in 0..3 {
            assert!((reflectance(k[i], s[i], 1.0, 1.0) - white[i]).abs() < 6e-7);
            assert!((reflectance(k[i], s[i], 1.0, 0.0) - black[i]).abs() < 6e-7);
        }
    }
}

/// Thin films take a series, thick ones the closed form: where one hands over to the other, both are the same.
#[test]
fn the_gradient_has_no_step_where_its_series_ends() {
    // The optical depth sqrt(K (K + 2 S)) d is a hundredth there.
    let (k, s) = (0.3_f64, 0.2_f64);
    let end = 0.01 / (k * (k + 2.0 * s)).sqrt();
    let [below, above] = [1.0 - 1e-12, 1.0 + 1e-12].map(|near| gradient(k, s, near * end, 0.4));
    assert_close(below.absorption, above.absorption, 3e-11);
    assert_close(below.scattering, above.scattering, 3e-11);
}

/// Colours of many films at once are those of each by itself, in double precision; also of paints that hardly absorb or scatter.
#[test]
fn many_films_have_the_colours_of_each() {
    use paint_sim::colour::{spectrum_linear_srgb, spectrum_srgb8};
    use paint_sim::paint::{FilmColours, PIGMENTS};
    use paint_sim::{Paint, Substrate};

    let film = 20e-6;
    let clear = Paint::new(&[0.0; 36], &[1e-9; 36], film).unwrap();
    let scatters = Paint::new(&[0.0; 36], &[3.0; 36], film).unwrap();
    let absorbs = Paint::new(&[3.0; 36], &[0.0; 36], film).unwrap();
    let pigments = PIGMENTS.iter().map(|pigment| pigment.paint(film).unwrap());
    // From a ten-thousandth of a film to fifty, and an odd number of them.
    let thickness: Vec<f32> = (0..301).map(|k| 20e-6 * 10.0_f32.powf(-4.0 + 5.7 * k as f32 / 300.0)).collect();
    let (mut worst, mut bytes) = (0.0_f64, 0);
    for paint in pigments.chain([clear, scatters, absorbs]) {
        for ground in [0.0, 0.3, 1.0] {
            let ground = Substrate::grey(ground).unwrap();
            let films = FilmColours::new(&paint, &ground);
            let (mut linear, mut coded) = (vec![[0.0; 3]; thickness.len()], vec![[0; 3]; thickness.len()]);
            films.linear_srgb(&thickness, &mut linear).unwrap();
            films.srgb8(&thickness, &mut coded).unwrap();
            for ((&thickness, linear), coded) in thickness.iter().zip(&linear).zip(&coded) {
                let alone = paint.over(f64::from(thickness), &ground).unwrap();
                let closed = spectrum_linear_srgb(alone.reflectance());
                for c in 0..3 {
                    worst = worst.max((f64::from(linear[c]) - closed[c]).abs());
                    bytes = bytes.max(coded[c].abs_diff(spectrum_srgb8(alone.reflectance()).rgb[c]));
                }
            }
        }
    }
    assert!(worst < 2e-6, "{worst}");
    assert!(bytes <= 1, "{bytes}");
    let films = FilmColours::new(&scatters, &Substrate::grey(0.3).unwrap());
    let (mut odd, mut bare) = ([[0.0; 3]; 2], [[0.0; 3]; 1]);
    films.linear_srgb(&[f32::NAN, -1.0], &mut odd).unwrap();
    films.linear_srgb(&[0.0], &mut bare).unwrap();
    assert_eq!(odd, [bare[0]; 2]);
    assert!(films.linear_srgb(&[0.0], &mut odd).unwrap_err().to_string().contains("thicknesses"));
}
