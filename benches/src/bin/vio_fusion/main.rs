//! One estimator or two: the same flights through a cascade (odometry on one inertial sensor, its poses into a second filter
//! with the autopilot's) and through one filter that takes everything. Prints a Markdown table.

mod arguments;
mod estimator;

use std::error::Error;
use std::process::ExitCode;

use arguments::Arguments;
use estimator::{Estimator, Way};
use nalgebra::{Isometry3, Matrix3, Vector3};
use paintcopter::exit::run_program;
use paintcopter_benches::flight::{Flight, MapErrors, sway};
use vio_ekf::lie::so3;
use vio_ekf::{Odometry, nalgebra};

type AnyError = Box<dyn Error>;

fn main() -> ExitCode {
    run_program("vio_fusion", run)
}

/// What is compared.
const WAYS: [(&str, Way); 8] = [
    ("odometry: camera, IMU 1", Way::Odometry),
    ("fusion: IMU 2, map", Way::MapOnly),
    ("cascade: odometry as absolute poses, IMU 2", Way::Cascade { map: false, drifts: false }),
    ("cascade: odometry that drifts, IMU 2", Way::Cascade { map: false, drifts: true }),
    ("cascade: odometry that drifts, IMU 2, map", Way::Cascade { map: true, drifts: true }),
    ("one filter: camera, IMU 1, IMU 2", Way::Unified { second: true, map: false }),
    ("one filter: camera, IMU 1, map", Way::Unified { second: false, map: true }),
    ("one filter: camera, IMU 1, IMU 2, map", Way::Unified { second: true, map: true }),
];
/// Pairs of the above: with the same knowledge, and the two as they are built.
const AGAINST: [(&str, usize, usize); 3] = [
    ("camera and both IMUs in both", 5, 3),
    ("camera, both IMUs and map in both", 7, 4),
    ("the whole filter, and the cascade without map", 7, 3),
];

/// Squares of errors over all outputs, and in units of the claimed covariance: position, velocity, attitude.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    squares: [f64; 3],
    nees: [f64; 3],
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let map = MapErrors { delay_s: arguments.delay, ..MapErrors::default() };
    let mut sums = [Sums::default(); WAYS.len()];
    for seed in arguments.first_seed..arguments.first_seed + arguments.flights {
        let flight = Flight::record(sway(seed, arguments.seconds)?, seed, arguments.coarse, &map)?;
        for (sums, (_, way)) in sums.iter_mut().zip(&WAYS) {
            let mut estimator = Estimator::new(*way, &flight, arguments, seed)?;
            let begin = flight.spline.span().0;
            for arrival in &flight.arrivals {
                if let Some(odometry) = estimator.take(arrival)?
                    && odometry.stamp.secs_since(begin) >= arguments.settle
                {
                    sums.add(&odometry, &estimator.truth(&flight, &odometry)?);
                }
            }
        }
        eprintln!("flight {seed}");
    }
    println!("| estimator | position, mm | velocity, mm/s | attitude, deg | NEES position | velocity | attitude |");
    println!("|---|---|---|---|---|---|---|");
    for (sums, (name, _)) in sums.iter().zip(&WAYS) {
        let [p, v, a] = sums.rms();
        let [np, nv, na] = sums.nees.map(|n| n / sums.count);
        let (p, v, a) = (p * 1e3, v * 1e3, a.to_degrees());
        println!("| {name} | {p:.1} | {v:.1} | {a:.3} | {np:.1} | {nv:.1} | {na:.1} |");
    }
    println!("\n| one filter against the cascade | position | velocity | attitude |\n|---|---|---|---|");
    for (name, one, two) in AGAINST {
        let (one, two) = (sums[one].rms(), sums[two].rms());
        let [p, v, a]: [f64; 3] = std::array::from_fn(|k| 100.0 * (one[k] / two[k] - 1.0));
        println!("| {name} | {p:+.0} % | {v:+.0} % | {a:+.0} % |");
    }
    Ok(())
}

impl Sums {
    fn add(&mut self, odometry: &Odometry, truth: &(Isometry3<f64>, Vector3<f64>)) {
        let (pose, velocity) = truth;
        let estimate = &odometry.world_from_body;
        let errors = [
            pose.translation.vector - estimate.translation.vector,
            velocity - odometry.velocity_in_body,
            so3::log(&(pose.rotation * estimate.rotation.inverse())),
        ];
        self.count += 1.0;
        for (k, error) in errors.iter().enumerate() {
            let block: Matrix3<f64> = odometry.covariance.fixed_view::<3, 3>(3 * k, 3 * k).into_owned();
            self.squares[k] += error.norm_squared();
            // At the very start position and yaw are known exactly.
            self.nees[k] += block.cholesky().map_or(0.0, |factor| error.dot(&factor.solve(error)));
        }
    }

    fn rms(&self) -> [f64; 3] {
        self.squares.map(|sum| (sum / self.count).sqrt())
    }
}
