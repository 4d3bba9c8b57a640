//! The options that say what to paint: those of `paintcopter` and `plan`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use paint_planner::timing::TimingPolicy;

use crate::mesh_placement::UpAxis;
use crate::mission::{LocalisationChoice, MissionSettings, PainterChoice};
use crate::mission_file::MissionFile;
use crate::picture_placement::{PicturePlacement, PlacementMode};
use crate::projection::Viewpoint;
use crate::region::Region;

type AnyError = Box<dyn std::error::Error>;

/// What an even coat keeps of the tilt joint's range beyond what every mission does: three degrees, in radians.
const COAT_MARGIN: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// What stands in a mission file.
const MISSION: [&str; 24] = [
    "mesh",
    "texture",
    "scale",
    "up",
    "region",
    "design",
    "fill",
    "scan",
    "localisation",
    "look",
    "painter",
    "layers",
    "seed",
    "memory_gib",
    "texel",
    "spot",
    "stand_off",
    "speed",
    "max_flow",
    "place",
    "rotate",
    "offset",
    "size",
    "project",
];

/// What to paint on what, and how.
#[derive(Args)]
pub struct MissionArguments {
    /// Fly a mission again: mission.toml of an earlier run, or one of your own
    #[arg(long, value_name = "FILE", conflicts_with_all = MISSION)]
    mission: Option<PathBuf>,
    /// Surface to paint, OBJ, glTF (.glb, .gltf), PLY or OFF; the built-in rock wall if not given
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Picture on the mesh's own texture coordinates (OBJ, glTF): it becomes the design
    #[arg(long, value_name = "PNG", requires = "mesh", conflicts_with = "design")]
    texture: Option<PathBuf>,
    /// Metres per unit of the mesh file [default: the longest side becomes 3 m]
    #[arg(long, requires = "mesh", allow_negative_numbers = true)]
    scale: Option<f64>,
    /// Axis of the mesh file that points up: x, y, z, or any direction X,Y,Z [default: y for OBJ and glTF, z otherwise]
    #[arg(long, requires = "mesh", value_name = "x|y|z|X,Y,Z", value_parser = up_axis, allow_hyphen_values = true)]
    up: Option<UpAxis>,
    /// Paint only a part of the mesh; the rest stays in the way. In the coordinates of the mesh file: box:x0,y0,z0,x1,y1,z1,
    /// plane:px,py,pz,nx,ny,nz,RADIUS, pick:px,py,pz (as far as no crease), or mask:PNG on its texture coordinates. The mesh is a
    /// place in metres then, unless --scale says otherwise
    #[arg(long, requires = "mesh", conflicts_with = "scan")]
    region: Option<Region>,
    /// What to paint: strata, stripes, gradient, colours (of the mesh's vertices), materials (the pictures
    /// that the mesh file or its MTL names), or a PNG, JPEG or SVG file
    /// [default: strata on the rock wall, materials on a mesh that has pictures, else stripes]
    #[arg(long)]
    design: Option<String>,
    /// Cover all that is in reach with a coat of this thickness, micrometres from 1 to 60
    #[arg(long, value_name = "MICROMETRES", value_parser = positive, conflicts_with_all = ["design", "texture"])]
    fill: Option<f64>,
    #[command(flatten)]
    placement: Placement,
    /// Scan the surface first, with the robot's own camera, inertial sensor and depth camera, and paint what it has mapped
    #[arg(long, conflicts_with = "texture")]
    scan: bool,
    /// What tells the painting flight where the robot is: motion capture, a model of noise of 7 cm, or the robot's own camera, depth camera and
    /// inertial sensor in the map of its --scan [default: motion-capture]
    #[arg(long, value_enum, default_value = "motion-capture")]
    localisation: LocalisationName,
    /// Fly along the painted surface, look at it, and paint again what is missing
    #[arg(long)]
    look: bool,
    /// Who decides the sprays [default: feedback; fill with --fill]
    #[arg(long)]
    painter: Option<PainterName>,
    /// Paint in layers by intensity, a flight for each [default: one flight whose flow carries the picture]
    #[arg(long)]
    layers: bool,
    #[command(flatten)]
    nozzle: Nozzle,
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

fn up_axis(text: &str) -> Result<UpAxis, String> {
    Ok(match text {
        "x" => UpAxis::X,
        "y" => UpAxis::Y,
        "z" => UpAxis::Z,
        direction => UpAxis::Direction(numbers(direction).map_err(|error| format!("{error}, or x, y, z"))?),
    })
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
enum LocalisationName {
    MotionCapture,
    Noise,
    Slam,
}

#[derive(Clone, Copy, ValueEnum)]
enum PainterName {
    /// The network with feedback from its canvas
    Feedback,
    /// The best plan for all sprays at once, by optimisation
    Deconvolution,
    /// The same with strokes along the lines of the picture, for text and line art
    Centrelines,
    /// Rows that cover whole regions, as few as the spray allows, with doses corrected for the surface
    Fill,
    /// One spray after the other
    Pursuit,
}

impl MissionArguments {
    /// The mission of `--mission`, or what the options say.
    pub fn mission_file(&self) -> Result<MissionFile, AnyError> {
        let mut mission_file = match &self.mission {
            Some(path) => MissionFile::read(path)?,
            None => self.options()?,
        };
        if let Some(threads) = self.threads {
            mission_file.settings.threads = usize::from(threads);
        }
        Ok(mission_file)
    }

    fn options(&self) -> Result<MissionFile, AnyError> {
        let mut settings = MissionSettings {
            seed: self.seed,
            layered: self.layers,
            memory_gib: self.memory_gib,
            placement: self.placement.picture()?,
            look: self.look,
            localisation: match self.localisation {
                LocalisationName::MotionCapture => LocalisationChoice::MotionCapture,
                LocalisationName::Noise => LocalisationChoice::Noise,
                LocalisationName::Slam => LocalisationChoice::Slam,
            },
            viewpoint: self.placement.project,
            painter: match self.painter.unwrap_or(if self.fill.is_some() {
                PainterName::Fill
            } else {
                PainterName::Feedback
            }) {
                PainterName::Feedback => PainterChoice::Feedback,
                PainterName::Deconvolution => PainterChoice::Deconvolution,
                PainterName::Centrelines => PainterChoice::Centrelines,
                PainterName::Fill => PainterChoice::Fill,
                PainterName::Pursuit => PainterChoice::Pursuit,
            },
            ..MissionSettings::default()
        };
        if self.fill.is_some() {
            // An even coat shows where the valve was shut because the body leaned beyond the tilt joint's end: three degrees more are kept for it.
            settings.planner.nozzle.max_elevation -= COAT_MARGIN;
        }
        self.nozzle.apply(&mut settings);
        Ok(MissionFile {
            mesh: self.mesh.clone(),
            scale: self.scale,
            up: self.up,
            region: self.region.clone(),
            design: self.design.clone(),
            fill: self.fill.map(|micrometres| 1e-6 * micrometres),
            texture: self.texture.clone(),
            scan: self.scan,
            settings,
            paints: Vec::new(),
        })
    }
}
