//! The main job: a mesh and a design in, a painted surface and its figures out.

mod decide;
mod figures;
mod fly;
mod inspect;
mod mission_output;
mod plan;
#[cfg(test)]
mod test_panel;

pub use inspect::Inspection;

use std::fmt::Write as _;
use std::time::Instant;

use paint_net::{Image, Limits, Painting};
use paint_planner::Plan;
use paint_sim::{Film, FlightLog};
use ptu_kinematics::{Ptu, PtuSettings, ServoSettings};

use crate::adapters::Robot;
use crate::appearance::{Appearance, AppearanceError};
use crate::design::{Design, DesignError};
use crate::mesh_io::TriangleMesh;
use crate::pictures::PictureError;
use crate::progress::Stage;
use crate::recording::RecordingError;
use crate::report::ReportError;
use crate::surface::{PaintSurface, SurfaceError};
use crate::targets::Route;

use decide::decide;
use fly::{fly, spray};
use plan::plan;

/// Everything a mission can be told.
#[derive(Debug, Clone)]
pub struct MissionSettings {
    /// Seed of the design, the wind and the localisation errors.
    pub seed: u64,
    /// Worker threads.
    pub threads: usize,
    /// Size of a texel, metres. Default 1.25 cm (Paper IV, section 4).
    pub texel: f64,
    /// Standard deviation of a spray spot at the stand-off, metres. Default 2.5 cm (Paper IV: half the radius of 5 cm).
    pub spot: f64,
    /// Which painter decides.
    pub painter: PainterChoice,
    /// Where sprays may lie, in texels. Default: 2 along a row, rows 3 apart (ours).
    pub limits: Limits,
    /// The planner's settings.
    pub planner: paint_planner::Settings,
    /// The robot's kinematics.
    pub ptu: PtuSettings,
    /// The servos of its pan-tilt unit.
    pub servo: ServoSettings,
}

/// The painters to choose from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PainterChoice {
    /// The network with feedback from its canvas.
    Feedback,
    /// All sprays at once.
    Deconvolution,
    /// One spray after the other.
    Pursuit,
}

impl Default for MissionSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            texel: 0.0125,
            spot: 0.025,
            painter: PainterChoice::Feedback,
            limits: Limits { along: 2, row_spacing: 3, min_volume: 0.01, ..Limits::default() },
            planner: planner_settings(),
            ptu: PtuSettings::default(),
            servo: ServoSettings::default(),
        }
    }
}

/// The planner's defaults with a weaker pull between neighbours: the normals are averaged over a footprint already.
fn planner_settings() -> paint_planner::Settings {
    let defaults = paint_planner::Settings::default();
    paint_planner::Settings {
        nozzle: paint_planner::NozzleSettings { ca: 0.1, cb: 0.002, ..defaults.nozzle },
        ..defaults
    }
}

