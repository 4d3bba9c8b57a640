//! Paints a surface end to end: unwrap, decide, plan, fly, spray, report.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, ValueEnum};
use paint_planner::TimingPolicy;
use paintcopter_examples::design::{Design, Picture};
use paintcopter_examples::mesh_io::{TriangleMesh, read_mesh};
use paintcopter_examples::mesh_placement::{MeshPlacement, UpAxis, place_mesh};
use paintcopter_examples::mission::{Decision, Mission, MissionSettings, PainterChoice, preview, save};
use paintcopter_examples::picture_placement::{PicturePlacement, PlacementMode};
use paintcopter_examples::projection::Viewpoint;
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
    #[command(flatten)]
    placement: Placement,
    /// Scan the surface first, with the robot's own camera, inertial sensor and depth camera, and paint what it has mapped
    #[arg(long, conflicts_with = "texture")]
    scan: bool,
    /// Who decides the sprays
    #[arg(long, default_value = "feedback")]
    painter: PainterName,
    /// Paint in layers by intensity, a flight for each [default: one flight whose flow carries the picture]
    #[arg(long)]
    layers: bool,
    #[command(flatten)]
    nozzle: Nozzle,
    /// Show what it would look like and estimate time, paint and reach; plan and fly nothing
    #[arg(long)]
    preview: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/paintcopter")]
    out: PathBuf,
    /// Seed of the world, the wind and the errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Memory that the mission may need by estimate, GiB
    #[arg(long, value_name = "GIB", value_parser = positive, default_value_t = 8.0)]
    memory_gib: f64,
    /// Worker threads, 1 to 1024 [default: all cores]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// The spray and how it moves.
#[derive(Args)]
struct Nozzle {
    /// Size of a texel, metres [default: 0.0125]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    texel: Option<f64>,
    /// Standard deviation of a spray spot at the stand-off, metres [default: 0.025]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    spot: Option<f64>,
    /// Distance of the nozzle from the surface, metres, within 0.05 to 0.15 [default: 0.1]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    stand_off: Option<f64>,
    /// Speed of the spot over the surface, metres per second [default: 0.4]
    #[arg(long, value_name = "M_PER_S", value_parser = positive)]
    speed: Option<f64>,
    /// Most that the valve gives, litres per minute [default: 0.12]
    #[arg(long, value_name = "L_PER_MIN", value_parser = positive)]
    max_flow: Option<f64>,
}

impl Nozzle {
    fn apply(&self, settings: &mut MissionSettings) {
        settings.texel = self.texel.unwrap_or(settings.texel);
        settings.spot = self.spot.unwrap_or(settings.spot);
        let planner = &mut settings.planner;
        planner.nozzle.stand_off = self.stand_off.unwrap_or(planner.nozzle.stand_off);
        if let Some(speed) = self.speed {
            planner.timing.policy = TimingPolicy::Uniform { speed };
            planner.timing.max_speed = planner.timing.max_speed.max(1.25 * speed);
        }
        planner.timing.max_flow = self.max_flow.map_or(planner.timing.max_flow, |flow| flow * 1e-3 / 60.0);
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| "give a positive number".to_owned())
}

/// Where a picture of --design lies.
#[derive(Args)]
struct Placement {
    /// How large a picture becomes: whole within the surface, covering it, repeated, or stretched over it
    #[arg(long, default_value = "fit")]
    place: PlaceName,
    /// Turn of the picture about its middle, degrees counter-clockwise
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    rotate: f64,
    /// Where the middle of the picture lies beside that of the surface, metres to the right and up
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>, default_value = "0,0", allow_hyphen_values = true)]
    offset: [f64; 2],
    /// Width of the picture, metres; its height follows [default: as --place says]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    size: Option<f64>,
    /// Throw the design onto the surface like a slide: from the front, or from a point X,Y,Z (metres; the robot's side is -x, z
    /// is up) [default: laid over the unwrapped surface]
    #[arg(long, value_name = "front|X,Y,Z", value_parser = viewpoint, allow_hyphen_values = true)]
    project: Option<Viewpoint>,
}

#[derive(Clone, Copy, ValueEnum)]
enum PlaceName {
    Fit,
    Fill,
    Tile,
    Stretch,
}

/// Finite numbers between commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    parsed.and_then(|all| all.try_into().ok()).ok_or_else(|| format!("give {N} numbers with commas between them"))
}

fn viewpoint(text: &str) -> Result<Viewpoint, String> {
    if text == "front" {
        return Ok(Viewpoint::Front);
    }
    let point = numbers::<3>(text).map_err(|error| format!("{error}, or front"))?;
    Ok(Viewpoint::Point(point.into()))
}

impl Placement {
    fn picture(&self) -> Result<PicturePlacement, String> {
        if !self.rotate.is_finite() {
            return Err(format!("--rotate {}: give an angle in degrees", self.rotate));
        }
        let mode = match self.place {
            PlaceName::Fit => PlacementMode::Fit,
            PlaceName::Fill => PlacementMode::Fill,
            PlaceName::Tile => PlacementMode::Tile,
            PlaceName::Stretch => PlacementMode::Stretch,
        };
        Ok(PicturePlacement { mode, rotate: self.rotate.to_radians(), offset: self.offset, size: self.size })
    }
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
    settings.memory_gib = arguments.memory_gib;
    arguments.nozzle.apply(&mut settings);
    settings.placement = arguments.placement.picture()?;
    settings.viewpoint = arguments.placement.project;
    if let Some(threads) = arguments.threads {
        settings.threads = usize::from(threads);
    }
    settings.painter = match arguments.painter {
        PainterName::Feedback => PainterChoice::Feedback,
        PainterName::Deconvolution => PainterChoice::Deconvolution,
        PainterName::Pursuit => PainterChoice::Pursuit,
    };
    let decision = match &arguments.mesh {
        None => {
            let design = Design::from_name(arguments.design.as_deref().unwrap_or("strata"), arguments.seed)?;
            let wall = seen(rock_wall(arguments.seed), arguments, settings.threads)?;
            Decision::make("Rock wall", &wall, &design, settings)?
        }
        Some(path) => {
            let in_file = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
            let mesh = seen(load(path, arguments)?, arguments, settings.threads).map_err(|e| in_file(&e))?;
            let design = match &arguments.texture {
                Some(texture) => Design::Texture(Picture::open(texture)?),
                None => Design::from_name(arguments.design.as_deref().unwrap_or("stripes"), arguments.seed)?,
            };
            let name = path.file_stem().map_or("Mesh".into(), |s| s.to_string_lossy());
            Decision::make(&name, &mesh, &design, settings).map_err(|e| in_file(&e))?
        }
    };
    if arguments.preview {
        let found = preview(&decision, folder)?;
        eprintln!("{}", found.summary());
        println!("{}", folder.join("preview.png").display());
        return Ok(());
    }
    let mission = Mission::run(decision).map_err(|error| match &arguments.mesh {
        Some(path) => format!("{}: {error}", path.display()),
        None => error.to_string(),
    })?;
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
