//! Every derivative of the filter against central differences of the nominal model.

use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, SVector, Unit, UnitQuaternion, Vector2, Vector3};

use super::bearing::Bearing;
use super::bends::LASTS;
use super::covariance::{Covariance, Measurement};
use super::distance::InverseDistance;
use super::interval::Interval;
use super::points::project;
use super::propagate::{Workspace, propagate};
use super::state::{Landmark, State, at};
use crate::{Camera, ImuNoise, so3};

const GRAVITY: f64 = 9.81;

/// splitmix64 (Steele, Lea, Flood 2014).
struct Rng(u64);

impl Rng {
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.signed())
    }
}

fn state(rng: &mut Rng, landmarks: usize) -> State {
    State {
        position: rng.vector() * 5.0,
        velocity: rng.vector() * 2.0,
        attitude: so3::exp(&(rng.vector() * 2.0)),
        gyro_bias: rng.vector() * 0.05,
        accel_bias: rng.vector() * 0.3,
        camera_position: rng.vector() * 0.2,
        camera_attitude: so3::exp(&(rng.vector() * 2.0)),
        time_offset: 0.01,
        expected: InverseDistance::new(0.3),
        landmarks: (0..landmarks)
            .map(|_| Landmark {
                bearing: Bearing::new(&Unit::new_normalize(Vector3::new(rng.signed(), rng.signed(), 1.0))),
                inverse_distance: InverseDistance::new(0.3 + 0.2 * rng.signed()),
                warp: Matrix2::identity(),
            })
            .collect(),
    }
}

/// Rates and forces of some steps of 5 ms, as read by the sensor.
fn readings(rng: &mut Rng, count: usize) -> Vec<[Vector3<f64>; 2]> {
    (0..count).map(|_| [rng.vector() * 2.0, rng.vector() * 3.0 + Vector3::z() * 9.81]).collect()
}

fn integrate(readings: &[[Vector3<f64>; 2]], state: &State, noise: &ImuNoise) -> Interval {
    let mut interval = Interval::default();
    for [gyro, accel] in readings {
        interval.extend(&(gyro - state.gyro_bias), &(accel - state.accel_bias), 0.005, noise);
    }
    interval
}

/// The nominal model of a whole interval, without any covariance.
fn model(readings: &[[Vector3<f64>; 2]], state: &State) -> State {
    let interval = integrate(readings, state, &ImuNoise::ZERO);
    let mut end = state.clone();
    let capacity = at::landmark(state.landmarks.len());
    let mut covariance = Covariance::new(capacity, capacity);
    propagate(&mut end, &mut covariance, (&interval, GRAVITY), &mut Workspace::new(capacity), |_| {
        panic!("a landmark was lost")
    });
    end
}

/// `a ⊟ b` in the filter's error coordinates.
fn difference(a: &State, b: &State) -> DVector<f64> {
    let mut d = DVector::zeros(at::landmark(a.landmarks.len()));
    let turn = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>| so3::log(&(a * b.inverse()));
    d.fixed_rows_mut::<3>(at::POSITION).copy_from(&(a.position - b.position));
    d.fixed_rows_mut::<3>(at::VELOCITY).copy_from(&(a.velocity - b.velocity));
    d.fixed_rows_mut::<3>(at::ATTITUDE).copy_from(&turn(&a.attitude, &b.attitude));
    d.fixed_rows_mut::<3>(at::GYRO_BIAS).copy_from(&(a.gyro_bias - b.gyro_bias));
    d.fixed_rows_mut::<3>(at::ACCEL_BIAS).copy_from(&(a.accel_bias - b.accel_bias));
    d.fixed_rows_mut::<3>(at::CAMERA_POSITION).copy_from(&(a.camera_position - b.camera_position));
    d.fixed_rows_mut::<3>(at::CAMERA_ATTITUDE).copy_from(&turn(&a.camera_attitude, &b.camera_attitude));
    d[at::TIME_OFFSET] = a.time_offset - b.time_offset;
    d[at::EXPECTED] = a.expected.value - b.expected.value;
    for (slot, (a, b)) in a.landmarks.iter().zip(&b.landmarks).enumerate() {
        d.fixed_rows_mut::<2>(at::landmark(slot)).copy_from(&a.bearing.boxminus(&b.bearing));
        d[at::landmark(slot) + 2] = a.inverse_distance.value - b.inverse_distance.value;
    }
    d
}

