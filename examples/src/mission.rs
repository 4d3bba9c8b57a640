//! The main job: a mesh and a design in, a painted surface and its figures out.

mod figures;
mod gallery;
mod inspect;

pub use inspect::Inspection;

use std::fmt::Write as _;
use std::time::Instant;

use nalgebra::{Point3, Vector3};
use paint_net::{
    Deconvolution, Image, Layered, Limits, MatchingPursuit, Painter, Painting, SprayKernel, StrokeSettings, Task,
    boustrophedon,
};
use paint_planner::{OptimalPlanner, Plan, Planner, SmoothingPlanner, VehicleState};
use paint_sim::flight::{Localisation, Tether};
use paint_sim::{Film, FlightLog, FlightSettings, SprayModel, fly};
use ptu_kinematics::{Ptu, PtuSettings, ServoSettings};

use crate::adapters::{PlannedFlight, Robot, ServoGun, Wall};
use crate::appearance::{Appearance, AppearanceError};
use crate::design::{Design, DesignError};
use crate::mesh_io::TriangleMesh;
use crate::pictures::PictureError;
use crate::progress::Stage;
use crate::recording::RecordingError;
use crate::report::ReportError;
use crate::surface::{PaintSurface, SurfaceError};
use crate::targets::{Route, route};

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
            painter: PainterChoice::Deconvolution,
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

/// Motion of the nozzle that one shot stands for, metres: widens the spot by less than a percent.
const SHOT_STEP: f64 = 0.01;

/// Weight of texels out of reach against those in reach.
const BARE_WEIGHT: f64 = 0.02;
/// Where the cone of the spray ends, in deviations: all but 0.2 % of the paint lies inside.
const SPRAY_CUT: f64 = 3.5;
/// Paint that has met nothing after this way is overspray, metres: what lies behind the edge of a surface stays clean.
const SPRAY_RANGE: f64 = 0.35;

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

        let kernel = kernel(&settings)?;
        let mut flights = Vec::with_capacity(layers.len());
        let mut planning = 0.0;
        let stage = Stage::start("plan");
        let mut routes = Vec::new();
        for layer in &layers {
            let strokes = boustrophedon(&layer.sprays, &StrokeSettings::default())?;
            let route = route(&surface, &strokes, &kernel, settings.limits.along);
            if route.targets.len() > 1 {
                routes.push(route);
            }
        }
        let mut plans: Vec<(Route, Plan, Plan)> = Vec::with_capacity(routes.len());
        let mut home: Option<VehicleState> = None;
        let count = routes.len();
        let mut abandoned = 0.0;
        for (k, route) in routes.into_iter().enumerate() {
            stage.share(k as f64 / count as f64);
            let planner = paint_planner::Settings { start: home, ..settings.planner.clone() };
            let clock = Instant::now();
            let plan = match OptimalPlanner::default().plan(&route.targets, &Wall(&surface.world), &robot, &planner) {
                Err(paint_planner::Error::NothingReachable { .. }) => {
                    abandoned += route.paint() + route.lost;
                    continue;
                }
                plan => plan?,
            };
            planning += clock.elapsed().as_secs_f64();
            home = plan.waypoints.last().map(|w| w.state);
            let smoothing = SmoothingPlanner.plan(&route.targets, &Wall(&surface.world), &robot, &settings.planner)?;
            plans.push((route, plan, smoothing));
        }
        if plans.is_empty() {
            return Err(MissionError::OutOfReach { percent: 100.0 });
        }
        let metres: f64 = plans.iter().map(|(_, plan, _)| figures::path_length(plan)).sum();
        stage.done(&format!("{metres:.0} m of path, {:.1} ms per metre", 1e3 * planning / metres));

        let stage = Stage::start("fly");
        for (k, (route, plan, smoothing)) in plans.into_iter().enumerate() {
            stage.share(k as f64 / layers.len() as f64);
            let [flight, slam, locked] = fly_three(&plan, &surface, &robot, &settings, k as u64)?;
            flights.push(LayerFlight { route, plan, smoothing, flight, slam, locked });
        }
        let seconds: f64 = flights.iter().map(|f| f.plan.trajectory.duration()).sum();
        stage.done(&format!("{:.0} min in the air, three times", seconds / 60.0));

        let stage = Stage::start("spray");
        let (texels, pixels) = surface.film_texels();
        let mut film = Film::new(texels)?;
        let shots: Vec<_> = flights.iter().flat_map(|f| f.flight.shots(SHOT_STEP)).collect();
        film.deposit(&shots, &spray(&settings), &surface.world, settings.threads, &mut |done, total| {
            stage.share(done as f64 / total as f64);
        })?;
        let books = film.books();
        stage.done(&format!(
            "{:.1} % of the paint on the surface",
            100.0 * books.deposited as f64 / books.emitted as f64
        ));

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
    let f = &surface.findings;
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

/// The footprint of the nozzle in texels, with all of its tails.
fn kernel(settings: &MissionSettings) -> Result<SprayKernel, paint_net::Error> {
    SprayKernel::new(settings.spot / settings.texel, SPRAY_CUT)
}

