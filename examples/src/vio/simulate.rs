//! Simulated recordings: an EuRoC folder that any odometry can run, and the same as MCAP.

use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration, write_asl_camera, write_asl_imu};
use vio_ekf::format::{asl, euroc, tum};
use vio_ekf::lie::so3;
use vio_ekf::nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use vio_ekf::sim::{Frame, ImuRecording, Scenario, SimulatedCamera, Simulation};
use vio_ekf::trajectory::Spline;
use vio_ekf::{Stamp, Trajectory};

use super::error::{make_folder, write_file};
use super::euroc_folder::read_truth;
use super::mcap_out::{McapWriter, Pixels};
use super::{GreyImage, VioError};
use crate::interruption::{self, Finishing};
use crate::progress::Stage;

/// Time between two knots of the motion, ns.
const KNOTS: i64 = 50_000_000;
/// The first knot: a date, because many readers refuse times near zero.
const FIRST: i64 = 1_700_000_000_000_000_000;
/// Rest at the start of a generated flight, s.
const REST: f64 = 2.0;
/// Time in which a generated flight gains its full extent after the rest, s.
const TAKE_OFF: f64 = 2.0;

/// A motion to fly.
#[derive(Debug, Clone)]
pub enum Flight {
    /// Swaying and turning through a room.
    Room,
    /// Rows along a wall, looking at it, as a painting robot flies.
    Wall,
    /// Smoothed from a file of poses, TUM or EuRoC text.
    File(PathBuf),
}

/// What is simulated, and how much of it.
#[derive(Debug, Clone)]
pub struct SimulationSettings {
    /// The motion.
    pub flight: Flight,
    /// Seconds of it at most.
    pub seconds: f64,
    /// Room, sensors and seed.
    pub scenario: Scenario,
    /// Whether an MCAP file is written beside the folder.
    pub mcap: bool,
    /// Whether the MCAP file holds the pixels as they are, not as PNG.
    pub raw: bool,
    /// Worker threads; the results do not depend on it.
    pub threads: usize,
}

/// What was written.
#[derive(Debug, Clone, Copy)]
pub struct Simulated {
    /// Images of the first camera.
    pub frames: usize,
    /// Inertial samples.
    pub samples: usize,
    /// Length of the motion, s.
    pub duration_s: f64,
    /// Length of the path, m.
    pub path_length_m: f64,
}

/// Renders a flight, as all cameras of the scenario see it, into `mav0`, `truth.tum` and, if asked for, `recording.mcap` in a folder.
///
/// # Errors
/// [`VioError`] if the motion or the settings cannot be, or a file cannot be written.
pub fn simulate(settings: &SimulationSettings, folder: &Path) -> Result<Simulated, VioError> {
    let spline = flight_spline(&settings.flight, settings.seconds, settings.scenario.seed)?;
    let simulation = Simulation::new(spline, settings.scenario.clone())?;
    let recording = simulation.imu(0)?;
    let model = settings.scenario.imus.first().ok_or(vio_ekf::Error::NoSuch { what: "imu", index: 0, count: 0 })?;
    // Without the time offset: a calibration that knows it would leave nothing to find.
    let calibrated = |model: &SimulatedCamera| CameraCalibration {
        camera: model.camera,
        rate_hz: Some(model.rate_hz),
        time_offset_s: 0.0,
        row_time_s: model.row_time_s,
    };
    let cameras: Vec<CameraCalibration> = settings.scenario.cameras.iter().map(calibrated).collect();
    if cameras.is_empty() {
        return Err(vio_ekf::Error::NoSuch { what: "camera", index: 0, count: 0 }.into());
    }
    let imu = ImuCalibration { noise: model.noise, rate_hz: model.rate_hz, body_from_imu: Isometry3::identity() };

    let root = folder.join("mav0");
    for part in ["imu0", "state_groundtruth_estimate0"] {
        make_folder(&root.join(part))?;
    }
    for (which, camera) in cameras.iter().enumerate() {
        let folder = root.join(format!("cam{which}"));
        make_folder(&folder.join("data"))?;
        write_file(&folder.join("sensor.yaml"), write_asl_camera(camera).as_bytes())?;
    }
    write_file(&root.join("imu0/sensor.yaml"), write_asl_imu(&imu).as_bytes())?;
    write_file(&root.join("imu0/data.csv"), asl::write_imu(&recording.samples).as_bytes())?;
    let truth = truth(&simulation, &recording)?;
    write_file(&root.join("state_groundtruth_estimate0/data.csv"), euroc::write(&truth)?.as_bytes())?;
    write_file(&folder.join("truth.tum"), tum::write(&truth.trajectory).as_bytes())?;

    let began = recording.samples.first().map_or(Stamp::from_nanos(FIRST), |sample| sample.stamp);
    let mcap = settings
        .mcap
        .then(|| {
            let cameras = &cameras[..cameras.len().min(2)];
            McapWriter::create(&folder.join("recording.mcap"), began, cameras, &imu, settings.scenario.seed)
        })
        .transpose()?;
    let out = Sink {
        root,
        mcap,
        samples: &recording,
        truth: &truth.trajectory,
        next: (0, 0),
        names: vec![Vec::new(); cameras.len()],
        raw: settings.raw,
    };
    let frames = render(&simulation, settings.threads, out)?;
    Ok(Simulated {
        frames,
        samples: recording.samples.len(),
        duration_s: truth.trajectory.duration_s(),
        path_length_m: truth.trajectory.path_length(),
    })
}

