//! Prints for our libraries the figures that `peers/*.py` print for others: one JSON object per line, same names.

use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use nalgebra::{Matrix2, Vector2, Vector3};
use paint_sim::colour::BANDS;
use paint_sim::colour::ciede2000;
use paintcopter::mesh_io::read_mesh;
use paintcopter::world::rock_wall;
use paintcopter_benches::cpu::{CpuTimer, median_seconds};
use paintcopter_benches::{
    Rng, calibration, colours, control, droplet_rays, films, fuzzed_meshes, motion, painting, planner, pose_graphs,
    room, split_meshes, vocabulary,
};
use serde_json::json;
use uv_param::cut::CutSettings;
use uv_param::{Chart, Method, Settings, largest_disk, unwrap, unwrap_with_cuts};
use vio_ekf::Trajectory;
use vio_ekf::eval::{Alignment, Association, ate};
use vio_ekf::format::tum;

type AnyError = Box<dyn Error>;

/// Prints for the PaintCopter libraries what peers/*.py print for others, one JSON object per line.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    /// Writes the built-in rock wall, so that peers can work on it
    Rock {
        /// OBJ file to write
        file: PathBuf,
        /// Which wall
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Unwraps the largest disk of a mesh, as `uv_peers.py disk` does, and once more with cuts
    Uv {
        /// OBJ, PLY or OFF
        mesh: PathBuf,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 3)]
        runs: usize,
        /// Folder for OBJ files with texture coordinates, for `uv_evaluation.py`
        #[arg(long, value_name = "DIR")]
        save: Option<PathBuf>,
    },
    /// Lays out broken meshes of all kinds as atlases, and counts what should not be
    Fuzz {
        /// Seed of the first mesh
        #[arg(long, default_value_t = 0)]
        first: u64,
        /// Meshes
        #[arg(long, default_value_t = 10_000)]
        count: u64,
    },
    /// Lays out a mesh as an atlas, and again with its faces split into four
    Split {
        /// OBJ, PLY or OFF
        mesh: PathBuf,
        /// Times that faces are split
        #[arg(long, default_value_t = 2)]
        splits: u32,
    },
    /// Paints pictures with every painter, as `paint_baselines.py painters slew noise` does
    Paint {
        /// Pictures, or folders of them [default: the procedural ones, `--set procedural` of the script]
        #[arg(long, value_name = "PATH")]
        image: Vec<PathBuf>,
        /// Side of the pictures, pixels
        #[arg(long, default_value_t = 128, value_parser = clap::value_parser!(u16).range(16..=2048))]
        size: u16,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 3)]
        runs: usize,
        /// The feedback network alone, with this many passes
        #[arg(long, value_name = "PASSES")]
        passes: Option<usize>,
    },
    /// Paints pictures in several paints, as `paint_baselines.py colour` does
    Colour {
        /// Pictures, or folders of them
        #[arg(long, value_name = "PATH", required = true)]
        image: Vec<PathBuf>,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 3)]
        runs: usize,
    },
    /// Films and colours, as `sim_peers.py` computes
    Sim {
        /// Films, and colours
        #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
        count: u32,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 5)]
        runs: usize,
    },
    /// Casts droplets as rays, and writes mesh and rays for `droplet_peers.py`
    Droplets {
        /// Folder to write into
        folder: PathBuf,
        /// Distance of the nozzle from the wall, metres
        #[arg(long, default_value_t = 0.1)]
        stand_off: f64,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 5)]
        runs: usize,
    },
    /// Calibrates a spray from bursts and a paint from a chart, and writes both for `calibration_peers.py`
    Calibration {
        /// Folder to write into
        folder: PathBuf,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 5)]
        runs: usize,
    },
    /// Fuses a stream of `synth_rgbd.py`, as `mapping_peers.py fuse` does
    Tsdf {
        /// Folder of the stream
        stream: PathBuf,
        /// Edge of a voxel, metres
        #[arg(long, default_value_t = 0.01)]
        voxel: f64,
        /// Images to use
        #[arg(long, default_value_t = usize::MAX)]
        frames: usize,
        /// Threads of one call
        #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
        threads: u16,
        /// Leaves the colour images aside
        #[arg(long)]
        no_colour: bool,
        /// Mesh to write, PLY, for `mapping_peers.py mesh`
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// Writes two trajectories of 10,000 poses as TUM text, for `ate` and `trajectory_peers.py`
    Pair {
        /// Folder to write into
        folder: PathBuf,
    },
    /// Writes two pose graphs as g2o text, for `graph` and `pose_graph_peers.py`
    GraphWorlds {
        /// Folder to write into
        folder: PathBuf,
    },
    /// Optimises a pose graph, as `pose_graph_peers.py` does
    Graph {
        /// g2o text
        file: PathBuf,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 5)]
        runs: usize,
    },
    /// Trains the visual words that `tsdf-hash` comes with, on rendered rooms
    Vocabulary {
        /// File to write: `tsdf-hash/src/place_recognition/vocabulary.bin`
        file: PathBuf,
        /// Which rooms
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Writes the planner's programs as `NumPy` arrays, for `planner_peers.py`
    PlannerInstances {
        /// Folder to write into
        folder: PathBuf,
    },
    /// Plans: time and quality of the programs as `planner_peers.py` has them, and of the rest
    Planner {
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 5)]
        runs: usize,
        /// Only figures whose name contains this
        #[arg(long)]
        only: Option<String>,
    },
    /// Flies a stroke over the rock in gusts and with faults: errors of the spray, what a control step takes, and the valve
    Control,
    /// Identifies how the attitude follows its commands in a recording
    Attitude {
        /// CSV with a header: time (s), commanded and measured angle (rad)
        file: PathBuf,
    },
    /// Errors of a TUM trajectory against another, as `trajectory_peers.py` does
    Ate {
        /// TUM text
        reference: PathBuf,
        /// TUM text
        estimate: PathBuf,
        /// Runs of which the median is printed
        #[arg(long, default_value_t = 5)]
        runs: usize,
    },
}

