//! Layouts whose shape is known in closed form, and what must not change the result.

use std::f64::consts::{PI, TAU};

use crate::common::{Mesh, grid};
use uv_param::disk::{Repair, largest_disk_with};
use uv_param::{Chart, Error, Method, Settings, unwrap};

fn lay_out((positions, faces): &Mesh, settings: &Settings) -> Chart {
    let (disk, _) = largest_disk_with(positions, faces, Repair::default()).unwrap();
    unwrap(&disk, settings, |_| ()).unwrap()
}

fn exact(method: Method) -> Settings {
    Settings { method, tolerance: 0.0, iterations: 2000, up: None }
}

/// A polyhedral cylinder of radius 0.5 and height 1.3 with 64 sides, slit along one edge.
fn slit_cylinder() -> Mesh {
    grid(64, 16, |s, t| [0.5 * (TAU * s).cos(), 0.5 * (TAU * s).sin(), 1.3 * t])
}

#[test]
fn a_slit_cylinder_unrolls_to_its_chords() {
    // 64 chords of 2 r sin(pi / 64).
    let width = 64.0 * 2.0 * 0.5 * (PI / 64.0).sin();
    for method in [Method::Arap, Method::SymmetricDirichlet] {
        let chart = lay_out(&slit_cylinder(), &exact(method));
        let q = chart.quality();
        assert!((chart.width() - width).abs() < 1e-9, "{method:?}: {} m wide", chart.width());
        assert!((chart.height() - 1.3).abs() < 1e-9);
        assert!((q.area_m2 - 4.082430504).abs() < 1e-9);
        assert!((q.symmetric_dirichlet - 1.0).abs() < 1e-12, "{method:?}: {}", q.symmetric_dirichlet);
        assert!(q.arap < 1e-18, "{method:?}: {}", q.arap);
        assert_eq!((q.flips, q.flips_f32), (0, 0));
        assert!((q.stretch_max - 1.0).abs() < 1e-8 && q.length_err_p99 < 1e-8);
    }
}

#[test]
fn a_slit_cone_unrolls_to_a_sector() {
    // Half apex angle a, n sides: the fan opens by n 2 asin(sin a sin(pi / n)).
    let (a, n) = (20.0_f64.to_radians(), 48);
    let mesh = grid(n, 10, |s, t| {
        let slant = 0.2 + 0.8 * t;
        let r = slant * a.sin();
        [r * (TAU * s).cos(), r * (TAU * s).sin(), -slant * a.cos()]
    });
    let chart = lay_out(&mesh, &exact(Method::SymmetricDirichlet));
    assert!(chart.quality().symmetric_dirichlet - 1.0 < 1e-10);
    let uv = |i: u32, j: u32| chart.uv()[(j * (n + 1) + i) as usize];
    let side = |i: u32| [uv(i, 10)[0] - uv(i, 0)[0], uv(i, 10)[1] - uv(i, 0)[1]];
    let (p, q) = (side(0), side(n));
    let angle = (p[0] * q[1] - p[1] * q[0]).atan2(p[0] * q[0] + p[1] * q[1]).abs();
    let expected = f64::from(n) * 2.0 * (a.sin() * (PI / f64::from(n)).sin()).asin();
    assert!((angle - expected).abs() < 1e-7, "{angle} instead of {expected}");
}

#[test]
fn a_flat_sheet_with_holes_stays_as_it_is() {
    // An L-shaped sheet, tilted in space, with one square cut out.
    let tilt = nalgebra_rotation();
    let (positions, mut faces) =
        grid(6, 6, |s, t| (tilt * uv_param::nalgebra::Vector3::new(3.0 * s, 2.0 * t, 0.0)).into());
    faces.retain(|f| {
        let (i, j) = (f[0] % 7, f[0] / 7);
        !(i >= 4 && j >= 4) && (i, j) != (1, 2)
    });
    let chart = lay_out(&(positions, faces), &exact(Method::Arap));
    assert_eq!(chart.disk().boundary_loops().len(), 2);
    assert!(chart.quality().arap < 1e-20, "{}", chart.quality().arap);
    assert!((chart.width() - 3.0).abs() < 1e-9 && (chart.height() - 2.0).abs() < 1e-9);
}

