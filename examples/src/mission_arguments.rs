//! The options that say what to paint: those of `paintcopter` and `plan`.

mod nozzle;
mod positive;
mod showing;
mod vehicle;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use paint_net::painters::LayerPlanning;

use crate::mesh_frame::MeshScale;
use crate::mesh_placement::UpAxis;
use crate::mission::{LocalisationChoice, PainterChoice, PlannerChoice};
use crate::mission_file::MissionFile;
use crate::palette_choice::PaletteChoice;
use crate::picture_placement::{PicturePlacement, PlacementMode};
use crate::projection::Viewpoint;
use crate::region::Region;
use crate::wall::Wall;

use nozzle::Nozzle;
use positive::positive;
pub use showing::ShowingArguments;
use vehicle::Vehicle;

type AnyError = Box<dyn std::error::Error>;

/// What an even coat keeps of the tilt joint's range beyond what every mission does: three degrees, in radians.
const COAT_MARGIN: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// What to paint on what, and how.
#[derive(Args)]
pub struct MissionArguments {
    /// Fly a mission again: mission.toml of an earlier run, or one of your own. What this command line says beside it comes before the
    /// file, the file before the defaults
    #[arg(long, value_name = "FILE")]
    mission: Option<PathBuf>,
    /// Surface to paint, OBJ, glTF (.glb, .gltf), PLY, STL or OFF; the built-in rock wall if not given
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Picture on the mesh's own texture coordinates (OBJ, glTF): it becomes the design
    #[arg(long, value_name = "PNG", conflicts_with = "design")]
    texture: Option<PathBuf>,
    /// Metres per unit of the mesh file, or m, cm, mm, ft, in, or fit (the longest side becomes 3 m) [default: what the file says, else what its
    /// size tells]
    #[arg(long, value_name = "METRES|UNIT|fit", allow_negative_numbers = true)]
    scale: Option<MeshScale>,
    /// Axis of the mesh file that points up: x, y, z, or any direction X,Y,Z [default: what the file or its base says, else y for OBJ and OFF, z
    /// for PLY and STL]
    #[arg(long, value_name = "x|y|z|X,Y,Z", value_parser = up_axis, allow_hyphen_values = true)]
    up: Option<UpAxis>,
    /// Paint only a part of the mesh; the rest stays in the way. In the coordinates of the mesh file: box:x0,y0,z0,x1,y1,z1,
    /// plane:px,py,pz,nx,ny,nz,RADIUS, pick:px,py,pz (as far as no crease), or mask:PNG on its texture coordinates. The mesh is a
    /// place in metres then, unless --scale says otherwise
    #[arg(long, conflicts_with = "scan")]
    region: Option<Region>,
    /// Keep a part clean, as a window in a house front: a region as of --region; may be given several times
    #[arg(long, value_name = "REGION", conflicts_with = "scan")]
    keep_clean: Vec<Region>,
    /// What to paint: mural (in colour, with --palette), strata, stripes, gradient, colours (of the mesh's vertices), materials (the pictures
    /// that the mesh file or its MTL names), or a PNG, JPEG or SVG file
    /// [default: on the rock wall the mural where `paintcopter` flies it, else strata; on a mesh materials where it has pictures, else stripes]
    #[arg(long)]
    design: Option<String>,
    /// Cover all that is in reach with a coat of this thickness, micrometres from 1 to 60
    #[arg(long, value_name = "MICROMETRES", value_parser = positive, conflicts_with_all = ["design", "texture"])]
    fill: Option<f64>,
    #[command(flatten)]
    colours: Colours,
    #[command(flatten)]
    placement: Placement,
    /// Scan the surface first, with the robot's own camera, inertial sensor and depth camera, and paint what it has mapped
    #[arg(long, conflicts_with = "texture")]
    scan: bool,
    /// What tells the painting flight where the robot is: motion capture, a model of noise of 7 cm, or the robot's own camera, depth camera and
    /// inertial sensors in the map of its --scan, else in the shape of the surface [default: slam with --scan, else motion-capture]
    #[arg(long, value_enum)]
    localisation: Option<LocalisationName>,
    #[command(flatten)]
    vehicle: Vehicle,
    /// Fly along the painted surface, look at it, and paint again what is missing
    #[arg(long)]
    look: bool,
    /// Who decides the sprays; with --palette all paints together, adaptive-rows if wanted [default: feedback; fill with --fill]
    #[arg(long)]
    painter: Option<PainterName>,
    /// Who plans the flights [default: optimal]
    #[arg(long, value_enum)]
    planner: Option<PlannerChoice>,
    /// Paint in layers by intensity, a flight for each: decided together, or one after the other as in the thesis [default: one flight whose
    /// flow carries the picture]
    #[arg(long, value_enum, num_args = 0..=1, default_missing_value = "joint", value_name = "PLANNING")]
    layers: Option<LayersName>,
    #[command(flatten)]
    nozzle: Nozzle,
    #[command(flatten)]
    showing: ShowingArguments,
    /// Seed of the world, the wind and the errors [default: 1]
    #[arg(long)]
    seed: Option<u64>,
    /// Rows of the tables of flights and states of their recordings, a second: fewer for long flights [default: 20 and 10]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    record: Option<f64>,
    /// Memory that the mission may need by estimate, GiB [default: 8]
    #[arg(long, value_name = "GIB", value_parser = positive)]
    memory_gib: Option<f64>,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// In which paints a picture is painted, on what wall.
#[derive(Args)]
struct Colours {
    /// Paint the design in colour: cmyk, six (white, black, yellow, orange, magenta, blue), spot:N (as many paints, chosen for the picture), or a file of
    /// paints (TOML). Each paint is a coat of its own; they lie over each other in the order that shows the picture best
    #[arg(long, value_name = "cmyk|six|spot:N|FILE", conflicts_with = "fill")]
    palette: Option<PaletteChoice>,
    /// File with the paints that spot:N chooses from [default: artists' pigments]
    #[arg(long, value_name = "FILE", requires = "palette")]
    available: Option<PathBuf>,
    /// The wall under the picture: sandstone, white, concrete, dark, a colour as #rrggbb, or mesh (its own colours) [default: mesh where it has colours that
    /// are not the design, else sandstone]
    #[arg(long, value_name = "WALL")]
    wall: Option<Wall>,
}

fn finite(text: &str) -> Result<f64, String> {
    numbers::<1>(text).map(|[value]| value)
}

/// Where a picture of --design lies.
#[derive(Args)]
struct Placement {
    /// How large a picture becomes: whole within the surface, covering it, repeated, or stretched over it [default: fit]
    #[arg(long)]
    place: Option<PlaceName>,
    /// Turn of the picture about its middle, degrees counter-clockwise [default: 0]
    #[arg(long, value_name = "DEGREES", value_parser = finite, allow_negative_numbers = true)]
    rotate: Option<f64>,
    /// Where the middle of the picture lies beside that of the surface, metres to the right and up [default: 0,0]
    #[arg(long, value_name = "X,Y", value_parser = numbers::<2>, allow_hyphen_values = true)]
    offset: Option<[f64; 2]>,
    /// Width of the picture, metres; its height follows [default: as --place says]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    size: Option<f64>,
    /// Throw the design onto the surface like a slide: from the front, or from a point X,Y,Z (metres; the robot's side is -x, z
    /// is up) [default: laid over a surface in one piece; through a surface with seams, as seen from the front]
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
    fn apply(&self, placement: &mut PicturePlacement) {
        if let Some(place) = self.place {
            placement.mode = match place {
                PlaceName::Fit => PlacementMode::Fit,
                PlaceName::Fill => PlacementMode::Fill,
                PlaceName::Tile => PlacementMode::Tile,
                PlaceName::Stretch => PlacementMode::Stretch,
            };
        }
        placement.rotate = self.rotate.map_or(placement.rotate, f64::to_radians);
        placement.offset = self.offset.unwrap_or(placement.offset);
        placement.size = self.size.or(placement.size);
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
    /// The thesis' network: every spray with a spread, and so a distance, of its own
    Thesis,
    /// Rows as wide as the picture allows, from farther off, in the direction that crosses its lines: fewer metres
    AdaptiveRows,
}

#[derive(Clone, Copy, ValueEnum)]
enum LayersName {
    /// One plan, cut at the layers' thresholds
    Joint,
    /// Each layer by itself, on what lies there already, as the thesis does
    Sequential,
}

impl LayersName {
    fn planning(self) -> LayerPlanning {
        match self {
            Self::Joint => LayerPlanning::Joint,
            Self::Sequential => LayerPlanning::Sequential,
        }
    }
}

impl From<PainterName> for PainterChoice {
    fn from(name: PainterName) -> Self {
        match name {
            PainterName::Feedback => Self::Feedback,
            PainterName::Deconvolution => Self::Deconvolution,
            PainterName::Centrelines => Self::Centrelines,
            PainterName::Fill => Self::Fill,
            PainterName::Pursuit => Self::Pursuit,
            PainterName::Thesis => Self::Thesis,
            PainterName::AdaptiveRows => Self::AdaptiveRows,
        }
    }
}

impl From<LocalisationName> for LocalisationChoice {
    fn from(name: LocalisationName) -> Self {
        match name {
            LocalisationName::MotionCapture => Self::MotionCapture,
            LocalisationName::Noise => Self::Noise,
            LocalisationName::Slam => Self::Slam,
        }
    }
}

impl MissionArguments {
    /// Whether they name a mission or a surface, or a part of one.
    pub fn names_surface(&self) -> bool {
        self.mission.is_some() || self.mesh.is_some() || self.region.is_some()
    }