fn main() -> ExitCode {
    let done = match Arguments::parse().job {
        Job::Rock { file, seed } => rock(&file, seed),
        Job::Uv { mesh, runs, save } => uv(&mesh, runs, save.as_deref()),
        Job::Fuzz { first, count } => fuzzed_meshes::run(first, count),
        Job::Split { mesh, splits } => split_meshes::run(&mesh, splits),
        Job::Paint { image, size, runs, passes: Some(passes) } => {
            painting::run_feedback(&image, size.into(), runs, passes)
        }
        Job::Paint { image, size, runs, passes: None } => painting::run(&image, size.into(), runs),
        Job::Colour { image, runs } => colours::run(&image, runs),
        Job::Calibration { folder, runs } => calibration::run(&folder, runs),
        Job::Droplets { folder, stand_off, runs } => droplet_rays::print(&folder, stand_off, runs),
        Job::Sim { count, runs } => sim(count as usize, runs),
        Job::Tsdf { stream, voxel, frames, threads, no_colour, out } => {
            tsdf(&stream, voxel, frames, threads.into(), !no_colour, out.as_deref())
        }
        Job::Pair { folder } => pair(&folder),
        Job::GraphWorlds { folder } => pose_graphs::write(&folder),
        Job::Graph { file, runs } => pose_graphs::run(&file, runs),
        Job::Vocabulary { file, seed } => vocabulary::run(&file, seed),
        Job::PlannerInstances { folder } => planner::write(&folder),
        Job::Planner { runs, only } => planner::run(runs, only.as_deref().unwrap_or("")),
        Job::Control => control::run(),
        Job::Attitude { file } => control::attitude(&file),
        Job::Ate { reference, estimate, runs } => trajectory_errors(&reference, &estimate, runs),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("library_figures: {error}");
            ExitCode::FAILURE
        }
    }
}

fn rock(file: &Path, seed: u64) -> Result<(), AnyError> {
    let mesh = rock_wall(seed);
    let mut text = String::new();
    for [x, y, z] in &mesh.positions {
        writeln!(text, "v {x} {y} {z}")?;
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|i| i + 1);
        writeln!(text, "f {a} {b} {c}")?;
    }
    write(file, &text)
}

