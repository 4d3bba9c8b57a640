//! Maps a recorded RGB-D sequence: depth and colour images, with poses or without, become a map and a mesh.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use nalgebra::Isometry3;
use paintcopter::exit::exit_code;
use paintcopter::mesh_io::{PlyMesh, write_ply};
use paintcopter::report::save_figures;
use paintcopter::scan::{
    CheckpointSettings, Device, FrameRange, Gyroscope, LiveSettings, OdometryError, PoseSource, Scan, ScanReport,
    ScanSettings, Sequence, in_options, mebibytes, open_sequence, parse_intrinsics, parse_noise, parse_odometry_error,
    read_body_from_camera, read_colour_camera, save_views, take_poses,
};
use tsdf_hash::{Intrinsics, MemoryLimits, NoiseModel};

/// Maps a recorded RGB-D sequence into a voxel-hashed distance field and its mesh.
#[derive(Parser)]
#[command(version, after_help = "Example:\n  scan --sequence recordings/kitchen --voxel 0.01 --out out/kitchen")]
struct Arguments {
    /// Folder in the layout of 7-Scenes, TUM, ICL-NUIM or Redwood, or an MCAP file
    #[arg(long, value_name = "PATH")]
    sequence: PathBuf,
    /// Where the poses come from
    #[arg(long, default_value = "given")]
    poses: Poses,
    /// Poses of a TUM file on the clock of the images, as of an odometry, in place of those recorded
    #[arg(long, value_name = "FILE")]
    pose_file: Option<PathBuf>,
    /// Samples of an inertial unit on the clock of the images (`imu0/data.csv` of the EuRoC layout): between frames the camera is taken to turn as its gyroscope says
    #[arg(long, value_name = "FILE")]
    imu: Option<PathBuf>,
    /// With --pose-file or --imu: where the camera is on what the file follows, the 4x4 matrix `body_from_camera` [default: the file follows the camera]
    #[arg(long, value_name = "FILE")]
    body_from_camera: Option<PathBuf>,
    /// With --poses odometry: standard deviations of the recorded motion from one frame to the next, of the turn about each axis and of
    /// the shift along it [default: 0.5,0.01]
    #[arg(long, value_name = "DEGREES,METRES", value_parser = parse_odometry_error)]
    odometry_error: Option<[f64; 2]>,
    /// Edge of a voxel, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.01)]
    voxel: f64,
    /// Only these frames of the sequence, counted from 0; B is not included
    #[arg(long, value_name = "A..B:STEP", value_parser = FrameRange::parse)]
    frames: Option<FrameRange>,
    /// Camera of the depth images, pixels [default: what the recording says]
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse_intrinsics, allow_hyphen_values = true)]
    intrinsics: Option<Intrinsics>,
    /// Where the colour camera stands, if the images are not registered: the 4x4 matrix that takes points of the colour
    /// camera to the depth camera, then, if it is another camera, fx fy cx cy
    #[arg(long, value_name = "FILE")]
    depth_from_colour: Option<PathBuf>,
    /// Noise of the depth camera, BASE + QUADRATIC (z - NEAREST)^2 metres
    #[arg(long, value_name = "BASE,QUADRATIC,NEAREST", value_parser = parse_noise, default_value = "0.0012,0.0019,0.4")]
    noise: NoiseModel,
    /// Units of the depth images per metre [default: the layout's]
    #[arg(long, value_name = "UNITS")]
    depth_scale: Option<f64>,
    /// Farthest depth that is fused, metres
    #[arg(long, value_name = "METRES", default_value_t = 6.0)]
    max_depth: f64,
    /// How far in front of a surface space counts as free, metres: what has moved away is carved out of the map
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    carve: f64,
    /// A stored map to go on from; its voxel size, carving, noise and depth range take the place of those given here. Frames of this
    /// sequence that it holds already are not fused again
    #[arg(long, value_name = "MAP")]
    resume: Option<PathBuf>,
    /// A stored map to find the camera in, by the keyframes that were stored with it, and to track it in; the map stays as it is
    #[arg(long, value_name = "MAP", conflicts_with = "resume")]
    relocalise: Option<PathBuf>,
    /// With --relocalise: fuse the frames as well, once the camera is found
    #[arg(long, requires = "relocalise")]
    extend: bool,
    /// Look for places that were seen before, measure the drift since then, and correct poses and map
    #[arg(long, conflicts_with = "relocalise")]
    loops: bool,
    /// What keeps the map
    #[arg(long, default_value = "auto")]
    device: DeviceName,
    /// Cap of active memory, MiB
    #[arg(long, value_name = "MIB", default_value_t = 512)]
    active_mib: usize,
    /// Cap of the host tier of packed blocks, MiB; 0: none
    #[arg(long, value_name = "MIB", default_value_t = 0)]
    host_mib: usize,
    /// Cap of the disk tier, MiB, a file in the folder for the results while the program runs; 0: none
    #[arg(long, value_name = "MIB", default_value_t = 0, requires = "host_mib")]
    disk_mib: u64,
    /// Seconds between two times that the map is saved on the way, to be gone on from with --resume after a crash; 0: never
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    checkpoint: f64,
    /// Show the run as it goes over Foxglove's WebSocket protocol: to this machine alone, unless an address says otherwise
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    live: Option<SocketAddr>,
    /// Write what --live shows into scan.mcap in the folder for the results
    #[arg(long)]
    record: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/scan")]
    out: PathBuf,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long)]
    threads: Option<usize>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Poses {
    /// As recorded with the sequence
    Given,
    /// Found by the tracker, from the first recorded pose, or from the origin
    Tracked,
    /// Found by the tracker, led by the recorded poses as by an odometry: motions from frame to frame, with an error
    Odometry,
}