    /// The mission of `--mission`, or that of the defaults, with what the options say.
    pub fn mission_file(&self) -> Result<MissionFile, AnyError> {
        let mut mission = self.mission.as_deref().map(MissionFile::read).transpose()?.unwrap_or_default();
        self.apply_surface(&mut mission)?;
        self.apply_design(&mut mission)?;
        mission.palette = self.colours.palette.clone().or(mission.palette.take());
        mission.available = self.colours.available.clone().or(mission.available.take());
        mission.wall = self.colours.wall.or(mission.wall);
        let alone = self.painter.is_some_and(|painter| !matches!(painter, PainterName::AdaptiveRows));
        if mission.palette.is_some() && alone {
            return Err("--painter: paints of a palette are decided together: adaptive-rows, or leave it out".into());
        }
        let settings = &mut mission.settings;
        settings.seed = self.seed.unwrap_or(settings.seed);
        settings.threads = self.threads.map_or(settings.threads, usize::from);
        settings.memory_gib = self.memory_gib.unwrap_or(settings.memory_gib);
        settings.layered = self.layers.map(LayersName::planning).or(settings.layered);
        settings.record_hz = self.record.or(settings.record_hz);
        settings.look |= self.look;
        self.vehicle.apply(settings);
        settings.localisation = self.localisation.map(LocalisationChoice::from).or(settings.localisation);
        settings.path_planner = self.planner.unwrap_or(settings.path_planner);
        settings.painter = self.painter.map_or(settings.painter, PainterChoice::from);
        settings.viewpoint = self.placement.project.or(settings.viewpoint);
        self.placement.apply(&mut settings.placement);
        self.nozzle.apply(settings);
        self.showing.apply(&mut settings.show);
        Ok(mission)
    }

