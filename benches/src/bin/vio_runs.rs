//! Runs the odometry over rendered sequences and prints how well it did, one JSON object per run and a summary.

use std::error::Error;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use cpu_time::ThreadTime;
use nalgebra::{Isometry3, Matrix3, Vector3};
use paintcopter::exit::run_program;
use paintcopter_benches::Rng;
use paintcopter_benches::frames::Frames;
use paintcopter_benches::sequences::{REAL_IMU, SEQUENCES, cameras, motion, real_samples};
use serde_json::json;
use vio_ekf::eval::{Alignment, Association, ate, chi2, heading_onto};
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::format::tum;
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::lie::so3;
use vio_ekf::sim::{ImuModel, Scenario, SimulatedCamera, Simulation};
use vio_ekf::{Camera, Odometry, Settings, Stamp, Status, Trajectory, Vio};

type AnyError = Box<dyn Error>;

/// Renders sequences, runs the filter over them, prints trajectory error, consistency and time.
#[derive(Parser)]
#[command(after_help = "Example: vio_runs --sequence MH_03 --seeds 5")]
struct Arguments {
    /// `MH_01`, `MH_03`, `MH_04`, `V1_02`, `paint_1`, `paint_2`; all of them if none is named. Several may be given. `V1_01_imu`,
    /// `V1_02_imu` and `MH_04_imu` are flown with the recorded readings of the inertial sensor, from a start of the filter's own;
    /// a name that is none lists the others
    #[arg(long)]
    sequence: Vec<String>,
    /// Lets the filter start by itself, as on a recording, instead of near the truth
    #[arg(long)]
    own_start: bool,
    /// Runs of each sequence, with seeds 1, 2, ...: another room, other noise
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    /// The first of the seeds
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Seconds of each sequence; all by default
    #[arg(long)]
    seconds: Option<f64>,
    /// With the second camera
    #[arg(long)]
    stereo: bool,
    /// Error of the accelerometer's scale: it reads so much more, relative, on all axes
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    accel_scale: f64,
    /// Angle by which the accelerometer's axes lean away from those of the body, degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    accel_misalignment: f64,
    /// Rolling shutter of the rendered camera: seconds from the first row until the last. The filter is told by
    /// `calibration.row_time_s` of the settings, or not
    #[arg(long, default_value_t = 0.0)]
    readout: f64,
    /// Settings of the filter that differ from the default, as JSON
    #[arg(long, default_value = "{}")]
    settings: String,
    /// Folder for the frames, so that the next run need not render them again
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Folder with the recordings
    #[arg(long, env = "PAINTCOPTER_DATA")]
    data: PathBuf,
    /// Runs of which the shortest time of each frame counts: on a shared machine a frame may be interrupted
    #[arg(long, default_value_t = 1)]
    repeats: usize,
    /// Folder for the trajectories
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
}

fn main() -> ExitCode {
    run_program("vio_runs", run)
}

/// Squared errors in units of the claimed covariance: position, attitude, velocity, both biases.
const NEES: [&str; 5] = ["position", "attitude", "velocity", "gyro_bias", "accel_bias"];

/// Deviations of recorded truth along each axis, as the report of `vio` has them: m, rad, m/s.
const TRUTH_SIGMA: [f64; 5] = [1e-3, 0.1 * std::f64::consts::PI / 180.0, 3e-3, 0.0, 0.0];

