//! Paints from charts of layers.

use paint_sim::colour::{BANDS, Spectrum};
use paint_sim::paint::Patch;
use paint_sim::{Error, Paint, Substrate};

/// Kubelka and Munk's textbook form, for films that neither vanish nor only scatter.
fn reflectance(k: f64, s: f64, d: f64, ground: f64) -> f64 {
    let a = (k + s) / s;
    let b = (a * a - 1.0).sqrt();
    let c = b / (b * s * d).tanh();
    (1.0 - ground * (a - c)) / (a - ground + c)
}

/// Deviates by Box and Muller from `SplitMix64`.
pub(crate) fn normals(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    let mut uniform = move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    move || (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

/// Layers of 8 um of a paint whose coefficients, per layer, differ from band to band.
fn coefficients(band: usize) -> [f64; 2] {
    let x = band as f64 / (BANDS - 1) as f64;
    [0.02 + 0.4 * x * x, 0.1 + 0.25 * (1.0 - x)]
}

const LAYER: f64 = 8e-6;
const LAYERS: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

fn ground(band: usize) -> f64 {
    0.75 + 0.1 * (band as f64).sin()
}

/// Patches with `readings` readings of 0.5 % noise each.
fn chart(seed: u64, readings: f64) -> (Substrate, Vec<Patch>) {
    let (mut normal, noise) = (normals(seed), 0.005 / readings.sqrt());
    let mut patch = |layers: f64| {
        let read = |band: usize| {
            let [k, s] = coefficients(band);
            reflectance(k, s, layers, ground(band)) + noise * normal()
        };
        Patch { thickness: LAYER * layers, reflectance: std::array::from_fn(read), noise }
    };
    let patches = LAYERS.into_iter().map(&mut patch).collect();
    (Substrate::new(std::array::from_fn(ground)).unwrap(), patches)
}

#[test]
fn a_chart_tells_the_paint() {
    let (ground, patches) = chart(1, 1e16);
    let fit = Paint::from_chart(&ground, &patches).unwrap();
    for band in 0..BANDS {
        let [k, s] = coefficients(band);
        let [found_k, found_s] = [fit.paint.absorption()[band], fit.paint.scattering()[band]].map(|v| v * LAYER);
        assert!((found_k / k - 1.0).abs() < 1e-5 && (found_s / s - 1.0).abs() < 1e-5, "{band}: {found_k} {k}");
    }
}

#[test]
fn the_fit_of_any_paint_is_as_good_as_the_truth() {
    let mut normal = normals(11);
    for _ in 0..30 {
        // Per layer, from glazes that 16 layers hardly show to paints that hide in one.
        let mut spread = |middle: f64| -> Spectrum { std::array::from_fn(|_| middle * (1.3 * normal()).exp()) };
        let (k, s) = (spread(0.1), spread(0.3));
        let noise = 1e-3;
        let exact = |layers: f64, band: usize| reflectance(k[band], s[band], layers, 0.6);
        let patches: Vec<Patch> = LAYERS
            .into_iter()
            .map(|layers| Patch {
                thickness: LAYER * layers,
                reflectance: std::array::from_fn(|band| exact(layers, band) + noise * normal()),
                noise,
            })
            .collect();
        let fit = Paint::from_chart(&Substrate::grey(0.6).unwrap(), &patches).unwrap();
        for band in 0..BANDS {
            let square =
                |(patch, layers): (&Patch, f64)| ((patch.reflectance[band] - exact(layers, band)) / noise).powi(2);
            let truth: f64 = patches.iter().zip(LAYERS).map(square).sum();
            assert!(fit.chi_square[band] < truth + 1e-3, "{} {}: {} {truth}", k[band], s[band], fit.chi_square[band]);
        }
        assert!(fit.agrees());
    }
}

#[test]
fn coefficients_are_within_one_per_cent_where_the_chart_determines_them() {
    let (mut determined, mut squares, mut within, mut count) = (0, 0.0, 0, 0);
    for seed in 1..=20 {
        // A patch of 20 by 20 pixels.
        let (ground, patches) = chart(seed, 400.0);
        let fit = Paint::from_chart(&ground, &patches).unwrap();
        assert!(fit.agrees() && fit.degrees_of_freedom == 3, "{:?}", fit.chi_square);
        for band in 0..BANDS {
            let off = [0, 1].map(|i| {
                let found = [fit.paint.absorption(), fit.paint.scattering()][i][band] * LAYER;
                found / coefficients(band)[i] - 1.0
            });
            // Three deviations are one per cent.
            if fit.determines(band, 0.01 / 3.0) {
                determined += 1;
                assert!(off[0].abs() < 0.011 && off[1].abs() < 0.011, "{seed} {band}: {off:?}");
                within += usize::from(off[0].abs() < 0.01 && off[1].abs() < 0.01);
            }
            for (off, deviation) in off.iter().zip([fit.absorption_deviation[band], fit.scattering_deviation[band]]) {
                squares += (off / deviation).powi(2);
                count += 1;
            }
        }
    }
    println!(
        "{determined} of {} bands determined, {within} within 1 %; mean square {}",
        20 * BANDS,
        squares / f64::from(count)
    );
    assert!(determined > 10 * BANDS && within * 100 >= determined * 99, "{determined} {within}");
    // The deviations are what they say.
    assert!((squares / f64::from(count) - 1.0).abs() < 0.15, "{}", squares / f64::from(count));
}

#[test]
fn a_chart_on_a_wrong_ground_does_not_agree() {
    let (_, patches) = chart(3, 400.0);
    let fit = Paint::from_chart(&Substrate::grey(0.7).unwrap(), &patches).unwrap();
    assert!(!fit.agrees());
}

#[test]
fn what_a_chart_leaves_open_is_said() {
    // Hiding from the first layer on: the ratio of both coefficients is all that there is.
    let (mut normal, [k, s]) = (normals(5), [3.0, 20.0]);
    let patch = |layers: f64| {
        let reflectance: Spectrum =
            std::array::from_fn(|band| reflectance(k, s, layers, if band < 3 { 0.9 } else { 0.4 }) + 1e-3 * normal());
        Patch { thickness: LAYER * layers, reflectance, noise: 1e-3 }
    };
    let patches: Vec<Patch> = LAYERS.into_iter().map(patch).collect();
    let refused = Paint::from_chart(&Substrate::grey(0.5).unwrap(), &patches);
    let open = |fit: &paint_sim::paint::ChartFit| !fit.determines(10, 0.2);
    assert!(match &refused {
        Err(Error::Undetermined { .. }) => true,
        Ok(fit) => open(fit),
        Err(_) => false,
    });
    // A paint that absorbs nothing: scattering is told, absorption is not.
    let white = |layers: f64| {
        let scattered = 0.3 * layers * 0.8;
        Patch { thickness: LAYER * layers, reflectance: [(0.2 + scattered) / (1.0 + scattered); BANDS], noise: 1e-3 }
    };
    let patches: Vec<Patch> = LAYERS.into_iter().map(white).collect();
    let fit = Paint::from_chart(&Substrate::grey(0.2).unwrap(), &patches).unwrap();
    assert!((fit.paint.scattering()[7] * LAYER / 0.3 - 1.0).abs() < 1e-3 && fit.absorption_deviation[7] > 1.0);
}

#[test]
fn charts_that_are_none_are_refused() {
    let (ground, good) = chart(2, 100.0);
    let refused = |change: &dyn Fn(&mut Vec<Patch>)| {
        let mut patches = good.clone();
        change(&mut patches);
        Paint::from_chart(&ground, &patches).unwrap_err()
    };
    assert!(matches!(refused(&|p| p.clear()), Error::WrongLength { .. }));
    assert!(matches!(refused(&|p| p.truncate(1)), Error::WrongLength { .. }));
    assert!(matches!(refused(&|p| p[2].reflectance[4] = f64::NAN), Error::NotFinite { index: 2, .. }));
    assert!(matches!(refused(&|p| p[2].reflectance[4] = 1.4), Error::OutOfRange { .. }));
    assert!(matches!(refused(&|p| p[1].thickness = 0.0), Error::OutOfRange { .. }));
    assert!(matches!(refused(&|p| p[1].noise = 0.0), Error::OutOfRange { .. }));
}
