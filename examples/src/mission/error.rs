//! Why a mission could not be finished.

use crate::appearance::AppearanceError;
use crate::design::DesignError;
use crate::onboard::LocalisationError;
use crate::palette_choice::PaletteError;
use crate::pictures::PictureError;
use crate::recording::RecordingError;
use crate::report::ReportError;
use crate::surface::SurfaceError;

/// Why a mission could not be finished.
#[derive(Debug, thiserror::Error)]
pub enum MissionError {
    /// No way along the surface to look at it.
    #[error("look: {0}")]
    Look(#[source] crate::scan_flight::ScanFlightError),
    /// A flight to look from that nothing plans around obstacles.
    #[error("look: the flight along the surface does not know of keep-out volumes and tethers: leave out one of them")]
    LookConstrained,
    /// A fault of a sensor at no time, or of no size.
    #[error(
        "setting sensor_faults, number {number}: `from` must be 0 or more and `until` not before it (s after the first paint), and a size of \
         the fault finite and, of late and of clipped samples, not negative"
    )]
    SensorFault {
        /// Which, from 1 on.
        number: usize,
    },
    /// A size that is none.
    #[error("setting {name} = {value}: it must be a positive number")]
    Setting {
        /// The field of the settings.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// More states a second than a recording has.
    #[error("setting record_hz = {value}: at most 100 a second")]
    Recorded {
        /// What was asked for.
        value: f64,
    },
    /// A turntable without places, or with too many.
    #[error("setting show.turntable: it must be from 1 to 72 places")]
    Turntable,
    /// A pitch at which nothing hovers.
    #[error("setting pitch = {value} rad: it must be from 0 to π/3")]
    Pitch {
        /// Its value.
        value: f64,
    },
    /// A flight of a vehicle that hovers pitched.
    #[error(
        "--pitch (settings.pitch): the simulated vehicle hovers level; `plan` plans for one that pitches and `paintcopter --preview` \
         shows what it paints: leave it out to fly"
    )]
    PitchedFlight,
    /// A plan may ask for more than the servos do.
    #[error(
        "setting planner.timing.max_joint_rate = {planned} rad/s: the servos turn by {servo} rad/s at most (servo.max_rate); plan slower ones"
    )]
    JointRate {
        /// What plans may ask for, rad/s.
        planned: f64,
        /// What the servos do, rad/s.
        servo: f64,
    },
    /// The mesh is not a surface that can be painted.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The design does not fit the mesh.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The paints of a picture.
    #[error(transparent)]
    Palette(#[from] PaletteError),
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
    /// Whoever flies gives up, or does not begin.
    #[error(transparent)]
    Flyer(Box<dyn std::error::Error + Send + Sync>),
    /// The robot shall find itself in a map, and there is none.
    #[error("localisation by slam needs a map of the surface: let the robot scan it first (--scan)")]
    NoMap,
    /// The map cannot be read, or odometry and map refuse.
    #[error("localisation: {0}")]
    Localisation(#[from] LocalisationError),
    /// The paint.
    #[error("paint: {0}")]
    Appearance(#[from] AppearanceError),
    /// One of several paints.
    #[error("{paint}: {source}")]
    OfPaint {
        /// The paint.
        paint: String,
        /// What is wrong.
        source: Box<MissionError>,
    },
    /// The design asks for nothing that can be painted.
    #[error("the design leaves nothing to paint: {0}")]
    NothingToPaint(&'static str),
    /// Several robots on one tether.
    #[error(
        "several robots (--robots) cannot hang from one anchor, as their hoses would cross: leave `settings.constraints.tether` out; each hose \
         then comes from the ground behind its robot"
    )]
    TeamTethered,
    /// The flight would not fit into memory.
    #[error(
        "a surface of {area:.0} m² needs about {need_gib:.1} GiB of memory, more than --memory-gib {limit_gib}: paint it \
         smaller (--scale), or allow more"
    )]
    TooLarge {
        /// Area of the mesh, m².
        area: f64,
        /// Estimated need, GiB.
        need_gib: f64,
        /// What is allowed, GiB.
        limit_gib: f64,
    },
    /// Most of the wanted paint is out of reach.
    #[error(
        "{percent:.0} % of the wanted paint cannot be sprayed by any pose of the robot: turn the mesh (--up), change its \
         scale (--scale) or choose a design on the parts that face sideways"
    )]
    OutOfReach {
        /// Share out of reach.
        percent: f64,
    },
    /// Keep-out volumes and tether leave nothing.
    #[error(
        "keep-out volumes and tether leave no pose of the robot that paints anything; {percent:.0} % of the surface would be in reach \
         without them: change `settings.constraints` of the mission file"
    )]
    Constrained {
        /// Share of the surface in reach without them.
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

impl MissionError {
    /// The same with the paint whose mission it is.
    #[must_use]
    pub fn in_paint(self, paint: &str) -> Self {
        Self::OfPaint { paint: paint.to_owned(), source: Box::new(self) }
    }
}