/// The transition `F` by central differences.
fn transition(readings: &[[Vector3<f64>; 2]], state: &State) -> DMatrix<f64> {
    let (n, h) = (at::landmark(state.landmarks.len()), 1e-5);
    let middle = model(readings, state);
    let mut f = DMatrix::zeros(n, n);
    for column in 0..n {
        let moved = [h, -h].map(|h| {
            let mut state = state.clone();
            // Corrections of an inverse distance agree with sums only to first order.
            let further = |distance: &mut InverseDistance| *distance = InverseDistance::new(distance.value + h);
            if column == at::EXPECTED {
                further(&mut state.expected);
            } else if column >= at::HEAD && (column - at::HEAD) % at::LANDMARK == 2 {
                further(&mut state.landmarks[(column - at::HEAD) / at::LANDMARK].inverse_distance);
            } else {
                let mut delta = vec![0.0; n];
                delta[column] = h;
                state.correct(&delta);
            }
            difference(&model(readings, &state), &middle)
        });
        f.set_column(column, &((&moved[0] - &moved[1]) / (2.0 * h)));
    }
    f
}

fn random_covariance(rng: &mut Rng, n: usize) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |_, _| rng.signed());
    &a * a.transpose()
}

fn filled(matrix: &DMatrix<f64>) -> Covariance {
    let n = matrix.nrows();
    let mut covariance = Covariance::new(n, n);
    for row in 0..n {
        for column in 0..n {
            covariance.row_mut(row)[column] = matrix[(row, column)];
        }
    }
    covariance
}

fn dense(covariance: &Covariance) -> DMatrix<f64> {
    DMatrix::from_fn(covariance.size(), covariance.size(), |r, c| covariance.row(r)[c])
}

const SMALL: f64 = 1e-13;

#[test]
fn covariance_moves_with_the_transition_of_the_whole_state() {
    let mut rng = Rng(1);
    for _ in 0..5 {
        let (state, readings) = (state(&mut rng, 4), readings(&mut rng, 10));
        let f = transition(&readings, &state);
        // Small, so that the products of errors, which are quadratic in it, do not show.
        let prior = random_covariance(&mut rng, f.nrows()) * SMALL;
        let mut covariance = filled(&prior);
        let mut end = state.clone();
        let interval = integrate(&readings, &state, &ImuNoise::ZERO);
        propagate(&mut end, &mut covariance, (&interval, GRAVITY), &mut Workspace::new(f.nrows()), |_| panic!("lost"));
        let error = dense(&covariance) - &f * &prior * f.transpose();
        // The bias columns drop terms of the order of rate · dt · dt / 12 per step.
        assert!(error.amax() < 2e-4 * SMALL, "{}", error.amax());
        // Without bias errors nothing is dropped: only the truncation of the differences is left.
        let mut exact = prior.clone();
        for k in at::GYRO_BIAS..at::CORE {
            exact.row_mut(k).fill(0.0);
            exact.column_mut(k).fill(0.0);
        }
        let mut covariance = filled(&exact);
        propagate(&mut state.clone(), &mut covariance, (&interval, GRAVITY), &mut Workspace::new(f.nrows()), |_| {
            panic!("lost")
        });
        let error = dense(&covariance) - &f * &exact * f.transpose();
        assert!(error.amax() < 1e-7 * SMALL, "{}", error.amax());
    }
}