    /// Another mesh is another place: what the file says of its own goes with it.
    fn apply_surface(&self, mission: &mut MissionFile) -> Result<(), AnyError> {
        if let Some(mesh) = &self.mesh {
            (mission.mesh, mission.scale, mission.up, mission.region) = (Some(mesh.clone()), None, None, None);
            mission.keep_clean.clear();
        }
        mission.scale = self.scale.or(mission.scale);
        mission.up = self.up.or(mission.up);
        mission.region = self.region.clone().or(mission.region.take());
        if !self.keep_clean.is_empty() {
            mission.keep_clean.clone_from(&self.keep_clean);
        }
        mission.scan |= self.scan;
        let given =
            [("--scale", self.scale.is_some()), ("--up", self.up.is_some()), ("--region", self.region.is_some())];
        match given.into_iter().chain([("--texture", self.texture.is_some())]).find(|(_, given)| *given) {
            Some((option, _)) if mission.mesh.is_none() => Err(format!("{option}: needs --mesh").into()),
            _ if mission.scan && self.region.is_some() => {
                Err("--region: not of a surface that is scanned first".into())
            }
            _ => Ok(()),
        }
    }

    /// What is painted is one of several things: the one that is named comes instead of the one in the file.
    fn apply_design(&self, mission: &mut MissionFile) -> Result<(), AnyError> {
        if self.design.is_none() && self.texture.is_none() && self.fill.is_none() {
            return Ok(());
        }
        if !mission.paints.is_empty() {
            let why = "the mission has several paints, each with what it paints: change the file, or leave out --design, --texture and --fill";
            return Err(why.into());
        }
        let filled = mission.fill.is_some();
        (mission.design, mission.texture) = (self.design.clone(), self.texture.clone());
        mission.fill = self.fill.map(|micrometres| 1e-6 * micrometres);
        // An even coat shows where the valve was shut because the body leaned beyond the tilt joint's end: three degrees more are kept for it.
        let margin = f64::from(u8::from(mission.fill.is_some())) - f64::from(u8::from(filled));
        mission.settings.planner.nozzle.max_elevation -= margin * COAT_MARGIN;
        mission.settings.painter = match (mission.settings.painter, mission.fill.is_some()) {
            (_, true) => PainterChoice::Fill,
            (PainterChoice::Fill, false) => PainterChoice::Feedback,
            (painter, false) => painter,
        };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::mission::MissionSettings;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        mission: MissionArguments,
    }