#[derive(Clone, Copy, ValueEnum)]
enum DeviceName {
    /// The GPU where the program was built with it and there is one, else the processor
    Auto,
    /// The processor
    Cpu,
    /// A GPU, Mesa's software one included
    Gpu,
}

fn main() -> ExitCode {
    exit_code("scan", run(&Arguments::parse()).map_err(|error| in_options(&error.to_string())))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let folder = &arguments.out;
    prepare(folder)?;
    let sequence = sequence(arguments)?;
    eprintln!("{}: {} layout, {} frames", arguments.sequence.display(), sequence.layout, sequence.frames.len());
    eprintln!("{:28} {}", "camera", sequence.description());
    let settings = settings(arguments)?;
    let scan = Scan::run(&arguments.sequence, &sequence, &settings)?;
    for (_, why) in &scan.skipped {
        eprintln!("left out: {}", in_options(why));
    }
    // What cannot be made again comes first, pictures last.
    let map = folder.join("map.tsdf");
    scan.map.save(&map, Some(&scan.mesh), &scan.metadata(&arguments.sequence, &sequence))?;
    let ply = folder.join("mesh.ply");
    let tsdf_hash::Mesh { positions, normals, colours, faces, .. } = &scan.mesh;
    write_ply(&ply, &PlyMesh { positions, normals: Some(normals), colours, faces })
        .map_err(|e| format!("{}: cannot be written ({e})", ply.display()))?;
    let tum = folder.join("trajectory.tum");
    std::fs::write(&tum, vio_ekf::tum::write(&scan.trajectory))
        .map_err(|e| format!("{}: cannot be written ({e})", tum.display()))?;
    save_views(&scan, &sequence, folder, settings.map.threads)?;
    // Last, so that its presence means the folder is complete.
    save_figures(&ScanReport::new(&scan, &sequence), folder)?;
    println!("{}", folder.join("mesh.ply").display());
    scan.verdict(&sequence)?;
    Ok(())
}

/// Makes the folder, and tries it before any work is done.
fn prepare(folder: &Path) -> Result<(), String> {
    let refuse = |e: std::io::Error| format!("{}: cannot be written to ({e}): choose another --out", folder.display());
    std::fs::create_dir_all(folder).map_err(refuse)?;
    let probe = folder.join(".tried");
    std::fs::write(&probe, b"").map_err(refuse)?;
    std::fs::remove_file(&probe).map_err(refuse)?;
    // A report of an earlier run would say that this one is complete.
    match std::fs::remove_file(folder.join("report.json")) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(refuse(e)),
        _ => Ok(()),
    }
}

/// The recording, with what the command line knows better.
fn sequence(arguments: &Arguments) -> Result<Sequence, Box<dyn std::error::Error>> {
    let mut sequence = open_sequence(&arguments.sequence)?;
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
        sequence.gyroscope = Some(Gyroscope::read(path, &camera.rotation, span)?);
    }
    if let Some(path) = &arguments.pose_file {
        let found = take_poses(&mut sequence, path, &camera)?;
        eprintln!("{}: poses of {found} of {} frames", path.display(), sequence.frames.len());
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

fn settings(arguments: &Arguments) -> Result<ScanSettings, String> {
    let threads = arguments.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
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
        threads: threads.clamp(1, 1024),
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
            let deviations = arguments.odometry_error.unwrap_or([0.5_f64.to_radians(), 0.01]);
            PoseSource::Odometry(OdometryError { deviations })
        }
    };
    let interval = Duration::try_from_secs_f64(arguments.checkpoint)
        .map_err(|e| format!("--checkpoint {}: {e}", arguments.checkpoint))?;
    let checkpoint =
        (!interval.is_zero()).then(|| CheckpointSettings { path: arguments.out.join("map.tsdf"), interval });
    let (resume, relocalise) = (arguments.resume.clone(), arguments.relocalise.clone());
    let (fuse, loops) = (relocalise.is_none() || arguments.extend, arguments.loops);
    let checkpoint = checkpoint.filter(|_| fuse);
    Ok(ScanSettings {
        map,
        poses,
        device,
        swap,
        resume,
        relocalise,
        fuse,
        loops,
        checkpoint,
        live,
        ..ScanSettings::default()
    })
}