#[test]
fn noise_is_the_sum_over_the_samples() {
    // N = Σ over samples of the response to a disturbance of that sample: white noise of the sample itself, and a step
    // of the bias that all later samples see.
    let mut rng = Rng(2);
    let (state, readings) = (state(&mut rng, 3), readings(&mut rng, 12));
    let noise = ImuNoise { gyro_density: 0.01, gyro_walk: 0.02, accel_density: 0.03, accel_walk: 0.5 };
    let n = at::landmark(3);
    let mut expected = DMatrix::<f64>::zeros(n, n);
    let (h, dt) = (1e-4, 0.005);
    for first in 0..readings.len() {
        for axis in 0..6 {
            for walking in [false, true] {
                let moved = [h, -h].map(|h| {
                    let mut disturbed = readings.clone();
                    // A walk of the bias during a step acts from the next one on.
                    let range = if walking { first + 1..readings.len() } else { first..first + 1 };
                    for reading in &mut disturbed[range] {
                        reading[axis / 3][axis % 3] += h;
                    }
                    let mut end = model(&disturbed, &state);
                    if walking {
                        let bias = if axis < 3 { &mut end.gyro_bias } else { &mut end.accel_bias };
                        // The reading that is higher by h than assumed means a motion that is lower by h: a bias of −h
                        // undetected. The signs cancel between bias and motion only if both are told.
                        bias[axis % 3] -= h;
                    }
                    end
                });
                let response = difference(&moved[0], &moved[1]) / (2.0 * h);
                let (white, walk) = if axis < 3 {
                    (noise.gyro_density, noise.gyro_walk)
                } else {
                    (noise.accel_density, noise.accel_walk)
                };
                let variance = if walking { walk * walk * dt } else { white * white / dt };
                expected += &response * response.transpose() * variance;
            }
        }
    }
    let mut covariance = Covariance::new(n, n);
    let interval = integrate(&readings, &state, &noise);
    propagate(&mut state.clone(), &mut covariance, (&interval, GRAVITY), &mut Workspace::new(n), |_| panic!("lost"));
    let ours = dense(&covariance);
    for row in 0..n {
        for column in 0..n {
            let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let error = (ours[(row, column)] - expected[(row, column)]).abs();
            // Differences of a constant are not exactly zero.
            assert!(error <= 2e-3 * scale + 1e-13, "({row}, {column}): {error} of {scale}");
        }
    }
}

#[test]
fn position_and_yaw_never_reach_what_the_camera_sees() {
    // Shifting the world and turning it about the vertical moves no landmark, at any state: the four columns of the
    // transition stay in the span of the same four directions.
    let mut rng = Rng(3);
    for _ in 0..20 {
        let (state, readings) = (state(&mut rng, 3), readings(&mut rng, 10));
        let n = at::landmark(3);
        for direction in 0..4 {
            let row = [at::POSITION, at::POSITION + 1, at::POSITION + 2, at::ATTITUDE + 2][direction];
            let mut prior = DMatrix::zeros(n, n);
            prior[(row, row)] = 1.0;
            let mut covariance = filled(&prior);
            let interval = integrate(&readings, &state, &ImuNoise::ZERO);
            propagate(&mut state.clone(), &mut covariance, (&interval, GRAVITY), &mut Workspace::new(n), |_| {
                panic!("lost")
            });
            for k in (at::VELOCITY..n).filter(|&k| k != at::ATTITUDE + 2) {
                assert!(covariance.variance(k) == 0.0, "row {k} depends on gauge direction {direction}");
            }
            assert!((covariance.variance(row) - 1.0).abs() < 1e-15);
        }
    }
}

#[test]
fn bearing_coordinates() {
    let mut rng = Rng(4);
    // Reference value, computed by hand: Exp((0.1, −0.2, 0)) e_z.
    let tilted = Bearing::new(&Vector3::z_axis()).boxplus(&Vector2::new(0.1, -0.2));
    let expected = Vector3::new(-0.198337495, -0.099168748, 0.975103993);
    assert!((tilted.direction() - expected).amax() < 1e-9);
    for _ in 0..200 {
        let bearing = Bearing::new(&Unit::new_normalize(rng.vector()));
        let d = Vector2::new(rng.signed(), rng.signed());
        assert!((bearing.boxplus(&d).boxminus(&bearing) - d).norm() < 1e-12);
        let basis = bearing.basis();
        assert!((basis.transpose() * basis - Matrix2::identity()).amax() < 1e-14);
        assert!((basis.transpose() * bearing.direction()).amax() < 1e-14);
        let h = 1e-6;
        for k in 0..2 {
            let mut step = Vector2::zeros();
            step[k] = h;
            let slope = (bearing.boxplus(&step).direction() - bearing.boxplus(&-step).direction()) / (2.0 * h);
            assert!((slope - bearing.differential().column(k)).amax() < 1e-9);
            assert!((bearing.coordinates() * slope - step / h).amax() < 1e-9);
        }
    }
    let down = Bearing::new(&-Vector3::z_axis());
    assert!((down.boxminus(&Bearing::new(&Vector3::z_axis())).norm() - std::f64::consts::PI).abs() < 1e-12);
}

