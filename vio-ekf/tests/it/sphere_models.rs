//! The wide lenses of Kalibr: against the geometry that they are made of, differences, their inverse, and their files.

use crate::support::rng::Rng;
use vio_ekf::camera::Distortion;
use vio_ekf::format::calibration::{CameraCalibration, read_asl_camera, read_kalibr_cameras, write_asl_camera};
use vio_ekf::nalgebra::{Matrix2x3, Vector2, Vector3};
use vio_ekf::{Camera, Error};

/// Calibrations of real lenses: the fisheyes of TUM-VI and others as Usenko et al. 2018 print them in table I, and a mirror.
fn lenses() -> [Camera; 6] {
    let with = |distortion, f| Camera {
        width: 512,
        height: 512,
        fx: f,
        fy: 1.01 * f,
        cx: 254.9,
        cy: 256.9,
        distortion,
        ..Camera::euroc()
    };
    [
        with(Distortion::DoubleSphere([-0.172, 0.593]), 158.3),
        with(Distortion::DoubleSphere([0.1, 0.4]), 180.0),
        with(Distortion::Eucm([0.63, 1.04]), 191.0),
        with(Distortion::Eucm([0.3, 0.8]), 191.0),
        with(Distortion::Omni { xi: 0.8, radtan: [0.0; 4] }, 340.0),
        with(Distortion::Omni { xi: 1.3, radtan: [-0.04, 0.01, 1e-3, -5e-4] }, 430.0),
    ]
}

/// The same lenses as what they are made of: spheres and pinholes, or the ellipsoid that EUCM is.
fn by_geometry(camera: &Camera, p: &Vector3<f64>) -> Option<Vector2<f64>> {
    let on_sphere = p.normalize();
    let m = match camera.distortion {
        Distortion::DoubleSphere([xi, alpha]) => {
            let on_second = (on_sphere + Vector3::z() * xi).normalize();
            let seen = on_second + Vector3::z() * (alpha / (1.0 - alpha));
            seen.xy() / seen.z / (1.0 - alpha)
        }
        Distortion::Eucm([alpha, beta]) => {
            // The point of the surface (α d + (1 − α) z = 1, d² = β (x² + y²) + z²) on the ray: (x, y) there, by bisection.
            let height = |t: f64| {
                let q = p * t;
                alpha * (beta * (q.x * q.x + q.y * q.y) + q.z * q.z).sqrt() + (1.0 - alpha) * q.z - 1.0
            };
            let (mut low, mut high) = (0.0, 1e6);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                if height(middle) < 0.0 { low = middle } else { high = middle }
            }
            (p * low).xy()
        }
        Distortion::Omni { xi, radtan: [k1, k2, p1, p2] } => {
            let seen = on_sphere + Vector3::z() * xi;
            let m = seen.xy() / seen.z;
            let (x, y, s) = (m.x, m.y, m.norm_squared());
            let radial = 1.0 + k1 * s + k2 * s * s;
            m * radial
                + Vector2::new(2.0 * p1 * x * y + p2 * (s + 2.0 * x * x), p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y)
        }
        _ => return None,
    };
    Some(Vector2::new(camera.fx * m.x + camera.cx, camera.fy * m.y + camera.cy))
}

/// Half of the field of view: where a point leaves the valid range, found by projecting.
fn widest(camera: &Camera) -> f64 {
    let seen = |angle: f64| camera.project(&Vector3::new(angle.sin(), 0.0, angle.cos())).is_some();
    (1..3142).map(|k| f64::from(k) * 1e-3).take_while(|&angle| seen(angle)).last().unwrap()
}

/// Eqs. (43) to (45) with w1 = 1/2 and ξ = 7/8: w2 = (1/2 + 7/8) / sqrt(7/8 + 49/64 + 1) = (11/8) / (13/8).
#[test]
fn a_double_sphere_sees_as_far_behind_itself_as_its_equation_says() {
    let camera = Camera { distortion: Distortion::DoubleSphere([0.875, 1.0 / 3.0]), ..Camera::euroc() };
    let seen = |cosine: f64| camera.project(&Vector3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine)).is_some();
    assert!(seen(-11.0 / 13.0 + 1e-6) && !seen(-11.0 / 13.0 - 1e-6));
}