    fn mission(line: &[&str]) -> Result<MissionFile, String> {
        let line = std::iter::once("fly").chain(line.iter().copied());
        Line::try_parse_from(line).map_err(|e| e.to_string())?.mission.mission_file().map_err(|e| e.to_string())
    }

    #[test]
    fn the_line_comes_before_the_file_and_the_file_before_the_defaults() {
        let folder = std::env::temp_dir().join(format!("paintcopter-line-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("mission.toml");
        std::fs::write(
            &file,
            "mesh = \"a.obj\"\nscale = 0.5\nfill = 2e-5\n[settings]\nseed = 7\nspot = 0.03\npainter = \"fill\"\n",
        )
        .unwrap();
        let path = file.to_str().unwrap();
        let same = mission(&["--mission", path]).unwrap();
        assert_eq!((same.scale, same.fill), (Some(MeshScale::Factor(0.5)), Some(2e-5)));
        assert_eq!((same.settings.seed, same.settings.spot), (7, 0.03));
        assert_eq!(same.settings.texel, MissionSettings::default().texel);

        let other = mission(&["--mission", path, "--seed=3", "--texel=0.01", "--up=x", "--rotate=90"]).unwrap();
        assert_eq!((other.settings.seed, other.settings.texel, other.settings.spot), (3, 0.01, 0.03));
        assert_eq!((other.up, other.scale, other.mesh), (Some(UpAxis::X), same.scale, same.mesh));
        assert!((other.settings.placement.rotate - std::f64::consts::FRAC_PI_2).abs() < 1e-15);

        // A design takes the place of the coat; another mesh has another scale.
        let other = mission(&["--mission", path, "--design", "stripes", "--mesh", "b.obj"]).unwrap();
        assert_eq!((other.fill, other.design.as_deref(), other.scale), (None, Some("stripes"), None));
        assert_eq!(other.settings.painter, PainterChoice::Feedback);
        let coat = mission(&["--fill=20"]).unwrap();
        assert_eq!((coat.settings.painter, coat.fill), (PainterChoice::Fill, Some(20.0 * 1e-6)));
        assert!(coat.settings.planner.nozzle.max_elevation < MissionSettings::default().planner.nozzle.max_elevation);
        assert_eq!(mission(&[]).unwrap(), MissionFile::default());
        let cut = mission(&["--tank=0.5", "--battery=6", "--identify"]).unwrap().settings;
        assert_eq!((cut.endurance.tank, cut.endurance.battery, cut.identify), (Some(5e-4), Some(360.0), true));
        let shown = mission(&["--light=18:30@47.4", "--gloss=0.2", "--turntable=8"]).unwrap();
        assert_eq!((shown.settings.show.gloss, shown.settings.show.turntable), (Some(0.2), Some(8)));
        shown.write(&file).unwrap();
        assert!(std::fs::read_to_string(&file).unwrap().contains("light = \"2026-06-21T18:30@47.4\""));
        assert_eq!(mission(&["--mission", path]).unwrap(), shown);
        assert!(mission(&["--light=night"]).unwrap_err().contains("noon, dusk, lamp, overcast"));
        assert!(mission(&["--gloss=0"]).is_err() && mission(&["--turntable=0"]).is_err());
        let locked = mission(&["--planner=smoothing-locked"]).unwrap();
        assert_eq!(locked.settings.path_planner, PlannerChoice::SmoothingLocked);
        locked.write(&file).unwrap();
        assert!(std::fs::read_to_string(&file).unwrap().contains("path_planner = \"smoothing_locked\""));
        assert_eq!(mission(&["--mission", path]).unwrap(), locked);
        assert_eq!(mission(&["--mission", path, "--planner=optimal"]).unwrap(), MissionFile::default());

        std::fs::write(&file, "[[paints]]\nname = \"red\"\nfill = 1e-5\n").unwrap();
        assert!(mission(&["--mission", path, "--fill=10"]).unwrap_err().contains("several paints"));
        assert!(mission(&["--scale=2"]).unwrap_err().contains("needs --mesh"));
        assert!(mission(&["--scan", "--mesh", "a.obj", "--region", "pick:0,0,0"]).is_err());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
