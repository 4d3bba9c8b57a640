//! The command line of `scan`.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use nalgebra::Isometry3;
use tsdf_hash::loop_closure::LoopSettings;
use tsdf_hash::slam::{Device, OdometryError, PoseSource, SlamSettings};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Intrinsics, NoiseModel};

use super::checkpoint::CheckpointSettings;
use super::imu_file::read_angular_rates;
use super::layouts::open_sequence;
use super::live::LiveSettings;
use super::options::{
    FrameRange, mebibytes, parse_intrinsics, parse_noise, parse_odometry_error, read_body_from_camera,
    read_colour_camera,
};
use super::pose_file::take_poses;
use super::sequence::Sequence;
use super::settings::ScanSettings;
use crate::say;
use crate::socket_address;
use crate::worker_threads::{self, worker_threads};

#[derive(Debug, Clone, Subcommand)]
pub(super) enum Command {
    /// Renders a recording to try: RGB-D images of the built-in wall with noise and true poses, in the layout of 7-Scenes
    Sim(Simulation),
}

/// A recording to try.
#[derive(Debug, Clone, Args)]
pub(super) struct Simulation {
    /// Length of the recording at 30 Hz, seconds
    #[arg(long, default_value_t = 6.0, value_parser = parse_seconds)]
    pub(super) seconds: f64,
    /// Seed of the wall and of the noise
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
    /// Folder for the recording
    #[arg(long, value_name = "DIR", default_value = "out/scan-sim")]
    pub(super) out: PathBuf,
}

fn parse_frames(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|frames| (1..=1000).contains(frames)).ok_or_else(|| "give frames, 1 to 1000".into())
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| *v > 0.0 && *v <= 600.0);
    value.ok_or_else(|| "give seconds, at most 600".into())
}