/// Why a mission could not be finished.
#[derive(Debug, thiserror::Error)]
pub enum MissionError {
    /// The mesh is not a surface that can be painted.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The design does not fit the mesh.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The painter refused.
    #[error("painter: {0}")]
    Painter(#[from] paint_net::Error),
    /// No plan.
    #[error("planner: {0}")]
    Planner(#[from] paint_planner::Error),
    /// The robot's constants.
    #[error("kinematics: {0}")]
    Kinematics(#[from] ptu_kinematics::Error),
    /// The simulation refused.
    #[error("simulation: {0}")]
    Simulation(#[from] paint_sim::Error),
    /// The paint.
    #[error("paint: {0}")]
    Appearance(#[from] AppearanceError),
    /// The design asks for nothing that can be painted.
    #[error("the design leaves nothing to paint: {0}")]
    NothingToPaint(&'static str),
    /// Most of the wanted paint is out of reach.
    #[error(
        "{percent:.0} % of the wanted paint cannot be sprayed by any pose of the robot: turn the mesh (--up), change its \
         scale (--scale) or choose a design on the parts that face sideways"
    )]
    OutOfReach {
        /// Share out of reach.
        percent: f64,
    },
    /// The map of the painted surface.
    #[error("scan: {0}")]
    Scan(#[from] tsdf_hash::Error),
    /// The trajectories of the flight.
    #[error("trajectories: {0}")]
    Trajectory(#[from] vio_ekf::Error),
    /// A picture.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The report.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A file.
    #[error("{path}: cannot be written ({source}): check that the folder exists and is writable")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
}

/// A mission is given up when more of the wanted paint than this is out of reach.
const MOST_OUT_OF_REACH: f64 = 0.9;

/// One layer of paint, decided, planned and flown.
pub struct LayerFlight {
    /// Its strokes on the surface.
    pub route: Route,
    /// The plan.
    pub plan: Plan,
    /// The baseline planner on the same targets.
    pub smoothing: Plan,
    /// Flown with motion capture: the flight whose paint counts.
    pub flight: FlightLog,
    /// Flown with a localisation that errs by 7 cm.
    pub slam: FlightLog,
    /// Flown with the pan-tilt unit locked forward.
    pub locked: FlightLog,
}

/// Everything a mission made; what the report, the pictures and the recording are drawn from.
pub struct Mission {
    settings: MissionSettings,
    name: String,
    surface: PaintSurface,
    appearance: Appearance,
    robot: Robot,
    wanted: Image,
    coverage: Image,
    layers: Vec<Painting>,
    flights: Vec<LayerFlight>,
    film: Film,
    /// Pixel of every texel of the film.
    pixels: Vec<usize>,
    planning: f64,
    /// Paint of layers that no pose of the robot can spray at all, m³.
    abandoned: f64,
    started: Instant,
}

impl Mission {
    /// Runs the whole job up to the painted film. `name` is what the report calls the surface.
    pub fn run(
        name: &str,
        mesh: &TriangleMesh,
        design: &Design,
        settings: MissionSettings,
    ) -> Result<Self, MissionError> {
        let started = Instant::now();
        let ptu = Ptu::new(settings.ptu)?;
        let robot = Robot::new(ptu);
        let appearance = Appearance::charcoal_on_sandstone()?;

        let stage = Stage::start("unwrap");
        let surface = PaintSurface::new(mesh, settings.texel, &|s| stage.share(s))?;
        stage.done(&describe(&surface));

        let coverage = surface.coverage();
        // Nothing is wanted beside the surface, and no more than the paint can show.
        let mut wanted = design.on_surface(&surface, mesh)?.map(|ink| ink.min(appearance.ink().max_ink()));
        for (ink, covered) in wanted.data_mut().iter_mut().zip(coverage.data()) {
            *ink *= covered;
        }
        let layers = decide(&surface, &wanted, &coverage, &appearance, &settings)?;
        let planned = plan(&layers, &surface, &robot, &settings)?;
        let (planning, abandoned) = (planned.seconds, planned.abandoned);
        let flights = fly(planned, &surface, &robot, &settings)?;
        let (film, pixels) = spray(&flights, &surface, &settings)?;

        let mission = Self {
            settings,
            name: name.to_string(),
            surface,
            appearance,
            robot,
            wanted,
            coverage,
            layers,
            flights,
            film,
            pixels,
            planning,
            abandoned,
            started,
        };
        let share = mission.share_out_of_reach();
        if share > MOST_OUT_OF_REACH {
            return Err(MissionError::OutOfReach { percent: 100.0 * share });
        }
        Ok(mission)
    }
}

fn describe(surface: &PaintSurface) -> String {
    let quality = surface.chart.quality();
    let f = &surface.repair_report;
    let mut text = format!(
        "{} faces, {:.2} m², {} flips, stretch energy {:.4}",
        surface.disk().faces().len(),
        surface.disk().area(),
        quality.flips,
        quality.symmetric_dirichlet
    );
    if f.components > 1 {
        let rest = f.area_in_other_components_m2;
        let _ = write!(text, "; the largest of {} parts, {rest:.2} m² in the others stay bare", f.components);
    }
    text
}