#[test]
fn pixels_move_with_the_bearing() {
    let (mut rng, camera) = (Rng(5), Camera::euroc());
    for _ in 0..200 {
        let pixel = Vector2::new(376.0 + 370.0 * rng.signed(), 240.0 + 235.0 * rng.signed());
        let bearing = Bearing::new(&camera.bearing(&pixel).unwrap());
        let (seen, jacobian) = project(&camera, &bearing).unwrap();
        assert!((seen - pixel).amax() < 1e-9);
        for k in 0..2 {
            let h = 1e-6;
            let mut step = Vector2::zeros();
            step[k] = h;
            let [a, b] = [step, -step].map(|s| project(&camera, &bearing.boxplus(&s)).unwrap().0);
            assert!(((a - b) / (2.0 * h) - jacobian.column(k)).amax() < 1e-4);
        }
    }
}

#[test]
fn update_is_the_textbook_one() {
    let mut rng = Rng(6);
    let n = 31;
    let prior = random_covariance(&mut rng, n);
    let rows = [4, 22, 30];
    let jacobian = SMatrix::<f64, 2, 3>::from_fn(|_, _| rng.signed());
    let residual = Vector2::new(0.3, -0.7);
    let noise = Matrix2::new(0.5, 0.1, 0.1, 0.4);
    let mut h = DMatrix::zeros(2, n);
    for (c, &row) in rows.iter().enumerate() {
        h.set_column(row, &jacobian.column(c));
    }
    let s = &h * &prior * h.transpose() + DMatrix::from_fn(2, 2, |r, c| noise[(r, c)]);
    let gain = &prior * h.transpose() * s.try_inverse().unwrap();
    let expected = (DMatrix::identity(n, n) - &gain * &h) * &prior;
    let correction = &gain * DVector::from_column_slice(residual.as_slice());

    let mut covariance = filled(&prior);
    let (mut delta, mut scratch) = (vec![0.0; n], vec![0.0; 2 * n]);
    assert!(covariance.update(&Measurement { rows, residual, jacobian, noise }, &mut delta, &mut scratch));
    assert!((dense(&covariance) - expected).amax() < 1e-11);
    assert!((DVector::from_vec(delta) - correction).amax() < 1e-12);
    assert_eq!(dense(&covariance), dense(&covariance).transpose());
}

#[test]
fn rows_leave_and_arrive_without_disturbing_the_others() {
    let mut rng = Rng(7);
    let prior = random_covariance(&mut rng, 12);
    let mut covariance = Covariance::new(12, 15);
    for row in 0..12 {
        for column in 0..12 {
            covariance.row_mut(row)[column] = prior[(row, column)];
        }
    }
    covariance.swap_remove(3, 3);
    // Rows 9..12 have taken the place of 3..6.
    let order = [0, 1, 2, 9, 10, 11, 6, 7, 8];
    for (row, &from) in order.iter().enumerate() {
        for (column, &other) in order.iter().enumerate() {
            assert_eq!(covariance.row(row)[column], prior[(from, other)]);
        }
    }
    covariance.grow(3);
    assert!(covariance.row(2)[9..].iter().chain(covariance.row(10)).all(|&v| v == 0.0));
    covariance.inflate(9, 2.0);
    covariance.add_row(9, 0.5, 1);
    assert!((covariance.variance(9) - (2.0 + 0.25 * prior[(1, 1)])).abs() < 1e-12);
    assert!(
        (covariance.row(9)[4] - 0.5 * prior[(1, 10)]).abs() < 1e-12 && covariance.row(9)[4] == covariance.row(4)[9]
    );
}