struct Outcome {
    se3: f64,
    yaw: f64,
    /// After each image with a pose.
    nees: Vec<[f64; 5]>,
    /// Seconds from the beginning until the first pose.
    first_pose_s: f64,
    millis: Vec<f64>,
    /// Time of an inertial sample together with an output with covariance.
    imu_micros: Vec<f64>,
    diverged: bool,
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let settings: Settings = serde_json::from_str(&arguments.settings)?;
    let all = SEQUENCES.map(String::from).to_vec();
    let names = if arguments.sequence.is_empty() { &all } else { &arguments.sequence };
    let (mut errors, mut millis, mut imu_micros, mut diverged) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for name in names {
        let spline = motion(&arguments.data, name, arguments.seconds)?;
        let mut squares = Vec::new();
        for seed in arguments.first_seed..arguments.first_seed + arguments.seeds {
            let count = if arguments.stereo { 2 } else { 1 };
            let model = |camera: Camera| SimulatedCamera {
                camera,
                row_time_s: arguments.readout / camera.height as f64,
                ..SimulatedCamera::default()
            };
            let cameras = cameras(name)[..count].iter().copied().map(model).collect();
            let imus = vec![ImuModel { accel_matrix: accel_matrix(arguments), ..ImuModel::default() }];
            let simulation = Simulation::new(spline.clone(), Scenario { seed, cameras, imus, ..Scenario::default() })?;
            let mut outcome = follow(&simulation, name, seed, &settings, arguments)?;
            for _ in 1..arguments.repeats {
                let again = follow(&simulation, name, seed, &settings, arguments)?;
                for (least, time) in outcome.millis.iter_mut().zip(again.millis) {
                    *least = least.min(time);
                }
            }
            imu_micros.extend_from_slice(&outcome.imu_micros);
            errors.push(outcome.se3);
            millis.extend_from_slice(&outcome.millis);
            diverged += usize::from(outcome.diverged);
            let mut line = json!({
                "sequence": name, "seed": seed, "ate_se3_m": outcome.se3, "ate_yaw_m": outcome.yaw,
                "frames": outcome.millis.len(), "poses": outcome.nees.len() as f64 / outcome.millis.len() as f64,
                "first_pose_s": outcome.first_pose_s, "frame_ms_median": quantile(&outcome.millis, 0.5),
                "frame_ms_p99": quantile(&outcome.millis, 0.99), "diverged": outcome.diverged,
            });
            for (k, what) in NEES.iter().enumerate() {
                let sum: f64 = outcome.nees.iter().map(|squares| squares[k]).sum();
                line[format!("nees_{what}")] = json!(sum / outcome.nees.len() as f64);
            }
            println!("{line}");
            squares.push(outcome.nees);
        }
        if arguments.seeds > 1 {
            println!("{}", consistency(name, &squares)?);
        }
    }
    let worst = errors.iter().copied().fold(0.0, f64::max);
    let summary = json!({
        "runs": errors.len(), "ate_se3_mean_m": errors.iter().sum::<f64>() / errors.len() as f64,
        "ate_se3_worst_m": worst, "frame_ms_median": quantile(&millis, 0.5), "frame_ms_p99": quantile(&millis, 0.99),
        "imu_and_output_us_median": quantile(&imu_micros, 0.5), "diverged": diverged,
    });
    println!("{summary}");
    Ok(())
}

/// Over the runs of a sequence: the mean of all squared errors, and for how much of the time the mean over the runs lies where it does
/// 95 % of the time if the claim is right.
fn consistency(name: &str, runs: &[Vec<[f64; 5]>]) -> Result<serde_json::Value, AnyError> {
    let (low, high) = chi2::mean_band(3, runs.len(), 0.95)?;
    let frames = runs.iter().map(Vec::len).min().unwrap_or(0);
    let mut line = json!({ "all_of": name, "runs": runs.len(), "nees_band": [low, high] });
    for (k, what) in NEES.iter().enumerate() {
        let mean = |frame: usize| runs.iter().map(|run| run[frame][k]).sum::<f64>() / runs.len() as f64;
        let means: Vec<f64> = (0..frames).map(mean).collect();
        let inside = means.iter().filter(|mean| (low..=high).contains(*mean)).count();
        line[format!("in_band_{what}")] = json!(inside as f64 / frames as f64);
        line[format!("nees_{what}")] = json!(means.iter().sum::<f64>() / frames as f64);
    }
    Ok(line)
}

