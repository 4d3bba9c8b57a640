//! Poses that somebody else measures ten times a second, late and noisy, and an inertial sensor between them.
//! `cargo run --release -p vio-ekf --example pose_fusion`

use vio_ekf::fusion::{FusionSettings, PoseFusion, PoseMeasurement, PoseSource};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::nalgebra::{Isometry3, Vector3};
use vio_ekf::sim::{ImuModel, painting_flight};
use vio_ekf::{Error, ImuNoise};

/// Deviations of the poses, m and rad.
const SIGMA: [f64; 2] = [0.02, 0.01];
/// Their delay, in inertial samples of 5 ms.
const LATE: usize = 16;

/// Root mean square error of the position at all samples of the last twenty seconds, m.
pub fn fuse() -> Result<f64, Error> {
    let flight = painting_flight(1, 30.0)?;
    let samples = ImuModel::default().record(&flight, 9.81, 1)?.samples;
    let mut fusion = PoseFusion::new(ImuNoise::default(), &[PoseSource::default()], FusionSettings::default())?;
    fusion.imu(&samples[0])?;
    let start = flight.sample(samples[0].stamp)?;
    fusion.initialize(&InitialState {
        stamp: samples[0].stamp,
        world_from_body: start.world_from_body,
        velocity_in_body: start.world_from_body.rotation.inverse() * start.velocity_in_world,
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma: InitialSigma::default(),
    })?;
    let mut squares = Vec::new();
    for (k, sample) in samples.iter().enumerate().skip(1) {
        fusion.imu(sample)?;
        if k % 20 == 0 && k > LATE {
            // An error of three waves that no two poses share, instead of a random one.
            let wave = |phase: f64| Vector3::new(1.7, 2.3, 2.9).map(|f| (f * k as f64 + phase).sin() * 2.0_f64.sqrt());
            let taken = samples[k - LATE].stamp;
            let error = Isometry3::new(wave(0.0) * SIGMA[0], wave(1.0) * SIGMA[1]);
            let truth = flight.sample(taken)?.world_from_body;
            let pose = Isometry3::from_parts(
                (truth.translation.vector + error.translation.vector).into(),
                error.rotation * truth.rotation,
            );
            fusion.pose(&PoseMeasurement::isotropic(0, taken, pose, SIGMA[0], SIGMA[1]))?;
        }
        if let Some(now) = fusion.output().filter(|_| k > 2000) {
            let truth = flight.sample(sample.stamp)?.world_from_body.translation.vector;
            squares.push((now.world_from_body.translation.vector - truth).norm_squared());
        }
    }
    Ok((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

fn main() -> Result<(), Error> {
    println!("poses are {:.3} m off, the fusion {:.3} m at every sample", SIGMA[0] * 3.0_f64.sqrt(), fuse()?);
    Ok(())
}