/// A frame of a camera, ready to be written.
struct EncodedImage {
    which: usize,
    stamp: Stamp,
    grey: GreyImage,
    png: Vec<u8>,
}

/// Renders in parallel, a few frames at a time, and writes in order.
fn render(simulation: &Simulation, threads: usize, mut out: Sink) -> Result<usize, VioError> {
    let _finishing = Finishing::begin();
    let stage = Stage::start("render");
    let (cameras, threads) = (out.names.len(), threads.max(1));
    let counts = (0..cameras).map(|which| simulation.frame_count(which));
    // The frames of a moment one after the other; a camera that takes fewer has none at the end.
    let count = cameras * counts.max().unwrap_or(0);
    for first in (0..count).step_by(threads) {
        if interruption::is_requested() {
            break;
        }
        stage.share(first as f64 / count as f64);
        let batch = first..(first + threads).min(count);
        let developed: Vec<Result<Option<EncodedImage>, VioError>> = std::thread::scope(|scope| {
            let workers: Vec<_> =
                batch.map(|k| scope.spawn(move || encode_image(simulation, k % cameras, k / cameras))).collect();
            let join = |worker: std::thread::ScopedJoinHandle<'_, _>| {
                worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            workers.into_iter().map(join).collect()
        });
        for frame in developed {
            if let Some(frame) = frame? {
                out.frame(&frame)?;
            }
        }
    }
    let frames = out.finish()?;
    stage.done(&format!("{frames} images"));
    Ok(frames)
}

fn encode_image(simulation: &Simulation, which: usize, index: usize) -> Result<Option<EncodedImage>, VioError> {
    if index >= simulation.frame_count(which) {
        return Ok(None);
    }
    let Some(Frame { stamp, width, height, data, .. }) = simulation.frame(which, index)? else { return Ok(None) };
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub)
        .write_image(&data, width as u32, height as u32, ExtendedColorType::L8)
        .map_err(|error| VioError::unwritable(Path::new("image"), &error))?;
    Ok(Some(EncodedImage { which, stamp, grey: GreyImage { width, height, data }, png }))
}

/// Where frames go, and with them the samples and poses up to their time.
struct Sink<'a> {
    root: PathBuf,
    mcap: Option<McapWriter>,
    samples: &'a ImuRecording,
    truth: &'a Trajectory,
    /// Next sample and next pose for the MCAP file.
    next: (usize, usize),
    /// Images of each camera.
    names: Vec<Vec<(Stamp, String)>>,
    raw: bool,
}