/// Maps a recorded RGB-D sequence into a voxel-hashed distance field and its mesh.
#[derive(Debug, Clone, Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  scan --sequence recordings/kitchen --voxel 0.01 --out out/kitchen\n  scan sim --out out/recording"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
    /// Folder in the layout of 7-Scenes, TUM, ICL-NUIM or Redwood, or an MCAP file
    #[arg(long, value_name = "PATH", required = true)]
    pub(super) sequence: Option<PathBuf>,
    /// Where the poses come from
    #[arg(long, default_value = "given")]
    pub(super) poses: Poses,
    /// Poses of a TUM file on the clock of the images, as of an odometry, in place of those recorded
    #[arg(long, value_name = "FILE")]
    pub(super) pose_file: Option<PathBuf>,
    /// Samples of an inertial unit on the clock of the images (`imu0/data.csv` of the EuRoC layout): between frames the camera is taken to turn as its gyroscope says
    #[arg(long, value_name = "FILE")]
    pub(super) imu: Option<PathBuf>,
    /// With --pose-file or --imu: where the camera is on what the file follows, the 4x4 matrix `body_from_camera` [default: the file follows the camera]
    #[arg(long, value_name = "FILE")]
    pub(super) body_from_camera: Option<PathBuf>,
    /// With --poses odometry: standard deviations of the recorded motion from one frame to the next, of the turn about each axis and of
    /// the shift along it [default: 0.5,0.01]
    #[arg(long, value_name = "DEGREES,METRES", value_parser = parse_odometry_error)]
    pub(super) odometry_error: Option<[f64; 2]>,
    /// Edge of a voxel, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.01)]
    pub(super) voxel: f64,
    /// Only these frames of the sequence, counted from 0; B is not included
    #[arg(long, value_name = "A..B:STEP", value_parser = FrameRange::parse)]
    pub(super) frames: Option<FrameRange>,
    /// Camera of the depth images, pixels [default: what the recording says]
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse_intrinsics, allow_hyphen_values = true)]
    pub(super) intrinsics: Option<Intrinsics>,
    /// Where the colour camera stands, if the images are not registered: the 4x4 matrix that takes points of the colour
    /// camera to the depth camera, then, if it is another camera, fx fy cx cy
    #[arg(long, value_name = "FILE")]
    pub(super) depth_from_colour: Option<PathBuf>,
    /// Noise of the depth camera, BASE + QUADRATIC (z - NEAREST)^2 metres
    #[arg(long, value_name = "BASE,QUADRATIC,NEAREST", value_parser = parse_noise, default_value = "0.0012,0.0019,0.4")]
    pub(super) noise: NoiseModel,
    /// Units of the depth images per metre [default: the layout's]
    #[arg(long, value_name = "UNITS")]
    pub(super) depth_scale: Option<f64>,
    /// Farthest depth that is fused, metres
    #[arg(long, value_name = "METRES", default_value_t = 6.0)]
    pub(super) max_depth: f64,
    /// How far in front of a surface space counts as free, metres: what has moved away is carved out of the map
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    pub(super) carve: f64,
    /// A stored map to go on from; its voxel size, carving, noise and depth range take the place of those given here. Frames of this
    /// sequence that it holds already are not fused again
    #[arg(long, value_name = "MAP")]
    pub(super) resume: Option<PathBuf>,
    /// A stored map to find the camera in, by the keyframes that were stored with it, and to track it in; the map stays as it is
    #[arg(long, value_name = "MAP", conflicts_with = "resume")]
    pub(super) relocalise: Option<PathBuf>,
    /// With --relocalise: fuse the frames as well, once the camera is found
    #[arg(long, requires = "relocalise")]
    pub(super) extend: bool,
    /// Look for places that were seen before, measure the drift since then, and correct poses and map
    #[arg(long, conflicts_with = "relocalise")]
    pub(super) loops: bool,
    /// Frames that share one ray cast of the map to be tracked against; those between see it from where they are
    #[arg(long, value_name = "FRAMES", default_value_t = 1, value_parser = parse_frames)]
    pub(super) model_every: usize,
    /// Leave connected components of fewer triangles out of the mesh: specks that single readings left; 0: none, and thin things stay whole
    #[arg(long, value_name = "TRIANGLES", default_value_t = 0)]
    pub(super) least_triangles: usize,
    /// What keeps the map
    #[arg(long, default_value = "auto")]
    pub(super) device: DeviceName,
    /// Cap of active memory, MiB
    #[arg(long, value_name = "MIB", default_value_t = 512)]
    pub(super) active_mib: usize,
    /// Cap of the host tier of packed blocks, MiB; 0: none
    #[arg(long, value_name = "MIB", default_value_t = 0)]
    pub(super) host_mib: usize,
    /// Cap of the disk tier, MiB, a file in the folder for the results while the program runs; 0: none
    #[arg(long, value_name = "MIB", default_value_t = 0, requires = "host_mib")]
    pub(super) disk_mib: u64,
    /// Seconds between two times that the map is saved on the way, to be gone on from with --resume after a crash; 0: never
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    pub(super) checkpoint: f64,
    /// Show the run as it goes over Foxglove's WebSocket protocol: to this machine alone, unless an address says otherwise
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:8765",
        value_parser = socket_address::parse
    )]
    pub(super) live: Option<SocketAddr>,
    /// Write what --live shows into scan.mcap in the folder for the results
    #[arg(long)]
    pub(super) record: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/scan")]
    pub(super) out: PathBuf,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Poses {
    /// As recorded with the sequence
    Given,
    /// Found by the tracker, from the first recorded pose, or from the origin
    Tracked,
    /// Found by the tracker, led by the recorded poses as by an odometry: motions from frame to frame, with an error
    Odometry,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum DeviceName {
    /// The GPU where the program was built with it and there is one, else the processor
    Auto,
    /// The processor
    Cpu,
    /// A GPU, Mesa's software one included
    Gpu,
}

/// The recording, with what the command line knows better.
pub(super) fn sequence(arguments: &Arguments) -> Result<Sequence, Box<dyn std::error::Error>> {
    let mut sequence = open_sequence(arguments.recording())?;
    if let Some(scale) = arguments.depth_scale {
        (sequence.depth_scale, sequence.scale_origin) = (scale, "--depth-scale".into());
    }
    if let Some(intrinsics) = arguments.intrinsics {
        (sequence.intrinsics, sequence.camera_origin) = (intrinsics, "--intrinsics".into());
    }
    if let Some(path) = &arguments.depth_from_colour {
        sequence.colour_camera = Some(read_colour_camera(path)?);
    }
    if arguments.body_from_camera.is_some() && arguments.pose_file.is_none() && arguments.imu.is_none() {
        return Err("--body-from-camera: goes with --pose-file or --imu".into());
    }
    let camera = arguments.body_from_camera.as_deref().map(read_body_from_camera).transpose()?;
    let camera = camera.unwrap_or_else(Isometry3::identity);
    if let Some(path) = &arguments.imu {
        if matches!(arguments.poses, Poses::Given) && arguments.relocalise.is_none() {
            return Err("--imu: goes with --poses tracked or odometry, or --relocalise".into());
        }
        let span = sequence.frames.first().zip(sequence.frames.last()).map_or([0.0; 2], |(a, b)| [a.stamp, b.stamp]);
        sequence.angular_rates = read_angular_rates(path, &camera.rotation, span)?;
    }
    if let Some(path) = &arguments.pose_file {
        let found = take_poses(&mut sequence, path, &camera)?;
        say!("{}: poses of {found} of {} frames", path.display(), sequence.frames.len());
    }
    if let Some(range) = &arguments.frames {
        let listed = sequence.frames.len();
        sequence.frames = range.of(sequence.frames);
        if sequence.frames.is_empty() {
            return Err(format!("--frames: the sequence has {listed} frames, none of them is meant").into());
        }
    }
    Ok(sequence)
}

impl Arguments {
    /// The recording; the command line requires it where it has no subcommand.
    pub(super) fn recording(&self) -> &Path {
        self.sequence.as_deref().unwrap_or(Path::new(""))
    }
}

/// How it is mapped.
pub(super) fn settings(arguments: &Arguments) -> Result<ScanSettings, String> {
    let memory = MemoryLimits {
        host_bytes: mebibytes("--host-mib", arguments.host_mib)?,
        disk_bytes: mebibytes("--disk-mib", usize::try_from(arguments.disk_mib).unwrap_or(usize::MAX))? as u64,
        ..MemoryLimits::default()
    };
    let map = tsdf_hash::Settings {
        voxel_size: arguments.voxel,
        max_depth: arguments.max_depth,
        carve: arguments.carve,
        max_bytes: mebibytes("--active-mib", arguments.active_mib)?,
        noise: arguments.noise,
        threads: worker_threads(arguments.threads),
        memory,
        ..tsdf_hash::Settings::default()
    };
    let live =
        LiveSettings { listen: arguments.live, record: arguments.record.then(|| arguments.out.join("scan.mcap")) };
    let shown = live != LiveSettings::default();
    let device = match arguments.device {
        // Eviction and the growing mesh are there for the map on the processor only.
        DeviceName::Auto if arguments.host_mib == 0 && !shown => Device::Auto,
        DeviceName::Gpu => Device::Gpu,
        DeviceName::Auto | DeviceName::Cpu => Device::Cpu,
    };
    let swap = (arguments.disk_mib > 0).then(|| arguments.out.join("map.swap"));
    if arguments.odometry_error.is_some() && !matches!(arguments.poses, Poses::Odometry) {
        return Err("--odometry-error: goes with --poses odometry".into());
    }
    let poses = match arguments.poses {
        // Recorded poses are in another world than that of the stored map.
        Poses::Given if arguments.relocalise.is_none() => PoseSource::Given,
        Poses::Given | Poses::Tracked => PoseSource::Tracked,
        Poses::Odometry => {
            let given = arguments.odometry_error.map(|[turn, shift]| OdometryError { turn, shift });
            PoseSource::Odometry(given.unwrap_or_default())
        }
    };
    let interval = Duration::try_from_secs_f64(arguments.checkpoint)
        .map_err(|e| format!("--checkpoint {}: {e}", arguments.checkpoint))?;
    let checkpoint =
        (!interval.is_zero()).then(|| CheckpointSettings { path: arguments.out.join("map.tsdf"), interval });
    let (resume, relocalise) = (arguments.resume.clone(), arguments.relocalise.clone());
    let fuse = relocalise.is_none() || arguments.extend;
    let loops = arguments.loops.then(LoopSettings::default);
    let checkpoint = checkpoint.filter(|_| fuse);
    let (model_every, least_triangles) = (arguments.model_every, arguments.least_triangles);
    let slam = SlamSettings { map, poses, device, fuse, loops, model_every, ..SlamSettings::default() };
    Ok(ScanSettings { slam, swap, resume, relocalise, checkpoint, least_triangles, live, ..ScanSettings::default() })
}
