//! Runs the odometry over rendered sequences and prints how well it did, one JSON object per run and a summary.

use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use clap::Parser;
use cpu_time::ThreadTime;
use nalgebra::Vector3;
use paintcopter_benches::Rng;
use serde_json::json;
use vio_ekf::sim::{CameraModel, Frame, ImuModel, Scenario, Simulation, camera_ahead, painting_flight};
use vio_ekf::{
    Alignment, Association, Camera, ImageView, Odometry, Settings, Spline, Stamp, Start, StartSigma, Status,
    Trajectory, Vio, ate, euroc, nalgebra, so3, tum,
};

type AnyError = Box<dyn Error>;

/// Renders sequences, runs the filter over them, prints trajectory error, consistency and time.
#[derive(Parser)]
#[command(after_help = "Example: vio_runs --sequence MH_03 --seeds 5")]
struct Arguments {
    /// `MH_01`, `MH_03`, `MH_04`, `V1_02`, `paint_1`, `paint_2`; all of them if none is named. Several may be given
    #[arg(long)]
    sequence: Vec<String>,
    /// Runs of each sequence, with seeds 1, 2, ...: another room, other noise
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    /// The first of the seeds
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// Seconds of each sequence; all by default
    #[arg(long)]
    seconds: Option<f64>,
    /// Settings of the filter that differ from the default, as JSON
    #[arg(long, default_value = "{}")]
    settings: String,
    /// Folder for the frames, so that the next run need not render them again
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Folder with the recordings
    #[arg(long, env = "PAINTCOPTER_DATA", default_value = "../shared/data")]
    data: PathBuf,
    /// Runs of which the shortest time of each frame counts: on a shared machine a frame may be interrupted
    #[arg(long, default_value_t = 1)]
    repeats: usize,
    /// Folder for the trajectories
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Squared errors in units of the claimed covariance: position, attitude, velocity, both biases.
const NEES: [&str; 5] = ["position", "attitude", "velocity", "gyro_bias", "accel_bias"];

struct Outcome {
    se3: f64,
    yaw: f64,
    nees: [f64; 5],
    millis: Vec<f64>,
    /// Time of an inertial sample together with an output with covariance.
    imu_micros: Vec<f64>,
    diverged: bool,
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let settings: Settings = serde_json::from_str(&arguments.settings)?;
    let all = ["MH_01", "MH_03", "MH_04", "V1_02", "paint_1", "paint_2"].map(String::from).to_vec();
    let names = if arguments.sequence.is_empty() { &all } else { &arguments.sequence };
    let (mut errors, mut millis, mut imu_micros, mut diverged) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for name in names {
        let spline = spline(&arguments.data, name, arguments.seconds)?;
        for seed in arguments.first_seed..arguments.first_seed + arguments.seeds {
            let cameras = vec![CameraModel { camera: camera(name), ..CameraModel::default() }];
            let simulation = Simulation::new(spline.clone(), Scenario { seed, cameras, ..Scenario::default() })?;
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
                "frames": outcome.millis.len(), "frame_ms_median": quantile(&outcome.millis, 0.5),
                "frame_ms_p99": quantile(&outcome.millis, 0.99), "diverged": outcome.diverged,
            });
            for (what, value) in NEES.iter().zip(outcome.nees) {
                line[format!("nees_{what}")] = json!(value);
            }
            println!("{line}");
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

/// The camera of a sequence.
fn camera(name: &str) -> Camera {
    if name.starts_with("paint") { camera_ahead() } else { Camera::euroc() }
}

/// The motion of a recording, cut to some seconds.
fn spline(data: &Path, name: &str, seconds: Option<f64>) -> Result<Spline, AnyError> {
    let file = match name {
        "MH_01" => "trajectories/euroc/MH_01_easy.txt.gz",
        "MH_03" => "trajectories/euroc/MH_03_medium.txt.gz",
        "MH_04" => "vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz",
        "V1_02" => "vio/euroc_imu_gt/V1_02_medium/groundtruth_V1_02_medium.csv.gz",
        "paint_1" => return Ok(painting_flight(1, seconds.unwrap_or(60.0))?),
        "paint_2" => return Ok(painting_flight(2, seconds.unwrap_or(60.0))?),
        _ => return Err(format!("`{name}` is no sequence: MH_01, MH_03, MH_04, V1_02, paint_1 or paint_2").into()),
    };
    let path = data.join(file);
    let output = Command::new("gzip").arg("-dc").arg(&path).output()?;
    if !output.status.success() {
        return Err(
            format!("cannot read {}: set PAINTCOPTER_DATA to the folder with the recordings", path.display()).into()
        );
    }
    let text = String::from_utf8(output.stdout)?;
    let whole = if file.ends_with("csv.gz") { euroc::read(&text)?.trajectory } else { tum::read(&text)? };
    let mut cut = Trajectory::default();
    let first = whole.stamps().first().copied().unwrap_or_default();
    for (stamp, pose) in whole.iter().take_while(|(s, _)| seconds.is_none_or(|most| s.secs_since(first) <= most)) {
        cut.push(stamp, *pose)?;
    }
    Ok(Spline::from_trajectory(&cut, 50_000_000)?)
}

fn follow(
    simulation: &Simulation,
    name: &str,
    seed: u64,
    settings: &Settings,
    arguments: &Arguments,
) -> Result<Outcome, AnyError> {
    let imu = ImuModel::default();
    let recording = simulation.imu(0)?;
    let mut vio = Vio::new(camera(name), imu.noise, *settings)?;
    let mut samples = recording.samples.iter();
    let first = samples.next().ok_or("the sequence is too short")?;
    vio.imu(first)?;
    vio.start(&start(simulation, first.stamp, &imu, seed)?)?;

    let mut film = Film::new(simulation, name, seed, arguments)?;
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    let mut outcome =
        Outcome { se3: 0.0, yaw: 0.0, nees: [0.0; 5], millis: Vec::new(), imu_micros: Vec::new(), diverged: false };
    let mut next = samples.next();
    while let Some(frame) = film.next()? {
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
        let report = vio.image(frame.stamp, &frame.view())?;
        outcome.millis.push(began.elapsed().as_secs_f64() * 1e3);
        outcome.diverged |= matches!(report.status, Status::Diverged(_));
        if std::env::var_os("VIO_TRACE").is_some() {
            eprintln!("{} {report:?}", frame.stamp);
        }
        let odometry = vio.output().ok_or("the filter is not running")?;
        if odometry.stamp > simulation.spline().span().1 {
            break;
        }
        let motion = simulation.motion(odometry.stamp)?;
        truth.push(odometry.stamp, motion.world_from_body)?;
        estimate.push(odometry.stamp, odometry.world_from_body)?;
        let (gyro, accel) = recording.biases_at(odometry.stamp);
        for (sum, value) in outcome.nees.iter_mut().zip(nees(&odometry, &motion, [gyro, accel])) {
            *sum += value;
        }
    }
    let count = estimate.len() as f64;
    outcome.nees.iter_mut().for_each(|sum| *sum /= count);
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

/// The truth, less errors drawn from what the start admits.
fn start(simulation: &Simulation, stamp: Stamp, imu: &ImuModel, seed: u64) -> Result<Start, AnyError> {
    let motion = simulation.motion(stamp)?;
    let (gyro_bias, accel_bias) = (imu.gyro_bias_sigma, imu.accel_bias_sigma);
    let sigma = StartSigma { gyro_bias, accel_bias, ..StartSigma::default() };
    let mut rng = Rng(seed);
    let mut normals = || Vector3::from_fn(|_, _| (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0);
    let pose = motion.world_from_body;
    let tilt = normals().component_mul(&Vector3::new(sigma.tilt, sigma.tilt, 0.0));
    Ok(Start {
        stamp,
        world_from_body: nalgebra::Isometry3::from_parts(pose.translation, so3::exp(&-tilt) * pose.rotation),
        velocity_in_body: pose.rotation.inverse() * motion.velocity_in_world - normals() * sigma.velocity,
        // The simulator draws the biases around zero.
        gyro_bias: Vector3::zeros(),
        accel_bias: Vector3::zeros(),
        sigma,
    })
}

fn nees(o: &Odometry, truth: &vio_ekf::Motion, biases: [Vector3<f64>; 2]) -> [f64; 5] {
    let errors = [
        truth.world_from_body.translation.vector - o.world_from_body.translation.vector,
        so3::log(&(truth.world_from_body.rotation * o.world_from_body.rotation.inverse())),
        truth.world_from_body.rotation.inverse() * truth.velocity_in_world - o.velocity_in_body,
        biases[0] - o.gyro_bias,
        biases[1] - o.accel_bias,
    ];
    std::array::from_fn(|k| {
        let row = 3 * [0, 2, 1, 3, 4][k];
        let block = o.covariance.fixed_view::<3, 3>(row, row).into_owned();
        block.cholesky().map_or(0.0, |factor| errors[k].dot(&factor.solve(&errors[k])))
    })
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(0.0)
}

/// The frames of a sequence, rendered or from an earlier run.
struct Film<'a> {
    simulation: &'a Simulation,
    folder: Option<PathBuf>,
    index: usize,
}

impl<'a> Film<'a> {
    fn new(simulation: &'a Simulation, name: &str, seed: u64, arguments: &Arguments) -> Result<Self, AnyError> {
        let folder = arguments.cache.as_ref().map(|cache| cache.join(format!("{name}_{seed}")));
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder)?;
        }
        Ok(Self { simulation, folder, index: 0 })
    }