fn uv(path: &Path, runs: usize, save: Option<&Path>) -> Result<(), AnyError> {
    let mesh = read_mesh(path)?;
    let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.map(f64::from)).collect();
    let (disk, _) = largest_disk(&positions, &mesh.faces)?;
    let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    println!(
        "{}",
        json!({ "mesh": name, "fig": "mesh", "vertices": disk.positions().len(), "faces": disk.faces().len() })
    );
    for (fig, method) in
        [("auto", Method::Auto), ("arap", Method::Arap), ("symmetric_dirichlet", Method::SymmetricDirichlet)]
    {
        let settings = Settings { method, ..Settings::default() };
        let chart = unwrap(&disk, &settings, |_| ())?;
        let seconds = median_seconds(runs, || unwrap(&disk, &settings, |_| ()));
        let q = chart.quality();
        println!(
            "{}",
            json!({
                "mesh": name, "fig": format!("uv-param_{fig}"), "s": seconds, "runs": runs.max(1),
                "iters": q.iterations, "arap": q.arap, "sd": q.symmetric_dirichlet, "flips": q.flips,
                "p99_stretch": q.stretch_p99, "max_stretch": q.stretch_max,
            })
        );
        if let Some(folder) = save {
            std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
            let stem = path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            write(&folder.join(format!("{stem}_uv-param_{fig}.obj")), &textured(&chart)?)?;
        }
    }
    let (settings, cuts) = (Settings::default(), CutSettings::default());
    let chart = unwrap_with_cuts(&disk, &settings, &cuts, |_| ())?;
    let seconds = median_seconds(runs, || unwrap_with_cuts(&disk, &settings, &cuts, |_| ()));
    let q = chart.quality();
    println!(
        "{}",
        json!({
            "mesh": name, "fig": "uv-param_cuts", "s": seconds, "runs": runs.max(1), "cuts": q.cuts,
            "seam_ratio": q.seam_length_m / q.area_m2.sqrt(), "sd": q.symmetric_dirichlet,
            "within_1.5": share_within(&chart, 1.5), "within_1.6": share_within(&chart, 1.6),
            "overlap_area_frac": q.overlap_share, "length_err_mean": q.length_err_mean, "length_err_p99": q.length_err_p99,
        })
    );
    Ok(())
}

/// Share of the area whose stretch `max(s1, 1 / s2)` is at most a bound.
fn share_within(chart: &Chart, bound: f64) -> f64 {
    let (mut within, mut all) = (0.0, 0.0);
    for face in chart.disk().faces() {
        let [p, q, r] = face.map(|i| Vector3::from(chart.disk().positions()[i as usize]));
        let [a, b, c] = face.map(|i| Vector2::from(chart.uv()[i as usize]));
        let (edge, other) = (q - p, r - p);
        let normal = edge.cross(&other);
        let along = edge.normalize();
        let across = normal.normalize().cross(&along);
        let plane = Matrix2::new(edge.norm(), other.dot(&along), 0.0, other.dot(&across));
        let Some(inverse) = plane.try_inverse() else { continue };
        let stretch = (Matrix2::from_columns(&[b - a, c - a]) * inverse).singular_values();
        all += normal.norm();
        if stretch.max().max(1.0 / stretch.min()) <= bound {
            within += normal.norm();
        }
    }
    within / all
}

/// A chart as an OBJ with texture coordinates in metres.
fn textured(chart: &Chart) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    for [x, y, z] in chart.disk().positions() {
        writeln!(text, "v {x} {y} {z}")?;
    }
    for [u, v] in chart.uv() {
        writeln!(text, "vt {u} {v}")?;
    }
    for face in chart.disk().faces() {
        let [a, b, c] = face.map(|i| i + 1);
        writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}")?;
    }
    Ok(text)
}

fn sim(count: usize, runs: usize) -> Result<(), AnyError> {
    let print = |fig: &str, seconds: f64| {
        let (runs, cpu_ms) = (runs.max(1), 1e3 * seconds);
        println!("{}", json!({ "fig": fig, "peer": "paint-sim", "count": count, "runs": runs, "cpu_ms": cpu_ms }));
    };
    let films = films::Films::new(count)?;
    let mut narrow = vec![[0.0; BANDS]; count];
    print("km_f32_x36", median_seconds(runs, || films.narrow(black_box(&mut narrow))));
    let mut wide = vec![[0.0; BANDS]; count];
    let mut colours = vec![[0; 3]; count];
    films.srgb8(&mut colours)?;
    print("km_srgb8_x36", median_seconds(runs, || films.srgb8(black_box(&mut colours))));
    print("km_f64_x36", median_seconds(runs, || films.wide(black_box(&mut wide))));

    let mut rng = Rng::new(4);
    let mut lab = || [rng.between(0.0, 100.0), rng.between(-80.0, 80.0), rng.between(-80.0, 80.0)];
    let pairs: Vec<[[f64; 3]; 2]> = (0..count).map(|_| [lab(), lab()]).collect();
    let difference = || pairs.iter().map(|[one, other]| ciede2000(*one, *other)).sum::<f64>();
    print("de00", median_seconds(runs, difference));
    Ok(())
}

