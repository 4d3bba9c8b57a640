//! Maps a recorded RGB-D sequence: depth and colour images with poses become a map and a mesh.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use paintcopter_examples::mesh_io::{PlyMesh, write_ply};
use paintcopter_examples::report::save_figures;
use paintcopter_examples::scan::{Device, Scan, ScanReport, ScanSettings, open_sequence, save_views};
use tsdf_hash::MemoryLimits;

/// Maps a recorded RGB-D sequence into a voxel-hashed distance field and its mesh.
#[derive(Parser)]
#[command(version, after_help = "Example:\n  scan --sequence recordings/kitchen --voxel 0.01 --out out/kitchen")]
struct Arguments {
    /// Folder in the layout of 7-Scenes, TUM, ICL-NUIM or Redwood
    #[arg(long, value_name = "DIR")]
    sequence: PathBuf,
    /// Where the poses come from
    #[arg(long, default_value = "given")]
    poses: Poses,
    /// Edge of a voxel, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.01)]
    voxel: f64,
    /// Units of the depth images per metre [default: the layout's]
    #[arg(long, value_name = "UNITS")]
    depth_scale: Option<f64>,
    /// Farthest depth that is fused, metres
    #[arg(long, value_name = "METRES", default_value_t = 6.0)]
    max_depth: f64,
    /// How far in front of a surface space counts as free, metres: what has moved away is carved out of the map
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    carve: f64,
    /// A stored map to go on from; its voxel size, carving and depth range take the place of those given here
    #[arg(long, value_name = "MAP")]
    resume: Option<PathBuf>,
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
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("scan: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let Poses::Given = arguments.poses;
    let folder = &arguments.out;
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("{}: cannot be created ({e}): choose another --out", folder.display()))?;
    let mut sequence = open_sequence(&arguments.sequence)?;
    if let Some(scale) = arguments.depth_scale {
        sequence.depth_scale = scale;
    }
    eprintln!("{}: {} layout, {} frames", arguments.sequence.display(), sequence.layout, sequence.frames.len());
    let settings = settings(arguments);
    let scan = Scan::run(&arguments.sequence, &sequence, &settings)?;
    for (_, why) in &scan.skipped {
        eprintln!("left out: {why}");
    }
    save_views(&scan, &sequence, folder, settings.map.threads)?;
    scan.map.save(&folder.join("map.tsdf"), Some(&scan.mesh), &BTreeMap::new())?;
    let ply = folder.join("mesh.ply");
    let tsdf_hash::Mesh { positions, normals, colours, faces, .. } = &scan.mesh;
    write_ply(&ply, &PlyMesh { positions, normals: Some(normals), colours, faces })
        .map_err(|e| format!("{}: cannot be written ({e})", ply.display()))?;
    let tum = folder.join("trajectory.tum");
    std::fs::write(&tum, vio_ekf::tum::write(&scan.trajectory))
        .map_err(|e| format!("{}: cannot be written ({e})", tum.display()))?;
    // Last, so that its presence means the folder is complete.
    save_figures(&ScanReport::new(&scan), folder)?;
    println!("{}", folder.join("mesh.ply").display());
    Ok(())
}

fn settings(arguments: &Arguments) -> ScanSettings {
    let threads = arguments.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let memory = MemoryLimits {
        host_bytes: arguments.host_mib << 20,
        disk_bytes: arguments.disk_mib << 20,
        ..MemoryLimits::default()
    };
    let map = tsdf_hash::Settings {
        voxel_size: arguments.voxel,
        max_depth: arguments.max_depth,
        carve: arguments.carve,
        max_bytes: arguments.active_mib << 20,
        threads: threads.clamp(1, 1024),
        memory,
        ..tsdf_hash::Settings::default()
    };
    let device = match arguments.device {
        // Eviction is done by the map on the processor only.
        DeviceName::Auto if arguments.host_mib == 0 => Device::Auto,
        DeviceName::Gpu => Device::Gpu,
        DeviceName::Auto | DeviceName::Cpu => Device::Cpu,
    };
    let swap = (arguments.disk_mib > 0).then(|| arguments.out.join("map.swap"));
    ScanSettings { map, device, swap, resume: arguments.resume.clone(), ..ScanSettings::default() }
}