    fn next(&mut self) -> Result<Option<Frame>, AnyError> {
        while self.index < self.simulation.frame_count(0) {
            let index = self.index;
            self.index += 1;
            let Some(folder) = &self.folder else {
                match self.simulation.frame(0, index)? {
                    Some(frame) => return Ok(Some(frame)),
                    None => continue,
                }
            };
            let file = folder.join(index.to_string());
            if let Ok(bytes) = std::fs::read(&file) {
                let (head, data) = bytes.split_at_checked(16).ok_or("a file of the cache is cut off")?;
                let stamps: [i64; 2] =
                    [0, 8].map(|k| i64::from_le_bytes(head[k..k + 8].try_into().unwrap_or_default()));
                let [stamp, true_stamp] = stamps.map(Stamp::from_nanos);
                let camera = CameraModel::default().camera;
                let (width, height) = (camera.width, camera.height);
                ImageView::new(width, height, data)?;
                return Ok(Some(Frame { stamp, true_stamp, width, height, data: data.to_vec() }));
            }
            if let Some(frame) = self.simulation.frame(0, index)? {
                let mut bytes = frame.stamp.nanos().to_le_bytes().to_vec();
                bytes.extend(frame.true_stamp.nanos().to_le_bytes());
                bytes.extend(&frame.data);
                std::fs::write(file, bytes)?;
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }
}
