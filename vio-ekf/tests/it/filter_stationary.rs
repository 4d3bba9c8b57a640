//! A body that stands before it flies, seen by a tracker of points.

use crate::support::flight::{Flight, nees, spline};
use nalgebra::{Isometry3, Vector3};
use vio_ekf::filter::DynamicInitializationSettings;
use vio_ekf::inertial::InitialSigma;
use vio_ekf::trajectory::Spline;
use vio_ekf::{Settings, Stamp, Status, Vio, nalgebra};

/// Seconds of rest.
const REST: usize = 15;

/// A flight along other poses, 0.1 s apart.
fn along(seed: u64, seconds: usize, pose: impl Fn(f64) -> Isometry3<f64>) -> Flight {
    let mut flight = Flight::new(seed, 4.0);
    let knots = (0..seconds * 10 + 4).map(|k| pose(k as f64 * 0.1));
    flight.spline = Spline::new(flight.first(), 100_000_000, knots.collect()).unwrap();
    flight
}

/// Stands, sets off within two seconds, and flies.
fn standing(seed: u64, seconds: usize) -> Flight {
    let moving = spline(seed, seconds as f64);
    let first = moving.span().0;
    along(seed, seconds, |t| {
        // Its clock stands, then runs, smoothly.
        let since = (t - REST as f64).max(0.0);
        let time = if since < 2.0 { since * since / 4.0 } else { since - 1.0 };
        moving.sample(Stamp::from_nanos(first.nanos() + (time * 1e9) as i64)).unwrap().world_from_body
    })
}

/// Squared errors of position, attitude and velocity in units of the claim, 3 if that is right: means over twelve flights.
/// Half a pixel of motion is far below the noise of a point, so the take-off is noticed late.
#[test]
fn a_rest_on_points_and_the_take_off_after_it() {
    let (seconds, runs) = (REST + 10, 12);
    let mut sums = vec![[0.0; 5]; seconds];
    let mut farthest = 0.0_f64;
    for seed in 1..=runs {
        let mut flight = standing(seed, seconds);
        let start = flight.drawn_start(InitialSigma::default());
        let first = flight.first();
        let each = |odometry: &vio_ekf::Odometry, truth: &vio_ekf::trajectory::Motion, biases: &[Vector3<f64>; 2]| {
            let second = (odometry.stamp.secs_since(first) as usize).min(seconds - 1);
            let squares = nees(odometry, truth, biases);
            (0..5).for_each(|k| sums[second][k] += squares[k] / (20 * runs) as f64);
            if (2..REST).contains(&second) {
                let error = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
                farthest = farthest.max(error.norm());
            }
        };
        flight.run(&Settings::default(), &start, each).unwrap();
    }
    for (second, row) in sums.iter().enumerate() {
        eprintln!("{second:2} s: {row:5.2?}");
    }
    eprintln!("{:.1} mm at most while it stands", 1000.0 * farthest);
    for (second, row) in sums.iter().enumerate() {
        assert!(row[..3].iter().all(|square| *square < 5.5), "{second} s: {row:.2?}");
    }
    let mean = |k: usize| sums[REST..].iter().map(|row| row[k]).sum::<f64>() / (seconds - REST) as f64;
    let after = [mean(0), mean(1), mean(2)];
    assert!(after.iter().all(|square| (1.0..4.2).contains(square)), "{after:.2?}");
}

/// With pixels of noise, the filter starts by itself from a rest, and from nothing that only feels like one.
#[test]
fn starts_from_a_rest_of_points() {
    let wait = |pose: &dyn Fn(f64) -> Isometry3<f64>, moved: f64| {
        let mut flight = along(3, 4, pose);
        let dynamic_initialization =
            DynamicInitializationSettings { enabled: false, ..DynamicInitializationSettings::default() };
        let mut vio =
            Vio::new(flight.camera, flight.noise, Settings { dynamic_initialization, ..Settings::default() }).unwrap();
        for (k, stamp) in flight.stamps().enumerate() {
            vio.imu(&flight.imu(stamp)).unwrap();
            if k % 10 == 0 {
                let mut seen = flight.see(stamp);
                // A third of what is seen is a thing that moves by itself.
                seen.iter_mut().step_by(3).for_each(|point| point.pixel.x += moved * k as f64 * 0.05);
                vio.points(stamp, &seen).unwrap();
            }
        }
        (vio.status(), vio.output())
    };
    let still = |_: f64| Isometry3::translation(0.3, 0.2, 0.1);
    for moved in [0.0, 6.0] {
        let (status, output) = wait(&still, moved);
        assert_eq!(status, Status::Tracking);
        let output = output.unwrap();
        let velocity = output.velocity_in_body.norm();
        let moved = output.world_from_body.translation.vector.norm();
        assert!(velocity < 0.03 && moved < 0.02, "{velocity} m/s, {moved} m");
    }
    // Constant velocity feels like rest to the inertial sensor: sideways, ahead, and about the axis of the camera.
    let turn = |t: f64| Isometry3::rotation(Vector3::new(0.04 * t, 0.0, 0.0));
    let motions: [&dyn Fn(f64) -> Isometry3<f64>; 3] =
        [&|t| Isometry3::translation(0.3, 0.06 * t, 0.1), &|t| Isometry3::translation(0.06 * t, 0.2, 0.1), &turn];
    for (k, motion) in motions.iter().enumerate() {
        let (status, _) = wait(motion, 0.0);
        assert!(matches!(status, Status::Uninitialised(_)), "motion {k}: {status:?}");
    }
}