fn follow(
    simulation: &Simulation,
    name: &str,
    seed: u64,
    settings: &Settings,
    arguments: &Arguments,
) -> Result<Outcome, AnyError> {
    let imu = ImuModel::default();
    let real = REAL_IMU.contains(&name);
    let own_start = real || arguments.own_start;
    let recording = simulation.imu(0)?;
    let read = if real { real_samples(&arguments.data, name, simulation.spline())? } else { recording.samples.clone() };
    let [left, right] = cameras(name);
    let mut vio = filter([left, right], settings, arguments.stereo, own_start)?;
    let mut samples = read.iter();
    let first = samples.next().ok_or("the sequence is too short")?;
    vio.imu(first)?;
    if !own_start {
        vio.initialize(&start(simulation, first.stamp, &imu, seed)?)?;
    }

    let folder = |side: &str| arguments.cache.as_ref().map(|cache| cache.join(format!("{name}_{seed}{side}")));
    let first = Frames::new(simulation, 0, left, folder(""))?;
    let second = arguments.stereo.then(|| Frames::new(simulation, 1, right, folder("_right"))).transpose()?;
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    let mut outcome = Outcome {
        se3: f64::NAN,
        yaw: f64::NAN,
        nees: Vec::new(),
        first_pose_s: f64::NAN,
        millis: Vec::new(),
        imu_micros: Vec::new(),
        diverged: false,
    };
    let (mut next, mut moved) = (samples.next(), None);
    for index in 0..first.count() {
        let Some(frame) = first.get(index)? else { continue };
        let other = second.as_ref().map(|second| second.get(index)).transpose()?.flatten();
        while let Some(sample) = next {
            let began = ThreadTime::now();
            vio.imu(sample)?;
            black_box(vio.output());
            outcome.imu_micros.push(began.elapsed().as_secs_f64() * 1e6);
            next = samples.next();
            if sample.stamp >= frame.stamp {
                break;
            }
        }
        let began = ThreadTime::now();
        let report = match &other {
            Some(other) => vio.image_pair(frame.stamp, &frame.view(), &other.view())?,
            None => vio.image(frame.stamp, &frame.view())?,
        };
        outcome.millis.push(began.elapsed().as_secs_f64() * 1e3);
        outcome.diverged |= matches!(report.status, Status::Diverged(_));
        if outcome.diverged && own_start {
            continue;
        }
        if std::env::var_os("VIO_TRACE").is_some() {
            eprintln!("{} {report:?}", frame.stamp);
        }
        let Some(odometry) = vio.output() else {
            if !own_start {
                return Err("the filter is not running".into());
            }
            // A start that is taken back takes its world along.
            (truth, estimate, moved) = (Trajectory::default(), Trajectory::default(), None);
            outcome.nees.clear();
            continue;
        };
        if odometry.stamp > simulation.spline().span().1 {
            break;
        }
        let mut motion = simulation.motion(odometry.stamp)?;
        if outcome.nees.is_empty() {
            outcome.first_pose_s = frame.stamp.secs_since(simulation.spline().span().0);
        }
        if own_start {
            // Its world begins where it does.
            let moved = *moved.get_or_insert_with(|| heading_onto(&odometry.world_from_body, &motion.world_from_body));
            motion.world_from_body = moved * motion.world_from_body;
            motion.velocity_in_world = moved * motion.velocity_in_world;
        }
        truth.push(odometry.stamp, motion.world_from_body)?;
        estimate.push(odometry.stamp, odometry.world_from_body)?;
        let (gyro, accel) = recording.biases_at(odometry.stamp);
        let of_truth = if real { TRUTH_SIGMA } else { [0.0; 5] };
        let mut squares = nees(&odometry, &motion, [gyro, accel], &of_truth);
        if real {
            // Nobody knows the biases.
            squares[3..].fill(f64::NAN);
        }
        outcome.nees.push(squares);
    }
    if outcome.nees.is_empty() {
        return Ok(outcome);
    }
    let pairs = Association::default().pair_up(&truth, &estimate)?;
    outcome.se3 = ate(&pairs.reference, &pairs.estimate, Alignment::Se3)?.position.rmse;
    outcome.yaw = ate(&pairs.reference, &pairs.estimate, Alignment::PosYaw)?.position.rmse;
    if let Some(folder) = &arguments.save {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join(format!("{name}_{seed}_truth.tum")), tum::write(&truth))?;
        std::fs::write(folder.join(format!("{name}_{seed}.tum")), tum::write(&estimate))?;
    }
    Ok(outcome)
}