fn nalgebra_rotation() -> uv_param::nalgebra::Rotation3<f64> {
    uv_param::nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 1.1)
}

/// A bumpy sheet that no layout can make flat.
fn bumps(scale: f64) -> Mesh {
    grid(24, 16, |s, t| [3.0 * s, 2.0 * t, 0.4 * (5.0 * s).sin() * (4.0 * t).cos()].map(|x| scale * x))
}

#[test]
fn the_unit_of_length_does_not_matter() {
    for method in [Method::Arap, Method::SymmetricDirichlet] {
        let settings = Settings { method, ..Settings::default() };
        let reference = lay_out(&bumps(1.0), &settings);
        for scale in [1000.0, 0.001, 1e25, 1e-25] {
            let chart = lay_out(&bumps(scale), &settings);
            for (a, b) in reference.uv().iter().flatten().zip(chart.uv().iter().flatten()) {
                assert!((a - b / scale).abs() < 1e-9 * reference.width());
            }
        }
    }
}

#[test]
fn where_the_surface_stands_does_not_matter() {
    let (positions, faces) = bumps(1.0);
    let rotation = nalgebra_rotation();
    let turned = positions.iter().map(|&p| (rotation * uv_param::nalgebra::Vector3::from(p)).add_scalar(5.0).into());
    let reference = lay_out(&(positions.clone(), faces.clone()), &Settings::default());
    let chart = lay_out(&(turned.collect(), faces), &Settings::default());
    for (a, b) in reference.uv().iter().flatten().zip(chart.uv().iter().flatten()) {
        assert!((a - b).abs() < 1e-9);
    }
}

