//! Paper I's Tables 5.1 and 5.2 and Figs. 5.7 and 5.8 on rendered sequences of the same lengths and speeds: dense SLAM, one line per run.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use image::{ExtendedColorType, save_buffer};
use nalgebra::Isometry3;
use paintcopter::exit::run_program;
use paintcopter_benches::slam_sequences::{ALL, Figures, Limits, Published, Sequence, Shot, run};

/// Runs the dense SLAM over rendered sequences and prints how well it did, a JSON line for each run and a table.
#[derive(Parser)]
#[command(after_help = "Example: slam_sequences --sequence fast --voxel 0.01 0.02")]
struct Arguments {
    /// `loopy`, `fast`, `long`, `rotors`, `uav`; all of them if none is named
    #[arg(long)]
    sequence: Vec<String>,
    /// Edges of a voxel, metres
    #[arg(long, num_args = 1.., default_value = "0.01")]
    voxel: Vec<f64>,
    /// Images of each sequence; all by default
    #[arg(long, default_value_t = usize::MAX, hide_default_value = true)]
    frames: usize,
    /// Seed of room, way and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Bounds of active memory, MiB; 0: none. Each is a run
    #[arg(long, num_args = 1.., default_value = "0")]
    active_mib: Vec<usize>,
    /// Threads
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Writes the images of each sequence into a folder of its name there, for `mapping_peers.py slam`
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
}

type AnyError = Box<dyn Error + Send + Sync>;

fn main() -> ExitCode {
    run_program("slam_sequences", |arguments: &Arguments| all(arguments).map_err(|error| -> Box<dyn Error> { error }))
}

fn all(arguments: &Arguments) -> Result<(), AnyError> {
    let named = |sequence: &&Sequence| {
        arguments.sequence.is_empty() || arguments.sequence.iter().any(|name| name == sequence.name)
    };
    let chosen: Vec<&Sequence> = ALL.iter().filter(named).collect();
    if let Some(name) = arguments.sequence.iter().find(|name| ALL.iter().all(|sequence| sequence.name != **name)) {
        let names = ALL.map(|sequence| sequence.name).join(", ");
        return Err(format!("--sequence {name}: they are {names}").into());
    }
    let mut rows = Vec::new();
    for sequence in chosen {
        for &voxel in &arguments.voxel {
            for &mib in &arguments.active_mib {
                let Arguments { frames, seed, threads, .. } = *arguments;
                let active_bytes = (mib > 0).then_some(mib << 20);
                let mut save = Saved::new(arguments.save.as_deref(), sequence)?;
                let limits = Limits { frames, voxel, seed, threads: threads.into(), active_bytes };
                let figures = run(sequence, &limits, &mut |k, time, pose, shot| save.frame(k, time, pose, shot))?;
                println!("{}", serde_json::to_string(&figures)?);
                rows.push(row(&figures, voxel, sequence.published));
            }
        }
    }
    println!(
        "\n| sequence, voxel | tracked | ATE, cm; aligned | paper; ElasticFusion; InfiniTAM | mesh; without specks, mm | paper; ElasticFusion; InfiniTAM | memory, MB; evicted | tracking, fusion, ms |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    println!("{}", rows.join("\n"));
    Ok(())
}

fn row(figures: &Figures, voxel: f64, published: Option<Published>) -> String {
    let cells = |of: fn(&Published) -> [f64; 3]| {
        let cell = |v: f64| if v.is_nan() { "distorted".to_owned() } else { format!("{v}") };
        published.map_or_else(|| "-".to_owned(), |published| of(&published).map(cell).join("; "))
    };
    format!(
        "| {}, {} cm | {} of {} | {:.2}; {:.2} | {} | {:.2} ± {:.2}; {:.2} ± {:.2} | {} | {:.0}; {:.0} | {:.0}, {:.0} |",
        figures.sequence,
        100.0 * voxel,
        figures.tracked,
        figures.frames,
        100.0 * figures.ate_m,
        100.0 * figures.ate_se3_m,
        cells(|published| published.tracking),
        1e3 * figures.mesh_mean_m,
        1e3 * figures.mesh_deviation_m,
        1e3 * figures.mesh_without_specks_m[0],
        1e3 * figures.mesh_without_specks_m[1],
        cells(|published| published.mesh),
        figures.active_bytes as f64 / 1e6,
        figures.evicted_bytes as f64 / 1e6,
        1e3 * figures.tracking_s,
        1e3 * figures.fusion_s,
    )
}

/// The images of a sequence, as `synth_rgbd.py` lays them out.
struct Saved<'a> {
    folder: Option<PathBuf>,
    sequence: &'a Sequence,
    poses: String,
}

impl<'a> Saved<'a> {
    fn new(parent: Option<&Path>, sequence: &'a Sequence) -> Result<Self, AnyError> {
        let folder = parent.map(|parent| parent.join(sequence.name));
        if let Some(folder) = &folder {
            fs::create_dir_all(folder.join("depth"))?;
            fs::create_dir_all(folder.join("rgb"))?;
        }
        Ok(Self { folder, sequence, poses: String::new() })
    }

    fn frame(&mut self, k: usize, time: f64, pose: &Isometry3<f64>, shot: &Shot) -> Result<(), AnyError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let [width, height] = self.sequence.camera.size.map(|size| size as u32);
        let bytes: Vec<u8> = shot.millimetres().iter().flat_map(|z| z.to_ne_bytes()).collect();
        save_buffer(folder.join(format!("depth/{k:04}.png")), &bytes, width, height, ExtendedColorType::L16)?;
        save_buffer(folder.join(format!("rgb/{k:04}.png")), shot.rgb(), width, height, ExtendedColorType::Rgb8)?;
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        writeln!(self.poses, "{time} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w)?;
        Ok(fs::write(folder.join("groundtruth.txt"), &self.poses)?)
    }
}