#[test]
fn wide_lenses_are_the_geometry_that_they_are_made_of() {
    let mut rng = Rng::new(3);
    for camera in lenses() {
        let limit = widest(&camera);
        let (mut behind, mut seen) = (0, 0);
        for _ in 0..2000 {
            let point = rng.vector() * 3.0;
            let Some((pixel, jacobian)) = camera.project_with_jacobian(&point) else { continue };
            assert_eq!(camera.project(&point), Some(pixel));
            let angle = point.xy().norm().atan2(point.z);
            seen += 1;
            behind += usize::from(point.z < 0.0);
            let expected = by_geometry(&camera, &point).unwrap();
            // At the rim of the range the pixel of a point loses digits.
            if angle > 0.98 * limit {
                continue;
            }
            assert!((pixel - expected).norm() < 1e-7 * (1.0 + pixel.norm()), "{:?} {point}", camera.distortion);
            let numeric = Matrix2x3::from_columns(&[0, 1, 2].map(|axis| {
                let mut step = Vector3::zeros();
                step[axis] = 1e-6 * point.norm();
                let moved = |sign: f64| camera.project(&(point + step * sign)).unwrap();
                (moved(1.0) - moved(-1.0)) / (2.0 * step[axis])
            }));
            assert!((jacobian - numeric).norm() < 1e-5 * (1.0 + numeric.norm()), "{:?} {point}", camera.distortion);
        }
        assert!(seen > 800 && behind > 50, "{:?}: {seen} seen, {behind} behind", camera.distortion);
    }
}

/// Pixel to bearing to pixel, and bearing to pixel to bearing, to 1e-12 wherever the model is defined.
#[test]
fn wide_lenses_invert_to_the_last_digits() {
    for camera in lenses() {
        let limit = widest(&camera);
        assert!(limit > 1.6, "{:?} sees {limit} rad off the axis", camera.distortion);
        for step in 0..=400 {
            // Up to 95 % of the range: at its rim the angle is no function of the pixel any more.
            let angle = 0.95 * limit * f64::from(step) / 400.0;
            for turn in 0..16 {
                let (s, c) = (f64::from(turn) * std::f64::consts::TAU / 16.0).sin_cos();
                let bearing = Vector3::new(c * angle.sin(), s * angle.sin(), angle.cos());
                let pixel = camera.project(&(bearing * 2.5)).unwrap();
                let again = camera.bearing(&pixel).unwrap();
                assert!((again.into_inner() - bearing).norm() < 1e-12, "{:?} at {angle} rad", camera.distortion);
                let pixel_again = camera.project(&again).unwrap();
                assert!((pixel_again - pixel).norm() < 1e-12 * 512.0, "{:?} at {pixel}", camera.distortion);
            }
        }
    }
}

