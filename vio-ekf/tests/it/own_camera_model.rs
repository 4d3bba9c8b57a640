//! A caller's own lens: the double-sphere model against its geometry, and through the filter on points and images.

use crate::support::double_sphere::DoubleSphere;
use crate::support::flight::Flight;
use crate::support::rng::Rng;
use crate::support::sequences::drawn_start;
use vio_ekf::camera::{CameraModel, Distortion};
use vio_ekf::inertial::InitialSigma;
use vio_ekf::nalgebra::{Isometry3, Matrix2x3, Vector2, Vector3};
use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};
use vio_ekf::{Camera, Error, ImuNoise, Settings, Status, Vio};

/// The left fisheye of TUM-VI as Basalt calibrated it: half-angles beyond a right one.
fn tum_vi() -> DoubleSphere {
    DoubleSphere {
        size: (512, 512),
        focal: [158.3, 158.3],
        centre: [254.9, 256.9],
        xi: -0.172,
        alpha: 0.593,
        body_from_camera: Isometry3::identity(),
    }
}

/// Onto a sphere, onto a second one ξ further on, through a pinhole α/(1−α) further on: section IV of Usenko et al. 2018.
fn by_spheres(lens: &DoubleSphere, point: &Vector3<f64>) -> Vector2<f64> {
    let on_second = (point.normalize() + Vector3::z() * lens.xi).normalize();
    let from_pinhole = on_second + Vector3::z() * (lens.alpha / (1.0 - lens.alpha));
    let scale = 1.0 / (1.0 - lens.alpha) / from_pinhole.z;
    Vector2::from([0, 1].map(|k| lens.focal[k] * from_pinhole[k] * scale + lens.centre[k]))
}

#[test]
fn a_double_sphere_is_two_spheres_and_a_pinhole() {
    let mut rng = Rng::new(5);
    let narrow = DoubleSphere { xi: 0.1, alpha: 0.4, ..tum_vi() };
    let mut beyond = 0;
    for lens in [tum_vi(), narrow] {
        for _ in 0..300 {
            let point = rng.vector() * 3.0;
            let Some((pixel, jacobian)) = lens.project_with_jacobian(&point) else { continue };
            beyond += usize::from(point.z < 0.0);
            assert!((pixel - by_spheres(&lens, &point)).norm() < 1e-9, "{point}");
            let numeric = Matrix2x3::from_columns(&[0, 1, 2].map(|axis| {
                let mut step = Vector3::zeros();
                step[axis] = 1e-6;
                (by_spheres(&lens, &(point + step)) - by_spheres(&lens, &(point - step))) / 2e-6
            }));
            assert!((jacobian - numeric).norm() < 1e-5 * (1.0 + numeric.norm()), "{point}");
            let bearing = lens.bearing(&pixel).unwrap();
            assert!((bearing.into_inner() - point.normalize()).norm() < 1e-9, "{point}");
        }
    }
    assert!(beyond > 20, "{beyond} points behind the camera's plane");
    // What the trait derives: pixels per radian on the axis, f / (1 + ξ).
    assert!((tum_vi().focal_length() - 158.3 / (1.0 - 0.172)).abs() < 1e-9);
    assert_eq!(tum_vi().project(&-Vector3::z()), None);
}

/// Root mean square position error, and mean normalised squared error of the position, on points seen by a lens.
fn on_points<C: CameraModel + Clone + 'static>(lens: &C) -> (f64, f64) {
    let (mut square, mut nees, mut count) = (0.0, 0.0, 0.0);
    for seed in 1..=4 {
        let mut flight = Flight::new(seed, 12.0);
        let start = flight.drawn_start(InitialSigma::default());
        let mut vio = Vio::new(lens.clone(), flight.noise, Settings::default()).unwrap();
        for (k, stamp) in flight.stamps().enumerate() {
            vio.imu(&flight.imu(stamp)).unwrap();
            if k == 0 {
                vio.initialize(&start).unwrap();
            } else if k % 10 == 0 && stamp < flight.spline.span().1 {
                let seen = flight.see_with(lens, stamp);
                assert_eq!(vio.points(stamp, &seen).unwrap().status, Status::Tracking);
                let odometry = vio.output().unwrap();
                let error = flight.truth(stamp).world_from_body.translation.vector
                    - odometry.world_from_body.translation.vector;
                let covariance = odometry.covariance.fixed_view::<3, 3>(0, 0).into_owned();
                square += error.norm_squared();
                nees += error.dot(&covariance.cholesky().unwrap().solve(&error));
                count += 1.0;
            }
        }
    }
    ((square / count).sqrt(), nees / count)
}

