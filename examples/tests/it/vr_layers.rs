//! `vr --experiment layers`: layers of paint as the models predict them, beside tables of what was measured.

use crate::scratch::Scratch;
use crate::vr::{report, vr};

/// Reflectance of an opaque film of ratio `q` = K/S under a surface that keeps `k2` of the light inside, in the textbook's forms.
fn opaque(q: f64, k2: f64) -> f64 {
    let inner = 1.0 + q - (q * q + 2.0 * q).sqrt();
    (1.0 - k2) * inner / (1.0 - k2 * inner)
}

#[test]
fn layers_of_paint_are_compared_with_what_was_measured() {
    let s = Scratch::new("layers");
    let bands: Vec<f64> = (0..38).map(|band| 380.0 + 10.0 * f64::from(band)).collect();
    let row = |name: &str, value: &dyn Fn(f64) -> f64| {
        bands.iter().fold(name.to_owned(), |line, band| format!("{line},{:.12}", value(*band))) + "\n"
    };
    let header = |names: &str| bands.iter().fold(names.to_owned(), |line, band| format!("{line},{band}")) + "\n";
    let k = |l: f64| 0.02 + 3.0 / (1.0 + ((l - 500.0) / 12.0).exp());
    let scattering = 0.8;
    let coefficients = header("name,coeff")
        + &["Diarylide yellow", "k cobalt blue"]
            .map(|name| row(&format!("{name},K"), &k) + &row(&format!("{name},S"), &|_| scattering))
            .concat();
    s.write("pigments/pigment_painter_KS/pigment_ks_380_750.csv", coefficients);
    let measured = |l: f64| 100.0 * opaque(k(l) / scattering, 0.596_35);
    // The second one was measured otherwise in one band, by five per cent of the light.
    let other = |l: f64| measured(l) + if (l - 600.0).abs() < 1.0 { 5.0 } else { 0.0 };
    let masstones =
        |other: &dyn Fn(f64) -> f64| header("name") + &row("diarylideYellow", &measured) + &row("cobaltBlue", other);
    let table = "pigments/okumura_golden_masstones/golden_matte_masstone_reflectance_pct.csv";
    s.write(table, masstones(&other));
    let layers = || vr(&["--experiment", "layers", "--pigments", &s.path("pigments"), "--out", &s.path("out")]);
    let output = layers();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let figures = report(&s.path("out"));
    assert_eq!((figures["pigments"].as_u64(), figures["pigments_within"].as_u64()), (Some(2), Some(1)));
    assert!(figures["best_error_max"].as_f64().unwrap() < 1e-9, "{figures:#}");
    assert!((figures["worst_error_max"].as_f64().unwrap() - 0.05).abs() < 1e-9, "{figures:#}");
    assert!((figures["worst_error_mean"].as_f64().unwrap() - 0.05 / 36.0).abs() < 1e-9, "{figures:#}");

    // Four layers of a quarter on paper of 0.85, by the closed form with the hyperbolic cotangent.
    let text = std::fs::read_to_string(s.0.join("out/layers.csv")).unwrap();
    let four: Vec<f64> = text
        .lines()
        .find_map(|line| line.strip_prefix("Diarylide yellow,4,"))
        .unwrap()
        .split(',')
        .map(|cell| cell.parse().unwrap())
        .collect();
    let paper = 0.85 / (1.0 - 0.596_35 * 0.15);
    for (band, found) in four[2..].iter().enumerate() {
        let a = 1.0 + k(bands[band]) / scattering;
        let b = (a * a - 1.0).sqrt();
        let coth = 1.0 / (b * scattering).tanh();
        let inner = (1.0 - paper * (a - b * coth)) / (a - paper + b * coth);
        let expected = (1.0 - 0.596_35) * inner / (1.0 - 0.596_35 * inner);
        assert!((found - expected).abs() < 1e-5, "band {band}: {found} {expected}");
    }

    // What is wrong is told in one line that names the table.
    s.write(table, masstones(&|l| if l > 700.0 { f64::NAN } else { 10.0 }));
    let output = layers();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && text.contains("masstone") && text.contains("line 3"), "{text}");
    assert_eq!(vr(&["--experiment", "layers"]).status.code(), Some(2));
}