impl Sink<'_> {
    fn frame(&mut self, frame: &EncodedImage) -> Result<(), VioError> {
        let name = format!("{}.png", frame.stamp.nanos());
        write_file(&self.root.join(format!("cam{}/data", frame.which)).join(&name), &frame.png)?;
        self.names[frame.which].push((frame.stamp, name));
        // The MCAP file has two cameras at most.
        if frame.which > 1 {
            return Ok(());
        }
        self.catch_up(frame.stamp)?;
        if let Some(mcap) = &mut self.mcap {
            let pixels = if self.raw { Pixels::Raw(&frame.grey) } else { Pixels::Png(&frame.png) };
            mcap.image(frame.which, frame.stamp, &pixels)?;
        }
        Ok(())
    }

    /// Samples and poses that are not after a time.
    fn catch_up(&mut self, until: Stamp) -> Result<(), VioError> {
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        for sample in self.samples.samples[self.next.0..].iter().take_while(|sample| sample.stamp <= until) {
            mcap.imu(sample)?;
            self.next.0 += 1;
        }
        for (stamp, pose) in self.truth.iter().skip(self.next.1).take_while(|(stamp, _)| *stamp <= until) {
            mcap.truth(stamp, pose)?;
            self.next.1 += 1;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<usize, VioError> {
        self.catch_up(Stamp::from_nanos(i64::MAX))?;
        for (which, names) in self.names.iter().enumerate() {
            let table = asl::write_images(names.iter().map(|(stamp, name)| (*stamp, name.as_str())));
            write_file(&self.root.join(format!("cam{which}/data.csv")), table.as_bytes())?;
        }
        self.mcap.map(McapWriter::finish).transpose()?;
        Ok(self.names.first().map_or(0, Vec::len))
    }
}

/// States at the inertial stamps inside the motion.
fn truth(simulation: &Simulation, recording: &ImuRecording) -> Result<euroc::States, VioError> {
    let (first, last) = simulation.spline().span();
    let mut states = euroc::States::default();
    for stamp in recording.samples.iter().map(|sample| sample.stamp).filter(|stamp| (first..=last).contains(stamp)) {
        let motion = simulation.motion(stamp)?;
        let (gyro, accel) = recording.biases_at(stamp);
        states.trajectory.push(stamp, motion.world_from_body)?;
        states.velocities_in_world.push(motion.velocity_in_world);
        states.gyro_biases.push(gyro);
        states.accel_biases.push(accel);
    }
    Ok(states)
}

/// The motion of a flight; the seed draws the phases of the one through the room.
pub(super) fn flight_spline(flight: &Flight, seconds: f64, seed: u64) -> Result<Spline, VioError> {
    if !(1.0..=3600.0).contains(&seconds) {
        let (name, rule) = ("seconds", "must be between 1 and 3600");
        return Err(vio_ekf::Error::InvalidSetting { name, value: seconds, rule }.into());
    }
    let generated = |pose: &dyn Fn(f64) -> Isometry3<f64>| {
        // The spline begins at its second knot and ends at the last but one.
        let count = (seconds * 1e9 / KNOTS as f64).ceil() as i64 + 3;
        let knots = (0..count).map(|k| pose((k - 1) as f64 * KNOTS as f64 * 1e-9)).collect();
        Spline::new(Stamp::from_nanos(FIRST - KNOTS), KNOTS, knots)
    };
    Ok(match flight {
        Flight::Room => generated(&|t| room_pose(t, seed))?,
        Flight::Wall => generated(&wall_pose)?,
        Flight::File(path) => {
            let whole = read_truth(path)?.trajectory;
            let first = whole.stamps()[0];
            let mut cut = Trajectory::default();
            for (stamp, pose) in whole.iter().take_while(|(stamp, _)| stamp.secs_since(first) <= seconds) {
                cut.push(stamp, *pose)?;
            }
            Spline::from_trajectory(&cut, KNOTS).map_err(|error| VioError::malformed(path, &error))?
        }
    })
}

/// 0 during the rest, then smoothly to 1.
fn share_in_air(t: f64) -> f64 {
    let u = ((t - REST) / TAKE_OFF).clamp(0.0, 1.0);
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

/// The body of the EuRoC vehicle has x up and z forward; here forward is the world's x at heading 0.
fn attitude(heading: f64, roll: f64, pitch: f64) -> UnitQuaternion<f64> {
    let upright = Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0));
    so3::exp(&(Vector3::z() * heading))
        * so3::exp(&Vector3::new(roll, pitch, 0.0))
        * UnitQuaternion::from_rotation_matrix(&upright)
}

/// Two waves per axis that never repeat together, and a heading that swings by a right angle.
fn room_pose(t: f64, seed: u64) -> Isometry3<f64> {
    let away = share_in_air(t);
    // Golden-ratio steps spread the phases of different seeds.
    let phase = |k: u64| {
        std::f64::consts::TAU * ((seed.wrapping_mul(13).wrapping_add(k)) as f64 * 0.618_033_988_749_895).fract()
    };
    let wave = |hertz: f64, k: u64| (std::f64::consts::TAU * hertz * (t - REST) + phase(k)).sin() - phase(k).sin();
    let position = Vector3::new(
        1.3 * wave(0.11, 0) + 0.3 * wave(0.31, 1),
        1.5 * wave(0.09, 2) + 0.3 * wave(0.37, 3),
        0.4 * wave(0.17, 4) + 0.15 * wave(0.41, 5),
    );
    let heading = 0.8 * wave(0.07, 6) + 0.25 * wave(0.19, 7);
    let turn = attitude(away * heading, away * 0.12 * wave(0.29, 8), away * 0.12 * wave(0.33, 9));
    Isometry3::from_parts((position * away + Vector3::z()).into(), turn)
}

/// Rows of 3.6 m, 0.15 m apart, at 1 m/s in the middle of a row.
fn wall_pose(t: f64) -> Isometry3<f64> {
    let away = share_in_air(t);
    let row = std::f64::consts::PI / 3.6;
    let (along, up) = (1.8 * (row * (t - REST)).sin(), 0.15 / 3.6 * (t - REST).max(0.0));
    // Up to the top of the wall and down again.
    let height = 0.9 - (up.rem_euclid(3.6) - 1.8).abs() + 0.9;
    // The robot leans into the way it accelerates.
    let lean = 1.8 * row * row * (row * (t - REST)).sin() / 9.81;
    let breeze = 0.04 * (std::f64::consts::TAU * 0.23 * t).sin();
    let position = Vector3::new(0.06 * (std::f64::consts::TAU * 0.31 * t).sin(), along, 0.8 + height);
    let turn = attitude(away * 0.08 * (0.5 * t).sin(), away * (lean + breeze), away * breeze);
    Isometry3::from_parts((position * away + Vector3::z() * (1.0 - away)).into(), turn)
}