#[test]
fn what_a_wide_lens_cannot_see_is_refused() {
    for camera in lenses() {
        let limit = widest(&camera);
        let beyond = limit + 0.01;
        for point in [
            Vector3::new(beyond.sin(), 0.0, beyond.cos()),
            -Vector3::z(),
            Vector3::zeros(),
            Vector3::new(f64::NAN, 0.0, 1.0),
            Vector3::new(0.0, f64::INFINITY, 1.0),
        ] {
            assert_eq!(camera.project(&point), None, "{:?} {point}", camera.distortion);
            assert!(camera.project_with_jacobian(&point).is_none(), "{:?} {point}", camera.distortion);
        }
    }
    // α > 1/2 ends at r² = 1 / (2 α − 1), in EUCM at 1 / (β (2 α − 1)); ξ > 1 at 1 / (ξ² − 1).
    let edge = |camera: &Camera, square: f64| {
        let pixel = |share: f64| Vector2::new(camera.cx + share * camera.fx * square.sqrt(), camera.cy);
        assert!(camera.bearing(&pixel(0.999)).is_some() && camera.bearing(&pixel(1.001)).is_none(), "{camera:?}");
    };
    let [ds, _, eucm, ..] = lenses();
    edge(&ds, 1.0 / (2.0 * 0.593 - 1.0));
    edge(&eucm, 1.0 / (1.04 * (2.0 * 0.63 - 1.0)));
    edge(&Camera { distortion: Distortion::Omni { xi: 1.3, radtan: [0.0; 4] }, ..ds }, 1.0 / (1.3 * 1.3 - 1.0));
    let refused = |distortion| match (Camera { distortion, ..ds }).check() {
        Err(Error::InvalidSetting { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(Distortion::DoubleSphere([-1.0, 0.5])), "xi");
    assert_eq!(refused(Distortion::DoubleSphere([0.0, 1.1])), "alpha");
    assert_eq!(refused(Distortion::Eucm([0.5, 0.0])), "beta");
    assert_eq!(refused(Distortion::Eucm([f64::NAN, 1.0])), "alpha");
    assert_eq!(refused(Distortion::Omni { xi: -0.1, radtan: [0.0; 4] }), "xi");
    assert_eq!(refused(Distortion::Omni { xi: 1.0, radtan: [0.0, f64::NAN, 0.0, 0.0] }), "distortion");
}

#[test]
fn the_files_of_kalibr_say_which_lens_it_is() {
    let chain = |model: &str, intrinsics: &str, distortion: &str, coefficients: &str| {
        format!(
            "cam0:\n  T_cam_imu:\n  - [1.0, 0.0, 0.0, 0.1]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  \
             camera_model: {model}\n  distortion_coeffs: {coefficients}\n  distortion_model: {distortion}\n  intrinsics: {intrinsics}\n  \
             resolution: [512, 512]\n"
        )
    };
    let read = |text: String| read_kalibr_cameras(&text).map(|cameras| cameras[0].camera);
    let ds = read(chain("ds", "[-0.172, 0.593, 158.3, 158.4, 254.9, 256.9]", "none", "[]")).unwrap();
    assert_eq!(ds.distortion, Distortion::DoubleSphere([-0.172, 0.593]));
    assert_eq!((ds.fx, ds.fy, ds.cx, ds.cy), (158.3, 158.4, 254.9, 256.9));
    let eucm = read(chain("eucm", "[0.63, 1.04, 191.0, 191.1, 254.9, 256.9]", "none", "[]")).unwrap();
    assert_eq!(eucm.distortion, Distortion::Eucm([0.63, 1.04]));
    let omni = read(chain("omni", "[1.3, 430.0, 430.1, 254.9, 256.9]", "radtan", "[-0.04, 0.01, 0.001, 0.0]")).unwrap();
    assert_eq!(omni.distortion, Distortion::Omni { xi: 1.3, radtan: [-0.04, 0.01, 1e-3, 0.0] });
    assert_eq!((omni.fx, omni.cy), (430.0, 256.9));
    let plain = read(chain("omni", "[1.3, 430.0, 430.1, 254.9, 256.9]", "none", "[]")).unwrap();
    assert_eq!(plain.distortion, Distortion::Omni { xi: 1.3, radtan: [0.0; 4] });

    let why = |text: String| read(text).unwrap_err().to_string();
    let error = why(chain("ds", "[-0.172, 0.593, 158.3, 158.4, 254.9, 256.9]", "radtan", "[0, 0, 0, 0]"));
    assert!(error.contains("line 9") && error.contains("only `none` goes with `ds`"), "{error}");
    let error = why(chain("ds", "[158.3, 158.4, 254.9, 256.9]", "none", "[]"));
    assert!(error.contains("expected 6 numbers, found 4"), "{error}");
    let error = why(chain("omni", "[1.3, 430.0, 430.1, 254.9, 256.9]", "equidistant", "[0, 0, 0, 0]"));
    assert!(error.contains("only `radtan`"), "{error}");
    let error = why(chain("eucm", "[1.3, 1.0, 430.0, 430.1, 254.9, 256.9]", "none", "[]"));
    assert!(error.contains("alpha"), "{error}");
    let error = why(chain("scaramuzza", "[1, 2, 3, 4]", "none", "[]"));
    assert!(error.contains("`scaramuzza`") && error.contains("`CameraModel`"), "{error}");

    // What is written for an EuRoC folder is read again.
    for camera in lenses() {
        let calibration = CameraCalibration { camera, rate_hz: Some(20.0), time_offset_s: 0.0, row_time_s: 0.0 };
        let again = read_asl_camera(&write_asl_camera(&calibration)).unwrap();
        assert_eq!(again.camera.distortion, camera.distortion);
        assert_eq!((again.camera.fx, again.camera.cy), (camera.fx, camera.cy));
    }
}
