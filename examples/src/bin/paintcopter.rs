//! Paints a surface end to end: unwrap, decide, plan, fly, spray, report.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use paintcopter_examples::design::{Design, Picture};
use paintcopter_examples::mesh_io::{TriangleMesh, read_mesh};
use paintcopter_examples::mesh_placement::{MeshPlacement, UpAxis, place_mesh};
use paintcopter_examples::mission::{Mission, MissionSettings, PainterChoice, save};
use paintcopter_examples::scan_flight::{ScanFlight, save as save_scan_flight};
use paintcopter_examples::world::rock_wall;

type AnyError = Box<dyn std::error::Error>;

/// Paints a surface with a simulated flying robot: unwraps it, decides what to spray, plans and flies the strokes, and shows
/// what the paint looks like. Without arguments it paints a built-in rock wall.
#[derive(Parser)]
#[command(version, after_help = "Example:\n  paintcopter --mesh bust.obj --design stripes --out out/bust")]
struct Arguments {
    /// Surface to paint, OBJ, PLY or OFF; the built-in rock wall if not given
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Picture on the mesh's own texture coordinates (OBJ): it becomes the design
    #[arg(long, value_name = "PNG", requires = "mesh", conflicts_with = "design")]
    texture: Option<PathBuf>,
    /// Metres per unit of the mesh file [default: the longest side becomes 3 m]
    #[arg(long, requires = "mesh", allow_negative_numbers = true)]
    scale: Option<f64>,
    /// Axis of the mesh file that points up [default: y for OBJ, z otherwise]
    #[arg(long, requires = "mesh")]
    up: Option<Up>,
    /// What to paint: strata, stripes, gradient, colours (of the mesh's vertices), or a PNG or JPEG file
    /// [default: strata on the rock wall, stripes on a mesh]
    #[arg(long)]
    design: Option<String>,
    /// Scan the surface first, with the robot's own camera, inertial sensor and depth camera, and paint what it has mapped
    #[arg(long, conflicts_with = "texture")]
    scan: bool,
    /// Who decides the sprays
    #[arg(long, default_value = "feedback")]
    painter: PainterName,
    /// Paint in layers by intensity, a flight for each [default: one flight whose flow carries the picture]
    #[arg(long)]
    layers: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/paintcopter")]
    out: PathBuf,
    /// Seed of the world, the wind and the errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Worker threads [default: all cores]
    #[arg(long)]
    threads: Option<usize>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Up {
    X,
    Y,
    Z,
}

#[derive(Clone, Copy, ValueEnum)]
enum PainterName {
    /// The network with feedback from its canvas
    Feedback,
    /// The best plan for all sprays at once, by optimisation
    Deconvolution,
    /// One spray after the other
    Pursuit,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("paintcopter: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), AnyError> {
    let folder = &arguments.out;
    std::fs::create_dir_all(folder)
        .map_err(|e| format!("{}: cannot be created ({e}): choose another --out", folder.display()))?;
    let mut settings =
        MissionSettings { seed: arguments.seed, layered: arguments.layers, ..MissionSettings::default() };
    if let Some(threads) = arguments.threads {
        settings.threads = threads.clamp(1, 1024);
    }
    settings.painter = match arguments.painter {
        PainterName::Feedback => PainterChoice::Feedback,
        PainterName::Deconvolution => PainterChoice::Deconvolution,
        PainterName::Pursuit => PainterChoice::Pursuit,
    };
    let mission = match &arguments.mesh {
        None => {
            let design = Design::from_name(arguments.design.as_deref().unwrap_or("strata"), arguments.seed)?;
            let wall = seen(rock_wall(arguments.seed), arguments, settings.threads)?;
            Mission::run("Rock wall", &wall, &design, settings)?
        }
        Some(path) => {
            let in_file = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
            let mesh = seen(load(path, arguments)?, arguments, settings.threads).map_err(|e| in_file(&e))?;
            let design = match &arguments.texture {
                Some(texture) => Design::Texture(Picture::open(texture)?),
                None => Design::from_name(arguments.design.as_deref().unwrap_or("stripes"), arguments.seed)?,
            };
            let name = path.file_stem().map_or("Mesh".into(), |s| s.to_string_lossy());
            Mission::run(&name, &mesh, &design, settings).map_err(|e| in_file(&e))?
        }
    };
    let report = save(&mission, folder)?;
    eprintln!("{}", report.summary());
    println!("{}", folder.join("report.md").display());
    Ok(())
}

/// The mesh that is painted: the true one, or what the robot finds of it.
fn seen(mesh: TriangleMesh, arguments: &Arguments, threads: usize) -> Result<TriangleMesh, AnyError> {
    if !arguments.scan {
        return Ok(mesh);
    }
    let scan_flight = ScanFlight::fly(&mesh, arguments.seed, threads)?;
    save_scan_flight(&scan_flight, &arguments.out)?;
    Ok(scan_flight.mesh)
}

/// Reads and places a mesh.
fn load(path: &Path, arguments: &Arguments) -> Result<TriangleMesh, AnyError> {
    let mut mesh = read_mesh(path)?;
    if arguments.texture.is_some() && mesh.uv.is_none() {
        return Err(format!(
            "{}: has no texture coordinates for --texture; leave it out or use --design",
            path.display()
        )
        .into());
    }
    let is_obj = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let up = match arguments.up {
        Some(Up::X) => UpAxis::X,
        Some(Up::Z) => UpAxis::Z,
        Some(Up::Y) => UpAxis::Y,
        None => {
            if is_obj {
                UpAxis::Y
            } else {
                UpAxis::Z
            }
        }
    };
    let placed = place_mesh(&mut mesh, MeshPlacement { scale: arguments.scale, up })
        .map_err(|e| format!("{}: {e}", path.display()))?;
    let hung = if placed.hung { ", hung like a wall" } else { "" };
    eprintln!("{}: {} faces, scale {:.4}{hung}", path.display(), mesh.faces.len(), placed.scale);
    Ok(mesh)
}
