//! Sensors of a caller's own through `Vio::update`: a position fix, a barometer, a range to a beacon.

use crate::support::flight::{Flight, nees};
use vio_ekf::eval::chi2;
use vio_ekf::filter::{Measurement, Trial, error_state};
use vio_ekf::inertial::{InitialSigma, Linearization};
use vio_ekf::nalgebra::{Matrix1, Matrix1x3, Matrix3, Matrix3x6, Point3, Vector1, Vector3};
use vio_ekf::{Settings, Stamp, Vio};

/// Position of an antenna on the body, as of satellite navigation.
struct PositionFix {
    antenna_in_world: Point3<f64>,
    antenna_in_body: Vector3<f64>,
    sigma: f64,
}

impl Measurement<3, 6> for PositionFix {
    fn rows(&self) -> [usize; 6] {
        std::array::from_fn(|k| if k < 3 { error_state::POSITION + k } else { error_state::ATTITUDE + k - 3 })
    }

    fn linearize(&self, trial: &Trial<'_, 6>) -> Option<Linearization<3, 6>> {
        let core = trial.core();
        let lever = core.attitude * self.antenna_in_body;
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-lever.cross_matrix());
        let residual = self.antenna_in_world.coords - core.position - lever;
        Some(Linearization { residual, jacobian, noise: Matrix3::identity() * self.sigma.powi(2) })
    }

    fn name(&self) -> &'static str {
        "position fix"
    }
}

/// Height above the world's origin.
struct Barometer {
    height: f64,
    sigma: f64,
}

impl Measurement<1, 1> for Barometer {
    fn rows(&self) -> [usize; 1] {
        [error_state::POSITION + 2]
    }

    fn linearize(&self, trial: &Trial<'_, 1>) -> Option<Linearization<1, 1>> {
        Some(Linearization {
            residual: Vector1::new(self.height - trial.core().position.z),
            jacobian: Matrix1::new(1.0),
            noise: Matrix1::new(self.sigma.powi(2)),
        })
    }
}

/// Distance from a radio beacon.
struct Range {
    beacon: Point3<f64>,
    distance: f64,
    sigma: f64,
}

impl Measurement<1, 3> for Range {
    fn rows(&self) -> [usize; 3] {
        std::array::from_fn(|k| error_state::POSITION + k)
    }

    fn linearize(&self, trial: &Trial<'_, 3>) -> Option<Linearization<1, 3>> {
        let from_beacon = trial.core().position - self.beacon.coords;
        let distance = from_beacon.norm();
        // No direction at the beacon itself.
        (distance > 0.0).then(|| Linearization {
            residual: Vector1::new(self.distance - distance),
            jacobian: Matrix1x3::from(from_beacon.transpose() / distance),
            noise: Matrix1::new(self.sigma.powi(2)),
        })
    }

    /// A range bends over metres of uncertainty.
    fn max_iterations(&self) -> usize {
        10
    }
}

const ANTENNA: Vector3<f64> = Vector3::new(-0.3, 0.1, 0.4);
const SEEDS: u64 = 6;

/// What a flight ended with.
#[derive(Debug, Default)]
struct Outcome {
    /// Root mean square of the last two seconds' errors: along x and y, along z, m; of the heading, rad.
    horizontal: f64,
    vertical: f64,
    heading: f64,
    /// Mean normalised squared errors, of position and attitude.
    nees: [f64; 2],
    refused: usize,
}

/// Flights on points that do not know where they begin, with another sensor beside the camera.
fn fly(sigma: InitialSigma, mut sense: impl FnMut(&mut Vio, &mut Flight, Stamp) -> bool) -> Outcome {
    let (mut outcome, mut late, mut count) = (Outcome::default(), 0.0, 0.0);
    for seed in 1..=SEEDS {
        let mut flight = Flight::new(seed, 12.0);
        let start = flight.drawn_start(sigma);
        let mut vio = Vio::new(flight.camera, flight.noise, Settings::default()).unwrap();
        for (k, stamp) in flight.stamps().enumerate() {
            vio.imu(&flight.imu(stamp)).unwrap();
            if k == 0 {
                vio.initialize(&start).unwrap();
            } else if k % 10 == 0 && stamp < flight.spline.span().1 {
                let seen = flight.see(stamp);
                vio.points(stamp, &seen).unwrap();
                if k % 40 == 0 {
                    outcome.refused += usize::from(!sense(&mut vio, &mut flight, stamp));
                }
                let (odometry, truth) = (vio.output().unwrap(), flight.truth(stamp));
                let of_state = nees(&odometry, &truth, &flight.biases);
                outcome.nees[0] += of_state[0];
                outcome.nees[1] += of_state[1];
                count += 1.0;
                if k > 2000 {
                    let error = truth.world_from_body.translation.vector - odometry.world_from_body.translation.vector;
                    let turn = truth.world_from_body.rotation * odometry.world_from_body.rotation.inverse();
                    outcome.horizontal += error.xy().norm_squared();
                    outcome.vertical += error.z * error.z;
                    outcome.heading += turn.scaled_axis().z.powi(2);
                    late += 1.0;
                }
            }
        }
    }
    for sum in [&mut outcome.horizontal, &mut outcome.vertical, &mut outcome.heading] {
        *sum = (*sum / late).sqrt();
    }
    outcome.nees = outcome.nees.map(|sum| sum / count);
    eprintln!("{outcome:?}");
    outcome
}

