//! Charts by what the user needs: stretch before cuts, sides between creases, and the shortest cuts of what is closed.

use std::f64::consts::TAU;

use uv_param::atlas::{AtlasQuality, ChartSettings};
use uv_param::{AtlasSettings, Error, unwrap_atlas};

use super::settings;
use crate::common::{Mesh, Rng, grid};

fn quality(mesh: &Mesh, relaxed_stretch: Option<f64>) -> AtlasQuality {
    let charts = ChartSettings { relaxed_stretch, ..ChartSettings::default() };
    let settings = AtlasSettings { charts, ..settings(0.02) };
    let quality = AtlasQuality::of(&unwrap_atlas(&mesh.0, &mesh.1, &[], &settings, |_| ()).unwrap());
    assert_eq!((quality.flips, quality.flips_f32, quality.overlap_pairs), (0, 0, 0));
    quality
}

/// A sheet of 2 m with windows as deep as their jambs are wide: needs no cut where those may be stretched.
#[test]
fn a_relief_stays_whole_where_stretch_is_allowed() {
    let window = |x: f64, y: f64| (x * 4.0 % 1.0 - 0.5).abs() < 0.25 && (y * 4.0 % 1.0 - 0.5).abs() < 0.25;
    let mesh = grid(41, 41, |x, y| [2.0 * x, 2.0 * y, if window(x, y) { 0.09 } else { 0.0 }]);
    let strict = quality(&mesh, None);
    let relaxed = quality(&mesh, Some(2.0));
    assert!(strict.charts > 1 && strict.stretch_p99 <= 1.15, "{strict:?}");
    assert!(relaxed.charts == 1 && relaxed.seam_length_m < 1e-9, "{relaxed:?}");
    assert!(relaxed.stretch_p99 <= 2.0, "{relaxed:?}");
}

/// Noise of a scan tears a sheet to shreds at the usual bound.
#[test]
fn noise_makes_no_shreds() {
    let random = std::cell::RefCell::new(Rng(7));
    let mesh = grid(41, 41, |x, y| [x, y, 0.04 * (random.borrow_mut().unit() - 0.5)]);
    let (strict, relaxed) = (quality(&mesh, None), quality(&mesh, Some(2.0)));
    assert!(strict.charts > 15, "{strict:?}");
    assert!(10 * relaxed.charts <= strict.charts && relaxed.seam_length_m < 0.1 * strict.seam_length_m, "{relaxed:?}");
}

/// A toothed wheel: who cuts at every crease has their whole length as seams, known in closed form.
#[test]
fn a_wheel_is_cut_at_fewer_edges_than_it_has_creases() {
    let (n, height) = (120_u32, 0.3);
    let radius = |i: u32| if (i / 6).is_multiple_of(2) { 1.0 } else { 0.8 };
    let corner = |r: f64, i: u32, z: f64| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        [r * cos, r * sin, z]
    };
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    for (outer, z) in [(true, 0.0), (true, height), (false, height), (false, 0.0)] {
        mesh.0.extend((0..n).map(|i| corner(if outer { radius(i) } else { 0.3 }, i, z)));
    }
    for ring in 0..4 {
        for i in 0..n {
            let [a, b] = [ring * n + i, ring * n + (i + 1) % n];
            let [c, d] = [(ring + 1) % 4 * n + (i + 1) % n, (ring + 1) % 4 * n + i];
            mesh.1.extend([[a, b, c], [a, c, d]]);
        }
    }
    let side = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt();
    let rim: f64 = (0..n).map(|i| side(corner(radius(i), i, 0.0), corner(radius((i + 1) % n), (i + 1) % n, 0.0))).sum();
    // Two rims of teeth, two of the hole, an edge at every corner of the teeth.
    let hole = f64::from(n) * side(corner(0.3, 0, 0.0), corner(0.3, 1, 0.0));
    let creases = 2.0 * (rim + hole) + f64::from(2 * n / 6) * height;
    let found = quality(&mesh, None);
    assert!(found.seam_length_m < 0.8 * creases, "{:.2} m, creases {creases:.2} m", found.seam_length_m);
}

/// A ring is one chart, opened once around the tube and once along it.
#[test]
fn a_ring_is_opened_along_two_loops() {
    let (n, m) = (16_u32, 60_u32);
    let mut mesh: Mesh = (Vec::new(), Vec::new());
    for k in 0..n * m {
        let [a, b] = [f64::from(k % n) / f64::from(n), f64::from(k / n) / f64::from(m)].map(|t| TAU * t);
        let r = 1.0 + 0.15 * a.cos();
        mesh.0.push([r * b.cos(), r * b.sin(), 0.15 * a.sin()]);
        let at = |i: u32, j: u32| j % m * n + i % n;
        let (i, j) = (k % n, k / n);
        mesh.1.extend([[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
    }
    let found = quality(&mesh, Some(2.0));
    let most = TAU * (0.15 + 1.15);
    assert!(found.charts == 1 && found.seam_length_m < 1.05 * most, "{found:?}, two loops are {most:.2} m at most");
}

#[test]
fn a_relaxed_stretch_below_the_bound_is_refused() {
    let charts = ChartSettings { relaxed_stretch: Some(1.1), ..ChartSettings::default() };
    let mesh = grid(3, 3, |x, y| [x, y, 0.0]);
    let refused = unwrap_atlas(&mesh.0, &mesh.1, &[], &AtlasSettings { charts, ..settings(0.1) }, |_| ());
    assert!(matches!(refused, Err(Error::Setting { name: "relaxed_stretch", .. })));
}
