//! An accelerometer whose scale and axes are off, on points.

use crate::support::flight::{Flight, nees};
use vio_ekf::inertial::{AccelMatrixEstimation, ImuSettings, InitialSigma};
use vio_ekf::nalgebra::Matrix3;
use vio_ekf::{Settings, Vio};

/// What the accelerometer reads of the specific force: up to 5 % and a degree off.
const READS: [[f64; 3]; 3] = [[1.05, 0.012, -0.006], [-0.008, 0.96, 0.015], [0.01, -0.004, 1.03]];

struct Outcome {
    /// Root mean square over the flights, m, and mean squared errors of position and velocity.
    position: f64,
    nees: [f64; 2],
    /// Largest error of an entry of the matrix, and in its own deviations.
    matrix: f64,
    deviations: f64,
    /// Flights at whose end the matrix is estimated.
    estimated: usize,
}

fn fly(reads: &Matrix3<f64>, settings: &Settings) -> Outcome {
    let mut outcome = Outcome { position: 0.0, nees: [0.0; 2], matrix: 0.0, deviations: 0.0, estimated: 0 };
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 1..=4 {
        let mut flight = Flight::new(seed, 20.0);
        let start = flight.drawn_start(InitialSigma::default());
        let mut vio = Vio::new(flight.camera, flight.noise, *settings).unwrap();
        for (k, stamp) in flight.stamps().enumerate() {
            let sample = flight.imu(stamp);
            vio.imu(&vio_ekf::Imu { accel: reads * sample.accel, ..sample }).unwrap();
            if k == 0 {
                vio.initialize(&start).unwrap();
            } else if k % 10 == 0 && stamp < flight.spline.span().1 {
                let seen = flight.see(stamp);
                vio.points(stamp, &seen).unwrap();
                let (odometry, truth) = (vio.output().unwrap(), flight.truth(stamp));
                let error = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
                squares += error.norm_squared();
                let now = nees(&odometry, &truth, &flight.biases);
                outcome.nees[0] += now[0];
                outcome.nees[1] += now[2];
                count += 1.0;
            }
        }
        let found = vio.calibration().unwrap();
        outcome.estimated += usize::from(found.accel_matrix_sigma[(0, 0)] > 0.0);
        let error = found.accel_matrix - reads.try_inverse().unwrap();
        outcome.matrix = outcome.matrix.max(error.amax());
        outcome.deviations = outcome.deviations.max(error.component_div(&found.accel_matrix_sigma).amax());
    }
    outcome.position = (squares / count).sqrt();
    outcome.nees = outcome.nees.map(|sum| sum / count);
    eprintln!(
        "{:.1} mm, NEES {:.1?}, matrix {:.4}, {:.1} deviations",
        1e3 * outcome.position,
        outcome.nees,
        outcome.matrix,
        outcome.deviations
    );
    outcome
}

#[test]
fn the_matrix_of_the_accelerometer_is_found() {
    let reads = Matrix3::from_fn(|r, c| READS[r][c]);
    let imu = ImuSettings { accel_matrix: AccelMatrixEstimation::Always, ..ImuSettings::default() };
    let estimated = Settings { imu, ..Settings::default() };
    let exact = fly(&Matrix3::identity(), &Settings::default());
    let never = ImuSettings { accel_matrix: AccelMatrixEstimation::Never, ..ImuSettings::default() };
    let believed = fly(&reads, &Settings { imu: never, ..Settings::default() });
    let found = fly(&reads, &estimated);
    assert!(believed.position > 3.0 * exact.position && believed.nees[0] > 30.0, "what is estimated must matter");
    assert!(found.position < 1.5 * exact.position, "{} m, {} m", found.position, exact.position);
    assert!(found.nees.iter().all(|mean| *mean < 4.0), "{:?}", found.nees);
    assert!(found.matrix < 0.02 && found.deviations < 4.0, "{} {}", found.matrix, found.deviations);
}

/// The default finds out by itself: a sensor that is off is estimated, and one that is not costs nothing.
#[test]
fn the_matrix_is_estimated_when_it_is_needed() {
    let reads = Matrix3::from_fn(|r, c| READS[r][c]);
    let never = ImuSettings { accel_matrix: AccelMatrixEstimation::Never, ..ImuSettings::default() };
    let known = fly(&Matrix3::identity(), &Settings { imu: never, ..Settings::default() });
    let exact = fly(&Matrix3::identity(), &Settings::default());
    let found = fly(&reads, &Settings::default());
    assert_eq!(known.estimated, 0);
    // By the end of 20 s the trial of a calibrated sensor is over, and that of the other one is not.
    assert_eq!((exact.estimated, found.estimated), (0, 4));
    assert!(exact.position < 1.05 * known.position, "{} m, {} m", exact.position, known.position);
    assert!(found.position < 2.0 * exact.position, "{} m, {} m", found.position, exact.position);
}
