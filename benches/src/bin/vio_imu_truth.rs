//! How well recorded inertial readings agree with the recorded truth, and what of the difference a calibration would explain: prints one
//! JSON object per flight and length of time.

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use nalgebra::{DMatrix, DVector, Vector3};
use paintcopter::exit::run_program;
use paintcopter_benches::sequences::{REAL_IMU, motion, real_samples};
use serde_json::json;
use vio_ekf::Imu;
use vio_ekf::lie::so3;
use vio_ekf::trajectory::{Motion, Spline};

/// Compares readings with truth over short spans.
#[derive(Parser)]
#[command(after_help = "Example: vio_imu_truth --span 0.5")]
struct Arguments {
    /// Lengths of time, s
    #[arg(long, value_delimiter = ',', default_value = "0.05,0.1,0.2,0.5,1")]
    span: Vec<f64>,
    /// Folder with the recordings
    #[arg(long, env = "PAINTCOPTER_DATA")]
    data: PathBuf,
}

fn main() -> ExitCode {
    run_program("vio_imu_truth", run)
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    for name in REAL_IMU {
        let spline = motion(&arguments.data, name, None)?;
        let samples = real_samples(&arguments.data, name, &spline)?;
        for &span in &arguments.span {
            println!("{}", compare(name, &spline, &samples, span)?);
        }
    }
    Ok(())
}

/// What may be wrong with the readings: number of parameters, and their name.
const GROUPS: [(usize, &str); 4] = [(9, "scale_and_misalignment"), (1, "gravity"), (1, "time"), (3, "lever_arm")];
/// A constant bias, which is always taken out, piece by piece of this length, s: biases walk.
const PIECE_S: f64 = 10.0;

/// Over each span: the change of the truth's velocity, less that of the readings turned by the truth's attitude.
fn compare(name: &str, spline: &Spline, samples: &[Imu], span: f64) -> Result<serde_json::Value, Box<dyn Error>> {
    let truth: Vec<Motion> = samples.iter().map(|sample| spline.sample(sample.stamp)).collect::<Result<_, _>>()?;
    let rate = (samples.len() - 1) as f64 / samples[samples.len() - 1].stamp.secs_since(samples[0].stamp);
    let count = (span * rate).round().max(1.0) as usize;
    let pieces = (samples.len() as f64 / rate / PIECE_S).ceil() as usize;
    let spans = (samples.len() - 1) / count;
    let parameters: usize = GROUPS.iter().map(|(n, _)| n).sum();
    let (mut columns, mut left) = (DMatrix::zeros(3 * spans, parameters + 3 * pieces), DVector::zeros(3 * spans));
    let (mut moved, mut turned, mut turn_columns) =
        (DVector::zeros(3 * spans), DVector::zeros(3 * spans), DMatrix::zeros(3 * spans, 3 * pieces));
    for k in 0..spans {
        let range = k * count..(k + 1) * count;
        let piece = ((range.start as f64 / rate / PIECE_S) as usize).min(pieces - 1);
        let (mut velocity, mut position, mut time) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        let mut rotation = truth[range.start].world_from_body.rotation;
        for i in range.clone() {
            let dt = samples[i + 1].stamp.secs_since(samples[i].stamp);
            let force = (samples[i].accel + samples[i + 1].accel) * 0.5;
            let axes = [i, i + 1].map(|i| truth[i].world_from_body.rotation.to_rotation_matrix().into_inner());
            let middle = (axes[0] + axes[1]) * 0.5;
            let acceleration = middle * force - Vector3::z() * 9.8081;
            position += velocity * dt + acceleration * (0.5 * dt * dt);
            velocity += acceleration * dt;
            time += dt;
            rotation *= so3::exp(&((samples[i].gyro + samples[i + 1].gyro) * (0.5 * dt)));
            for r in 0..3 {
                for c in 0..3 {
                    for axis in 0..3 {
                        columns[(3 * k + axis, 3 * r + c)] += middle[(axis, r)] * force[c] * dt;
                    }
                }
            }
            let mut bias = columns.fixed_view_mut::<3, 3>(3 * k, parameters + 3 * piece);
            bias += middle * dt;
            let mut bias = turn_columns.fixed_view_mut::<3, 3>(3 * k, 3 * piece);
            bias += middle * dt;
        }
        let [from, to] = [range.start, range.end].map(|i| truth[i]);
        let change = to.velocity_in_world - from.velocity_in_world - velocity;
        left.fixed_rows_mut::<3>(3 * k).copy_from(&change);
        let shift = to.world_from_body.translation.vector
            - from.world_from_body.translation.vector
            - from.velocity_in_world * time
            - position;
        moved.fixed_rows_mut::<3>(3 * k).copy_from(&shift);
        turned.fixed_rows_mut::<3>(3 * k).copy_from(&so3::log(&(to.world_from_body.rotation * rotation.inverse())));
        columns[(3 * k + 2, 9)] = time;
        let at = |i: usize| truth[i].world_from_body.rotation * samples[i].accel;
        columns.fixed_view_mut::<3, 1>(3 * k, 10).copy_from(&(at(range.end) - at(range.start)));
        let swing =
            |m: &Motion| m.world_from_body.rotation.to_rotation_matrix().into_inner() * m.rate_in_body.cross_matrix();
        columns.fixed_view_mut::<3, 3>(3 * k, 11).copy_from(&(swing(&to) - swing(&from)));
    }
    let root_mean_square = |v: &DVector<f64>| (v.norm_squared() / spans as f64).sqrt();
    let fitted = |chosen: &[usize]| -> Result<(f64, DVector<f64>), Box<dyn Error>> {
        let a = columns
            .select_columns(chosen.iter().copied().chain(parameters..columns.ncols()).collect::<Vec<_>>().iter());
        // A trace of a prior: what the motion does not show stays zero.
        let mut normal = a.transpose() * &a;
        normal.fill_diagonal(0.0);
        let mut normal = a.transpose() * &a + normal * 0.0;
        for k in 0..normal.nrows() {
            normal[(k, k)] += 1e-9;
        }
        let solved = normal.cholesky().ok_or("the normal matrix is singular")?.solve(&(a.transpose() * &left));
        Ok((root_mean_square(&(&left - &a * &solved)), solved))
    };
    let turning = {
        let mut normal = turn_columns.transpose() * &turn_columns;
        for k in 0..normal.nrows() {
            normal[(k, k)] += 1e-9;
        }
        let solved = normal.cholesky().ok_or("singular")?.solve(&(turn_columns.transpose() * &turned));
        root_mean_square(&(&turned - &turn_columns * solved))
    };
    let (alone, _) = fitted(&[])?;
    let mut line = json!({
        "flight": name, "span_s": span, "velocity_m_s": alone, "position_m": root_mean_square(&moved),
        "attitude_deg": turning.to_degrees(),
        // What white noise of this density would do to all three axes together.
        "accel_density": alone / (3.0 * span).sqrt(), "gyro_density": turning / (3.0 * span).sqrt(),
    });
    let mut first = 0;
    for (n, what) in GROUPS {
        let (rest, found) = fitted(&(first..first + n).collect::<Vec<_>>())?;
        line[format!("velocity_with_{what}")] = json!(rest);
        line[what] = json!(found.rows(0, n).iter().map(|v| (v * 1e4).round() / 1e4).collect::<Vec<_>>());
        first += n;
    }
    let (rest, _) = fitted(&(0..parameters).collect::<Vec<_>>())?;
    line["velocity_with_all"] = json!(rest);
    Ok(line)
}