#[test]
fn a_lens_of_the_callers_own_flies_as_well_as_the_pinhole() {
    let pinhole = Flight::new(1, 1.0).camera;
    // As many pixels per radian, over the whole hemisphere.
    let wide = DoubleSphere {
        size: (1200, 1200),
        focal: [460.0 * (1.0 - 0.172); 2],
        centre: [599.5; 2],
        body_from_camera: pinhole.body_from_camera,
        ..tum_vi()
    };
    let [(built_in, _), (own, nees)] = [on_points(&pinhole), on_points(&wide)];
    eprintln!("position error {built_in:.4} m with the pinhole, {own:.4} m with the double sphere, NEES {nees:.2}");
    assert!(own < 1.2 * built_in && own < 0.1, "{own} {built_in}");
    assert!((1.5..5.0).contains(&nees), "{nees}");
}

/// Where the filter is after some seconds of images.
fn on_images(simulation: &Simulation, lens: impl CameraModel + 'static) -> (Isometry3<f64>, usize) {
    let mut vio = Vio::new(lens, ImuNoise::default(), Settings::default()).unwrap();
    let mut frames = simulation.frames(0).map(Result::unwrap).peekable();
    let mut used = 0;
    for (k, sample) in simulation.imu(0).unwrap().samples.iter().enumerate() {
        vio.imu(sample).unwrap();
        if k == 0 {
            vio.initialize(&drawn_start(simulation, sample.stamp, 3)).unwrap();
        }
        while let Some(frame) = frames.next_if(|frame| frame.stamp <= sample.stamp) {
            used += vio.image(frame.stamp, &frame.view()).unwrap().used;
        }
    }
    (vio.output().unwrap().world_from_body, used)
}

#[test]
fn a_lens_of_the_callers_own_reads_the_same_images() {
    // ξ = 0 and α = 1/2 is the stereographic lens, r = 2 f tan(θ/2), whose series is that of an equidistant lens with these terms.
    let series = [1.0 / 12.0, 1.0 / 120.0, 17.0 / 20160.0, 31.0 / 362_880.0];
    let (f, centre) = (220.0, [187.5, 119.5]);
    let built_in = Camera {
        width: 376,
        height: 240,
        fx: f,
        fy: f,
        cx: centre[0],
        cy: centre[1],
        distortion: Distortion::Equidistant(series),
        ..camera_ahead()
    };
    let own = DoubleSphere {
        size: (376, 240),
        focal: [f; 2],
        centre,
        xi: 0.0,
        alpha: 0.5,
        body_from_camera: built_in.body_from_camera,
    };
    let scenario = Scenario {
        seed: 4,
        cameras: vec![SimulatedCamera { camera: built_in, ..SimulatedCamera::default() }],
        room: RoomSettings { texture_size: 512, ..RoomSettings::default() },
        ..Scenario::default()
    };
    let simulation = Simulation::new(painting_flight(2, 4.0).unwrap(), scenario).unwrap();
    let [(a, used_a), (b, used_b)] = [on_images(&simulation, built_in), on_images(&simulation, own)];
    let truth = simulation.motion(simulation.spline().span().1).unwrap().world_from_body;
    let apart = (a.translation.vector - b.translation.vector).norm();
    let off = (truth.translation.vector - b.translation.vector).norm();
    eprintln!("{:.3} mm apart, {:.1} mm off, {used_a} and {used_b} landmarks used", 1e3 * apart, 1e3 * off);
    assert!(used_b > 800, "{used_b} landmarks used");
    assert!(apart < 1e-3 && off < 0.05, "{apart} {off}");
}

/// A lens whose answers make no sense is refused when the filter is made.
#[test]
fn lenses_that_cannot_be_are_refused() {
    let refused = |lens: DoubleSphere| Vio::new(lens, ImuNoise::default(), Settings::default()).err();
    assert!(refused(tum_vi()).is_none());
    let named = |error: Option<Error>, expected: &str| match error {
        Some(Error::InvalidSetting { name, .. }) => assert_eq!(name, expected),
        other => panic!("{other:?}"),
    };
    named(refused(DoubleSphere { size: (0, 512), ..tum_vi() }), "width");
    named(refused(DoubleSphere { focal: [f64::NAN; 2], ..tum_vi() }), "focal_length");
    let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(matches!(
        refused(DoubleSphere { body_from_camera: nowhere, ..tum_vi() }),
        Some(Error::NonFinite { what: "body_from_camera", .. })
    ));
}