/// As a recording's calibration makes it for a start of its own; otherwise with a clock that is exact.
fn filter([left, right]: [Camera; 2], settings: &Settings, stereo: bool, own_start: bool) -> Result<Vio, AnyError> {
    let noise = ImuModel::default().noise;
    if !own_start {
        return Ok(if stereo {
            Vio::stereo(left, right, noise, *settings)?
        } else {
            Vio::new(left, noise, *settings)?
        });
    }
    let calibrations =
        [left, right].map(|camera| CameraCalibration { camera, rate_hz: None, time_offset_s: 0.0, row_time_s: 0.0 });
    let imu = ImuCalibration { noise, rate_hz: 200.0, body_from_imu: Isometry3::identity() };
    Ok(Vio::from_calibration(&calibrations[..if stereo { 2 } else { 1 }], &imu, *settings)?)
}

/// What the accelerometer reads of the specific force. Each axis leans towards the next and away from the other.
fn accel_matrix(arguments: &Arguments) -> Matrix3<f64> {
    let lean = arguments.accel_misalignment.to_radians().sin();
    Matrix3::from_fn(|r, c| match (3 + c - r) % 3 {
        0 => 1.0 + arguments.accel_scale,
        1 => lean,
        _ => -0.5 * lean,
    })
}

/// The truth, less errors drawn from what the start admits.
fn start(simulation: &Simulation, stamp: Stamp, imu: &ImuModel, seed: u64) -> Result<InitialState, AnyError> {
    let motion = simulation.motion(stamp)?;
    let (gyro_bias, accel_bias) = (imu.gyro_bias_sigma, imu.accel_bias_sigma);
    let sigma = InitialSigma { gyro_bias, accel_bias, ..InitialSigma::default() };
    let mut rng = Rng::new(seed);
    let mut normals = || Vector3::from_fn(|_, _| (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0);
    let pose = motion.world_from_body;
    let tilt = normals().component_mul(&Vector3::new(sigma.tilt, sigma.tilt, 0.0));
    Ok(InitialState {
        stamp,
        world_from_body: Isometry3::from_parts(pose.translation, so3::exp(&-tilt) * pose.rotation),
        velocity_in_body: pose.rotation.inverse() * motion.velocity_in_world - normals() * sigma.velocity,
        // The simulator draws the biases around zero.
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma,
    })
}

fn nees(o: &Odometry, truth: &vio_ekf::trajectory::Motion, biases: [Vector3<f64>; 2], of_truth: &[f64; 5]) -> [f64; 5] {
    let errors = [
        truth.world_from_body.translation.vector - o.world_from_body.translation.vector,
        so3::log(&(truth.world_from_body.rotation * o.world_from_body.rotation.inverse())),
        truth.world_from_body.rotation.inverse() * truth.velocity_in_world - o.velocity_in_body,
        biases[0] - o.gyro_bias,
        biases[1] - o.accel_bias,
    ];
    std::array::from_fn(|k| {
        let row = 3 * [0, 2, 1, 3, 4][k];
        let block = o.covariance.fixed_view::<3, 3>(row, row) + Matrix3::identity() * of_truth[k].powi(2);
        block.cholesky().map_or(0.0, |factor| errors[k].dot(&factor.solve(&errors[k])))
    })
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(0.0)
}