#[test]
fn products_of_errors_are_accounted_for() {
    // Two landmarks whose distances are hardly known, and wrong together, seen from a camera whose velocity is hardly known, and wrong
    // in a way that has to do with the distances: mean and spread of the bearings by drawing states and moving them.
    let mut rng = Rng(8);
    let mut state = state(&mut rng, 2);
    (state.velocity, state.camera_attitude) = (Vector3::new(0.4, -0.3, 0.5), UnitQuaternion::identity());
    state.landmarks.iter_mut().for_each(|landmark| landmark.inverse_distance = InverseDistance::new(0.6));
    let readings = readings(&mut rng, 10);
    let n = at::landmark(2);
    let rows = [at::VELOCITY, at::VELOCITY + 1, at::VELOCITY + 2, at::landmark(0) + 2, at::landmark(1) + 2];
    // Each error by five independent ones.
    let mix = SMatrix::<f64, 5, 5>::new(
        0.5, 0.0, 0.0, 0.0, 0.0, //
        0.0, 0.6, 0.0, 0.0, 0.0, //
        0.0, 0.0, 0.5, 0.0, 0.0, //
        -0.05, 0.05, -0.06, 0.09, 0.0, //
        -0.05, 0.05, -0.06, 0.06, 0.06,
    );
    let mut prior = DMatrix::zeros(n, n);
    let among = mix * mix.transpose();
    for r in 0..5 {
        for c in 0..5 {
            prior[(rows[r], rows[c])] = among[(r, c)];
        }
    }
    let bearings = |d: &DVector<f64>| {
        let [a, b] = [at::landmark(0), at::landmark(1)];
        SVector::<f64, 4>::new(d[a], d[a + 1], d[b], d[b + 1])
    };
    let mut normal = || (0..12).map(|_| rng.signed()).sum::<f64>() / 2.0;
    let middle = model(&readings, &state);
    let count = 40_000;
    let (mut mean, mut square) = (SVector::<f64, 4>::zeros(), SMatrix::<f64, 4, 4>::zeros());
    for _ in 0..count {
        let drawn = mix * SVector::<f64, 5>::from_fn(|_, _| normal());
        let mut delta = vec![0.0; n];
        (0..5).for_each(|k| delta[rows[k]] = drawn[k]);
        let mut moved = state.clone();
        moved.correct(&delta);
        let d = bearings(&difference(&model(&readings, &moved), &middle));
        mean += d / f64::from(count);
        square += d * d.transpose() / f64::from(count);
    }
    let spread = square - mean * mean.transpose();

    let mut covariance = filled(&prior);
    let interval = integrate(&readings, &state, &ImuNoise::ZERO);
    let mut end = state.clone();
    propagate(&mut end, &mut covariance, (&interval, GRAVITY), &mut Workspace::new(n), |_| panic!("lost"));
    let f = transition(&readings, &state);
    let linear = &f * &prior * f.transpose();
    let block = |of: &dyn Fn(usize, usize) -> f64| {
        let at = |k: usize| at::landmark(k / 2) + k % 2;
        SMatrix::<f64, 4, 4>::from_fn(|r, c| of(at(r), at(c)))
    };
    let linear = block(&|r, c| linear[(r, c)]);
    // Counted for as many steps as it lasts; nothing is known here of the position.
    let products = (block(&|r, c| covariance.row(r)[c]) - linear) / (1.0 + 2.0 * LASTS / interval.duration);
    let expected = spread - linear;
    assert!(expected.norm() > 0.03 * linear.norm(), "{expected} {linear}");
    assert!((products - expected).norm() < 0.25 * expected.norm(), "{products} {expected}");
    let shift = bearings(&difference(&end, &middle));
    assert!((shift - mean).norm() < 0.2 * mean.norm(), "{shift} {mean}");
}