/// The same nozzle in the simulation.
fn spray(settings: &MissionSettings) -> SprayModel {
    let sigma = (settings.spot / settings.planner.nozzle.stand_off).atan();
    SprayModel { sigma, cut: SPRAY_CUT, range: SPRAY_RANGE, ..SprayModel::default() }
}

/// Layers of sprays for the wanted picture.
fn decide(
    surface: &PaintSurface,
    wanted: &Image,
    coverage: &Image,
    appearance: &Appearance,
    settings: &MissionSettings,
) -> Result<Vec<Painting>, MissionError> {
    let stage = Stage::start("decide");
    let tilt = settings.ptu.tilt_limits.min.abs().min(settings.ptu.tilt_limits.max);
    // The planner may lean the spray by its incidence angle to reach what the tilt servo alone cannot.
    let paintable =
        surface.paintable((tilt + 0.8 * settings.planner.nozzle.incidence).min(std::f64::consts::FRAC_PI_2));
    if !paintable.contains(&true) {
        return Err(MissionError::NothingToPaint(
            "the surface looks up or down everywhere, or its chart is stretched too far",
        ));
    }
    // What nobody can spray must not pull paint from its neighbours; a little weight keeps overspray off it.
    let weight = Image::from_fn(coverage.width(), coverage.height(), |x, y| {
        let share = if paintable[y * coverage.width() + x] { 1.0 } else { BARE_WEIGHT };
        share * coverage.at(x, y)
    });
    let task = Task { reference: wanted, canvas: None, weight: Some(&weight), paintable: Some(&paintable) };
    let kernel = kernel(settings)?;
    let mut progress = |share: f64| stage.share(share);
    let (ink, limits) = (appearance.ink(), &settings.limits);
    let layers = match settings.painter {
        PainterChoice::Deconvolution => layered(Deconvolution::default(), &task, &kernel, ink, limits, &mut progress),
        PainterChoice::Pursuit => layered(MatchingPursuit::default(), &task, &kernel, ink, limits, &mut progress),
    }?;
    let sprays: usize = layers.iter().map(|l| l.sprays.len()).sum();
    if sprays == 0 {
        return Err(MissionError::NothingToPaint("no place of it is darker than the bare wall"));
    }
    stage.done(&format!("{} layers, {sprays} sprays", layers.len()));
    Ok(layers)
}

fn layered<P: Painter>(
    painter: P,
    task: &Task,
    kernel: &SprayKernel,
    ink: &paint_net::Saturation,
    limits: &Limits,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Painting>, paint_net::Error> {
    Layered::new(painter).paint_layers(task, kernel, ink, limits, progress)
}

/// The same plan with motion capture, with a drifting localisation, and with the pan-tilt unit locked.
fn fly_three(
    plan: &Plan,
    surface: &PaintSurface,
    robot: &Robot,
    settings: &MissionSettings,
    layer: u64,
) -> Result<[FlightLog; 3], MissionError> {
    let usual = FlightSettings {
        tether: Some(hose(plan)),
        seed: settings.seed.wrapping_mul(0x9E37_79B9).wrapping_add(layer),
        ..FlightSettings::default()
    };
    let variants = [
        usual,
        FlightSettings { localisation: Localisation::slam_7cm(), ..usual },
        FlightSettings { ptu_locked: true, ..usual },
    ];
    let one = |flight: &FlightSettings| -> Result<FlightLog, MissionError> {
        let reference = PlannedFlight { plan, ptu: &robot.ptu, stand_off: settings.planner.nozzle.stand_off };
        let mut gun = ServoGun::new(robot.ptu.clone(), settings.servo)?;
        Ok(fly(&reference, &mut gun, &surface.world, flight)?)
    };
    if settings.threads < 2 {
        let [a, b, c] = variants.map(|v| one(&v));
        return Ok([a?, b?, c?]);
    }
    std::thread::scope(|scope| {
        let handles = variants.each_ref().map(|v| scope.spawn(|| one(v)));
        let [a, b, c] = handles.map(|h| h.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        Ok([a?, b?, c?])
    })
}

/// The paint hose: from the ground behind the middle of the flight, long enough for all of it.
fn hose(plan: &Plan) -> Tether {
    let positions = || plan.waypoints.iter().map(|w| w.state.position);
    let count = plan.waypoints.len() as f64;
    let middle: Vector3<f64> = positions().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let back: Vector3<f64> = plan
        .waypoints
        .iter()
        .map(|w| Vector3::new(w.state.heading.cos(), w.state.heading.sin(), 0.0))
        .sum::<Vector3<f64>>()
        / count;
    let base = Point3::new(middle.x - back.x, middle.y - back.y, 0.0);
    let farthest = positions().map(|p| (p - base).norm()).fold(0.0, f64::max);
    // A tenth of slack, and a metre for wind and overshoot.
    Tether { base, length: 1.1 * farthest + 1.0, line_density: 0.12, base_on_floor: true }
}