fn tsdf(
    folder: &Path,
    voxel_size: f64,
    most: usize,
    threads: usize,
    coloured: bool,
    out: Option<&Path>,
) -> Result<(), AnyError> {
    let frames = room::read(folder, most, coloured)?;
    let settings = tsdf_hash::Settings { voxel_size, threads, max_bytes: 4 << 30, ..tsdf_hash::Settings::default() };
    let mut map = tsdf_hash::Map::new(settings)?;
    let empty = map.hash();
    let (mut fused, mut valid) = (0, 0);
    let mut timers = [CpuTimer::default(), CpuTimer::default()];
    for frame in &frames {
        let colour = frame.colour();
        let report = timers[0].time(|| map.integrate(&frame.view(), colour.as_ref(), &frame.world_from_camera))?;
        fused += report.fused_pixels;
        valid += report.valid_pixels;
    }
    let (blocks, hash) = (map.blocks(), map.hash());
    let mesh = map.mesh();
    if let Some(path) = out {
        let file = std::fs::File::create(path).map_err(|e| format!("{}: {e}", path.display()))?;
        tsdf_hash::mesh::write_ply(&mesh, std::io::BufWriter::new(file))?;
    }
    for frame in &frames {
        let colour = frame.colour();
        timers[1].time(|| map.deintegrate(&frame.view(), colour.as_ref(), &frame.world_from_camera))?;
    }
    let [put_in, taken_out] = timers;
    println!(
        "{}",
        json!({
            "figure": "fuse", "peer": "tsdf-hash", "voxel_m": voxel_size, "threads": threads, "frames": frames.len(),
            "stream": folder.file_name().map(|name| name.to_string_lossy()), "colour": coloured,
            "integrate_cpu_ms": put_in.cpu_ms(), "integrate_wall_ms": put_in.wall_ms(),
            "deintegrate_cpu_ms": taken_out.cpu_ms(), "fused_share": fused as f64 / valid as f64, "blocks": blocks,
            "map_hash": format!("{hash:016x}"), "verts": mesh.positions.len(), "tris": mesh.faces.len(),
            "empty_again": map.hash() == empty,
        })
    );
    Ok(())
}

fn pair(folder: &Path) -> Result<(), AnyError> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let (reference, estimate) = motion::pair(10_000)?;
    write(&folder.join("reference.txt"), &tum::write(&reference))?;
    write(&folder.join("estimate.txt"), &tum::write(&estimate))
}

fn trajectory_errors(reference: &Path, estimate: &Path, runs: usize) -> Result<(), AnyError> {
    let read = |path: &Path| -> Result<Trajectory, AnyError> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        tum::read(&text).map_err(|e| format!("{}: {e}", path.display()).into())
    };
    let (reference, estimate) = (read(reference)?, read(estimate)?);
    let run = |mode| {
        let pairs = Association::default().pair_up(&reference, &estimate)?;
        Ok::<_, vio_ekf::Error>((pairs.stamps.len(), ate(&pairs.reference, &pairs.estimate, mode)?))
    };
    for (name, mode) in [("none", Alignment::None), ("se3", Alignment::Se3), ("sim3", Alignment::Sim3)] {
        let (pairs, error) = run(mode)?;
        let cpu_ms = 1e3 * median_seconds(runs, || run(mode));
        let (rmse_m, rmse_deg) = (error.position.rmse, error.orientation.rmse.to_degrees());
        println!(
            "{}",
            json!({
                "fig": format!("ate_{name}"), "peer": "vio-ekf", "pairs": pairs, "rmse_m": rmse_m, "rmse_deg": rmse_deg,
                "cpu_ms": cpu_ms,
            })
        );
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), AnyError> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()).into())
}
