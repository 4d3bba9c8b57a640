//! Lenses: published values, closed forms, derivatives against differences, and what must be refused.

use crate::support::rng::Rng;
use vio_ekf::Camera;
use vio_ekf::camera::Distortion;
use vio_ekf::nalgebra::{Matrix2x3, Vector2, Vector3};

fn lenses() -> [Camera; 4] {
    let euroc = Camera::euroc();
    let with = |distortion| Camera { distortion, ..euroc };
    [
        euroc,
        with(Distortion::None),
        with(Distortion::RadTan([0.12, 0.03, -0.002, 0.001])),
        // The left camera of TUM-VI (Schubert et al. 2018).
        with(Distortion::Equidistant([0.0034823894, 0.0007150348, -0.0020532361, 0.00020293673])),
    ]
}

#[test]
fn the_euroc_lens_images_a_point_where_the_polynomial_says() {
    // Worked out in numpy from the formula, fx 458.654, point (.3, -.2, 1).
    let pixel = Camera::euroc().project(&Vector3::new(0.6, -0.4, 2.0)).unwrap();
    assert!((pixel - Vector2::new(499.9055685, 160.1887447)).norm() < 1e-7, "{pixel}");
}

#[test]
fn an_equidistant_lens_without_coefficients_images_the_angle() {
    let camera =
        Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, distortion: Distortion::Equidistant([0.0; 4]), ..Camera::euroc() };
    // atan(|(.3, -.2)|) = 0.346046931 rad.
    let pixel = camera.project(&Vector3::new(0.3, -0.2, 1.0)).unwrap();
    assert!((pixel.norm() - 0.346046931).abs() < 1e-9);
    // Beyond a right angle, where no plane is: 120 degrees off the axis.
    let (sine, cosine) = (2.0 * std::f64::consts::FRAC_PI_3).sin_cos();
    let pixel = camera.project(&Vector3::new(0.0, sine, cosine)).unwrap();
    assert!((pixel - Vector2::new(0.0, 2.0 * std::f64::consts::FRAC_PI_3)).norm() < 1e-14);
}

#[test]
fn bearing_inverts_project_over_the_whole_image() {
    for camera in lenses() {
        for row in (0..camera.height).step_by(16) {
            for column in (0..camera.width).step_by(16) {
                let pixel = Vector2::new(column as f64, row as f64);
                let bearing = camera.bearing(&pixel).unwrap();
                assert!((bearing.norm() - 1.0).abs() < 1e-14);
                let again = camera.project(&(bearing.into_inner() * 3.0)).unwrap();
                assert!((again - pixel).norm() < 1e-9, "{:?}: {pixel} {again}", camera.distortion);
            }
        }
    }
}

#[test]
fn jacobians_agree_with_differences() {
    let mut rng = Rng::new(11);
    for camera in lenses() {
        for case in 0..200 {
            let scale = if case == 0 { 0.0 } else { 0.7 };
            let point = Vector3::new(scale * rng.signed(), scale * rng.signed(), 1.5 + rng.signed());
            let (pixel, jacobian) = camera.project_with_jacobian(&point).unwrap();
            assert_eq!(camera.project(&point), Some(pixel));
            let step = 1e-6;
            let numeric = Matrix2x3::from_columns(&[0, 1, 2].map(|axis| {
                let mut offset = Vector3::zeros();
                offset[axis] = step;
                (camera.project(&(point + offset)).unwrap() - camera.project(&(point - offset)).unwrap()) / (2.0 * step)
            }));
            assert!((jacobian - numeric).norm() < 1e-6 * (1.0 + numeric.norm()), "{:?} {point}", camera.distortion);
        }
    }
}

#[test]
fn points_behind_and_beyond_the_fold_are_refused() {
    let euroc = Camera::euroc();
    for point in [
        Vector3::new(0.1, 0.0, -1.0),
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::zeros(),
        Vector3::new(f64::NAN, 0.0, 1.0),
        Vector3::new(0.0, f64::INFINITY, 1.0),
    ] {
        for camera in lenses() {
            if !matches!(camera.distortion, Distortion::Equidistant(_)) || point.z >= 0.0 && point.x != 1.0 {
                assert_eq!(camera.project(&point), None, "{:?} {point}", camera.distortion);
            }
        }
    }
    // r - r³/3 turns round at r = 1: the image ends at radius 2/3, and points beyond r = 1 fold back into it.
    let folded = Camera {
        fx: 100.0,
        fy: 100.0,
        cx: 0.0,
        cy: 0.0,
        distortion: Distortion::RadTan([-1.0 / 3.0, 0.0, 0.0, 0.0]),
        ..euroc
    };
    assert!(folded.project(&Vector3::new(0.99, 0.0, 1.0)).is_some());
    assert_eq!(folded.project(&Vector3::new(1.01, 0.0, 1.0)), None);
    assert!(folded.bearing(&Vector2::new(66.0, 0.0)).is_some());
    assert_eq!(folded.bearing(&Vector2::new(67.0, 0.0)), None);
    // The same for an angle: θ - θ³/3.
    let fisheye = Camera { distortion: Distortion::Equidistant([-1.0 / 3.0, 0.0, 0.0, 0.0]), ..folded };
    assert!(fisheye.project(&Vector3::new(0.99_f64.sin(), 0.0, 0.99_f64.cos())).is_some());
    assert_eq!(fisheye.project(&Vector3::new(1.01_f64.sin(), 0.0, 1.01_f64.cos())), None);
    assert_eq!(fisheye.bearing(&Vector2::new(67.0, 0.0)), None);
    assert_eq!(fisheye.project(&Vector3::new(0.0, 0.0, -1.0)), None);
    assert_eq!(euroc.bearing(&Vector2::new(f64::NAN, 0.0)), None);
}

#[test]
fn impossible_calibrations_are_refused() {
    let good = Camera::euroc();
    assert_eq!(good.check(), Ok(()));
    for bad in [
        Camera { width: 0, ..good },
        Camera { fx: 0.0, ..good },
        Camera { fy: f64::NAN, ..good },
        Camera { cx: f64::INFINITY, ..good },
        Camera { distortion: Distortion::RadTan([0.0, f64::NAN, 0.0, 0.0]), ..good },
    ] {
        assert!(bad.check().is_err(), "{bad:?}");
    }
}
