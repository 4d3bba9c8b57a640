//! Every derivative of the pose model against central differences.

use nalgebra::{Isometry3, Matrix6, SVector, Vector3, Vector6};

use super::pose_measurement::PoseMeasurement;
use super::pose_model::{LOCAL, SourceState, linearize, predict, trial};
use crate::inertial::core_state::CoreState;
use crate::lie::so3;
use crate::samples::Imu;
use crate::sim::Rng;
use crate::stamp::Stamp;
use crate::test_random::{signed, vector};

fn state(rng: &mut Rng) -> (CoreState, SourceState, Imu) {
    let core = CoreState {
        position: vector(rng) * 5.0,
        velocity: vector(rng) * 2.0,
        attitude: so3::exp(&(vector(rng) * 2.0)),
        gyro_bias: vector(rng) * 0.05,
        accel_bias: vector(rng) * 0.3,
    };
    let frame = SourceState {
        alignment: (vector(rng) * 3.0, so3::exp(&(vector(rng) * 2.0))),
        sensor: (vector(rng) * 0.3, so3::exp(&(vector(rng) * 2.0))),
        scale: 1.3 + 0.5 * signed(rng),
        time_offset_error: 0.03 * signed(rng),
    };
    let reading = Imu { stamp: Stamp::default(), gyro: vector(rng) * 2.0, accel: vector(rng) * 12.0 };
    (core, frame, reading)
}

#[test]
fn the_derivative_of_a_pose_is_that_of_its_residual() {
    let mut rng = Rng::new(4);
    for _ in 0..20 {
        let (core, frame, reading) = state(&mut rng);
        // Not the pose that is predicted: the derivative must hold away from a zero residual, too.
        let at = predict(&core, &frame, &reading, 9.81);
        let pose = Isometry3::from_parts(
            (at.position + vector(&mut rng)).into(),
            so3::exp(&(vector(&mut rng) * 0.7)) * at.attitude,
        );
        let root = Matrix6::from_fn(|_, _| signed(&mut rng));
        let information = root.transpose() * root;
        let measured = PoseMeasurement { source: 0, stamp: Stamp::default(), source_from_sensor: pose, information };
        let whitener = measured.whitener().unwrap();
        assert!((whitener.transpose() * whitener - information).amax() < 1e-9 * information.amax());
        let look = |delta: &SVector<f64, LOCAL>| {
            let (core, frame) = trial(&core, &frame, delta);
            linearize(&predict(&core, &frame, &reading, 9.81), &measured, &whitener)
        };
        let analytic = look(&SVector::zeros()).jacobian;
        let h = 1e-5;
        for column in 0..LOCAL {
            let mut step = SVector::<f64, LOCAL>::zeros();
            step[column] = h;
            let difference: Vector6<f64> = (look(&step).residual - look(&-step).residual) / (2.0 * h);
            // The residual is measured minus predicted.
            let off = (difference + analytic.column(column)).amax();
            assert!(off < 1e-6 * (1.0 + analytic.amax()), "column {column}: {off}");
        }
    }
}

#[test]
fn the_offset_of_the_clock_moves_the_body_as_its_motion_does() {
    // Constant rate and force in body axes; the extrapolation against the motion integrated in small steps.
    let mut rng = Rng::new(9);
    for _ in 0..10 {
        let (core, mut frame, reading) = state(&mut rng);
        frame.time_offset_error = 0.02;
        let (mut position, mut attitude) = (core.position, core.attitude);
        let mut velocity = core.attitude * core.velocity;
        let (steps, count) = (2e-6, 10_000);
        for _ in 0..count {
            let acceleration = attitude * (reading.accel - core.accel_bias) - Vector3::z() * 9.81;
            position += velocity * steps + acceleration * (0.5 * steps * steps);
            velocity += acceleration * steps;
            attitude *= so3::exp(&((reading.gyro - core.gyro_bias) * steps));
        }
        let now = CoreState { position, attitude, velocity: attitude.inverse() * velocity, ..core };
        let exact = predict(&now, &SourceState { time_offset_error: 0.0, ..frame }, &reading, 9.81);
        let ours = predict(&core, &frame, &reading, 9.81);
        // What is left is of third order: |ω| |f| s³ / 6.
        assert!((exact.position - ours.position).norm() < 1.8 * 4.0 * 20.0 * 0.02_f64.powi(3) / 6.0);
        assert!(so3::angle_between(&exact.attitude, &ours.attitude) < 1e-9);
    }
}