#[test]
fn the_two_energies_are_what_they_say() {
    // A square stretched by 1.5 along u and 0.8 along v, with the values of the definitions.
    let (positions, faces) = grid(4, 4, |s, t| [s, t, 0.0]);
    let (disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    let uv = positions.iter().map(|p| [1.5 * p[0], 0.8 * p[1]]).collect();
    let q = *Chart::new(disk, uv, 0, None).unwrap().quality();
    assert!((q.arap - (0.25 + 0.04)).abs() < 1e-12);
    let w = 1.5_f64.powi(2) + 0.8_f64.powi(2) + 1.5_f64.powi(-2) + 0.8_f64.powi(-2);
    assert!((q.symmetric_dirichlet - w / 4.0).abs() < 1e-12);
    assert!((q.stretch_p99 - 1.5).abs() < 1e-12 && (q.stretch_max - 1.5).abs() < 1e-12);
    assert!((q.length_err_mean - 0.5).abs() < 1e-12 && (q.length_err_p99 - 0.5).abs() < 1e-12);
}

#[test]
fn folded_faces_are_counted() {
    let (positions, faces) = grid(2, 2, |s, t| [s, t, 0.0]);
    let (disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    let mut uv: Vec<[f64; 2]> = positions.iter().map(|p| [p[0], p[1]]).collect();
    // The middle vertex pulled over the right edge of the square: the two faces on that side flip.
    uv[4] = [1.25, 0.5];
    let chart = Chart::new(disk, uv, 0, None).unwrap();
    assert_eq!((chart.quality().flips, chart.quality().flips_f32), (2, 2));
    assert_eq!(chart.quality().symmetric_dirichlet, f64::INFINITY);
    assert_eq!((0..8).filter(|&f| chart.stretch(f)[1] < 0.0).count(), 2);
}

#[test]
fn a_wall_stands_upright_and_is_not_mirrored() {
    // A wall in the plane y = 0 whose normal is -y: seen from there x runs right and z up.
    for up in [1.0, -1.0] {
        let chart = lay_out(
            &grid(8, 3, |s, t| [4.0 * s, 0.0, t]),
            &Settings { up: Some([0.0, 0.0, up]), ..exact(Method::Auto) },
        );
        assert!(chart.face_normal(0).y < -0.99);
        for (uv, p) in chart.uv().iter().zip(chart.disk().positions()) {
            let expected = if up > 0.0 { [p[0], p[2]] } else { [4.0 - p[0], 1.0 - p[2]] };
            assert!((uv[0] - expected[0]).abs() < 1e-9 && (uv[1] - expected[1]).abs() < 1e-9);
        }
    }
}

/// Portrait, square and landscape pieces, turned in their own plane by any angle: the highest point of the surface is the
/// highest point of the chart, and the box is no larger than it must be.
#[test]
fn charts_stand_upright_whatever_their_shape() {
    for (width, height) in [(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)] {
        for degrees in [0.0_f64, 20.0, 45.0, 130.0, 250.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let place = |s: f64, t: f64| {
                let (x, z) = (width * (s - 0.5), height * (t - 0.5));
                [cos * x - sin * z, 0.0, sin * x + cos * z]
            };
            let settings = Settings { up: Some([0.0, 0.0, 1.0]), ..exact(Method::Auto) };
            let chart = lay_out(&grid(6, 6, place), &settings);
            let lowest = chart.disk().positions().iter().map(|p| p[2]).fold(f64::MAX, f64::min);
            for (uv, p) in chart.uv().iter().zip(chart.disk().positions()) {
                assert!(
                    (uv[1] - (p[2] - lowest)).abs() < 1e-9,
                    "{width} x {height} at {degrees} degrees: {uv:?} {p:?}"
                );
            }
        }
    }
}

/// A floor has no upper side: its smallest box decides.
#[test]
fn a_level_chart_lies_along_its_long_side() {
    let settings = Settings { up: Some([0.0, 0.0, 1.0]), ..exact(Method::Auto) };
    let chart = lay_out(&grid(4, 8, |s, t| [s, 3.0 * t, 0.0]), &settings);
    assert!((chart.width() - 3.0).abs() < 1e-9 && (chart.height() - 1.0).abs() < 1e-9);
}

#[test]
fn the_flip_free_energy_is_stationary_where_it_stops() {
    // Moving any vertex a little from the result must not lower the energy: a check that knows nothing of the gradient.
    let settings = Settings { tolerance: 1e-12, method: Method::SymmetricDirichlet, ..Settings::default() };
    let chart = lay_out(&grid(6, 5, |s, t| [s, t, s * s + 0.5 * t * t]), &settings);
    let least = chart.quality().symmetric_dirichlet;
    for v in 0..chart.uv().len() {
        for move_by in [[1e-4, 0.0], [-1e-4, 0.0], [0.0, 1e-4], [0.0, -1e-4]] {
            let mut uv = chart.uv().to_vec();
            uv[v] = [uv[v][0] + move_by[0], uv[v][1] + move_by[1]];
            let other = Chart::new(chart.disk().clone(), uv, 0, None).unwrap();
            assert!(other.quality().symmetric_dirichlet > least);
        }
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let (positions, faces) = grid(1, 1, |s, t| [s, t, 0.0]);
    let (disk, _) = largest_disk_with(&positions, &faces, Repair::default()).unwrap();
    let refused = |settings: Settings| match unwrap(&disk, &settings, |_| ()) {
        Err(Error::Setting { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(Settings { iterations: 0, ..Settings::default() }), "iterations");
    assert_eq!(refused(Settings { tolerance: f64::NAN, ..Settings::default() }), "tolerance");
    assert_eq!(refused(Settings { up: Some([0.0; 3]), ..Settings::default() }), "up");
    let wrong = Chart::new(disk.clone(), vec![[0.0; 2]; 3], 0, None).unwrap_err();
    assert_eq!(wrong, Error::Length { what: "uv", expected: 4, found: 3 });
    let flat = Chart::new(disk, vec![[1.0; 2]; 4], 0, None).unwrap_err();
    assert_eq!(flat, Error::FlatPoints { points: 4 });
}