/// Metres and a quarter of a radian: the start is known roughly.
fn lost() -> InitialSigma {
    InitialSigma { position: 2.0, yaw: 0.25, ..InitialSigma::default() }
}

fn position_fix(flight: &mut Flight, stamp: Stamp) -> PositionFix {
    let sigma = 0.1;
    let pose = flight.truth(stamp).world_from_body;
    let antenna_in_world = pose * Point3::from(ANTENNA) + flight.rng.normals() * sigma;
    PositionFix { antenna_in_world, antenna_in_body: ANTENNA, sigma }
}

fn range(flight: &mut Flight, stamp: Stamp, beacon: Point3<f64>) -> Range {
    let sigma = 0.05;
    let position = Point3::from(flight.truth(stamp).world_from_body.translation.vector);
    Range { beacon, distance: (position - beacon).norm() + flight.rng.normal() * sigma, sigma }
}

/// The mean of errors that hardly change within a flight: as many samples as flights.
fn consistent(mean: f64) -> bool {
    let (low, high) = chi2::mean_band(3, SEEDS as usize, 0.999).unwrap();
    (low..=high).contains(&mean)
}

#[test]
fn position_fixes_find_place_and_heading() {
    let without = fly(lost(), |_, _, _| true);
    let with = fly(lost(), |vio, flight, stamp| {
        let fix = position_fix(flight, stamp);
        vio.update(stamp, &fix).unwrap()
    });
    assert!(without.horizontal > 1.0 && without.heading > 0.1, "{without:?}");
    assert!(with.horizontal < 0.1 && with.vertical < 0.1 && with.heading < 0.05, "{with:?}");
    assert!(with.nees.into_iter().all(consistent), "{with:?}");
    // 99.9 % of 6 flights of 60 fixes.
    assert!(with.refused <= 3, "{with:?}");
}

#[test]
fn a_barometer_finds_the_height_and_nothing_else() {
    let sense = |vio: &mut Vio, flight: &mut Flight, stamp: Stamp| {
        let sigma = 0.2;
        let height = flight.truth(stamp).world_from_body.translation.z + flight.rng.normal() * sigma;
        let before = vio.output().unwrap();
        let used = vio.update(stamp, &Barometer { height, sigma }).unwrap();
        let after = vio.output().unwrap();
        // Height and heading are not correlated, so that the heading keeps its deviation.
        assert!((after.covariance[(8, 8)] - before.covariance[(8, 8)]).abs() < 1e-6);
        used
    };
    let (without, with) = (fly(lost(), |_, _, _| true), fly(lost(), sense));
    assert!(without.vertical > 0.5 && with.vertical < 0.1, "{without:?} {with:?}");
    assert!((with.horizontal / without.horizontal - 1.0).abs() < 0.1, "{without:?} {with:?}");
    assert!(with.nees.into_iter().all(consistent) && with.refused <= 3, "{with:?}");
}

#[test]
fn ranges_to_beacons_find_the_place() {
    let beacons = [[6.0, 5.0, 2.0], [-7.0, 4.0, -1.0], [1.0, -8.0, 3.0], [0.0, 1.0, 9.0]].map(Point3::from);
    // A range is curved: by 2 cm over half a metre of uncertainty, by more than its noise over two.
    let start = InitialSigma { position: 0.5, ..lost() };
    let with = fly(start, |vio, flight, stamp| {
        beacons.iter().fold(true, |all, &beacon| {
            let measured = range(flight, stamp, beacon);
            vio.update(stamp, &measured).unwrap() && all
        })
    });
    assert!(with.horizontal < 0.08 && with.vertical < 0.08 && with.heading < 0.05, "{with:?}");
    // One in a hundred: a few more than the gate's share fail while the start is still bent.
    assert!(with.nees.into_iter().all(consistent) && with.refused <= 14, "{with:?}");
}

#[test]
fn outliers_of_any_sensor_change_nothing() {
    let mut count = 0;
    let outcome = fly(InitialSigma { position: 0.05, ..InitialSigma::default() }, |vio, flight, stamp| {
        let before = vio.output();
        let mut fix = position_fix(flight, stamp);
        fix.antenna_in_world.x += 3.0;
        let mut far = range(flight, stamp, Point3::new(6.0, 5.0, 2.0));
        far.distance += 3.0;
        let height = flight.truth(stamp).world_from_body.translation.z - 3.0;
        assert!(!vio.update(stamp, &fix).unwrap());
        assert!(!vio.update(stamp, &far).unwrap());
        assert!(!vio.update(stamp, &Barometer { height, sigma: 0.2 }).unwrap());
        // Not a bit.
        assert_eq!(vio.output(), before);
        count += 1;
        true
    });
    assert!(count > 100 && outcome.horizontal < 0.2, "{count} {outcome:?}");
}
