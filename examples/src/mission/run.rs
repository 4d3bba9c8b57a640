//! The mission itself: its stages in order, and what they leave.

use std::fmt::Write as _;
use std::time::Instant;

use nalgebra::Isometry3;
use paint_net::{Image, Painting};
use paint_sim::Film;
use paint_sim::flight::FlightSample;
use ptu_kinematics::{Joints, Ptu};

use super::decide::decide;
use super::error::MissionError;
use super::fly::{LayerFlight, fly, spray};
use super::plan::plan;
use super::settings::MissionSettings;
use crate::adapters::Robot;
use crate::appearance::{Appearance, UNIT_THICKNESS};
use crate::design::Design;
use crate::mesh_io::TriangleMesh;
use crate::progress::Stage;
use crate::surface::PaintSurface;

/// A mission is given up when more of the wanted paint than this is out of reach.
const MAX_UNREACHABLE_SHARE: f64 = 0.9;

/// Flight logs are most of what a mission keeps: the built-in wall of 10.6 m² takes 200 MB with texels of 1.25 cm.
const BYTES_PER_SQUARE_METRE: f64 = 2e7;
/// As many times as much with layers, on the same wall.
const LAYERED: f64 = 2.2;
/// The size of a texel for that, metres.
const USUAL_TEXEL: f64 = 0.0125;

/// Everything a mission made; what the report, the pictures and the recording are drawn from.
pub struct Mission {
    pub(super) settings: MissionSettings,
    pub(super) name: String,
    pub(super) surface: PaintSurface,
    pub(super) appearance: Appearance,
    pub(super) robot: Robot,
    pub(super) wanted: Image,
    pub(super) coverage: Image,
    pub(super) layers: Vec<Painting>,
    pub(super) flights: Vec<LayerFlight>,
    pub(super) film: Film,
    /// Pixel of every texel of the film.
    pub(super) pixels: Vec<usize>,
    pub(super) planning: f64,
    /// Paint of layers that no pose of the robot can spray at all, m³.
    pub(super) unreachable_paint: f64,
    pub(super) started: Instant,
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

        design.check_movable(&settings.placement, settings.viewpoint)?;
        check_memory(mesh, &settings)?;
        let stage = Stage::start("unwrap");
        let surface = PaintSurface::new(mesh, settings.texel, &|s| stage.share(s))?;
        stage.done(&describe(&surface));

        let coverage = surface.coverage();
        // Nothing is wanted beside the surface, and no more than the paint can show.
        let wanted = design.on_surface(&surface, mesh, &settings.placement, settings.viewpoint)?;
        let mut wanted = wanted.map(|ink| ink.min(appearance.ink().max_ink()));
        for (ink, covered) in wanted.data_mut().iter_mut().zip(coverage.data()) {
            *ink *= covered;
        }
        let layers = decide(&surface, &wanted, &coverage, &appearance, &settings)?;
        let planned = plan(&layers, &surface, &robot, &settings)?;
        let (planning, unreachable_paint) = (planned.seconds, planned.unreachable_paint);
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
            unreachable_paint,
            started,
        };
        let share = mission.share_out_of_reach();
        if share > MAX_UNREACHABLE_SHARE {
            return Err(MissionError::OutOfReach { percent: 100.0 * share });
        }
        Ok(mission)
    }

    /// The layers, in the order in which they were flown.
    pub fn flights(&self) -> &[LayerFlight] {
        &self.flights
    }

    /// Paint depth per pixel as it came out, 0 beside the surface.
    pub(super) fn painted_depth(&self) -> Image {
        let mut depth = self.wanted.map(|_| 0.0);
        for (k, &pixel) in self.pixels.iter().enumerate() {
            depth.data_mut()[pixel] = self.film.thickness(k) / UNIT_THICKNESS;
        }
        depth
    }

    pub(super) fn painted_ink(&self) -> Image {
        self.painted_depth().map(|d| self.appearance.ink().forward(d))
    }

    /// CIEDE2000 between painted and wanted per pixel, `None` beside the surface.
    pub(super) fn colour_difference(&self) -> Vec<Option<f64>> {
        let painted = self.painted_depth();
        let pixel = |k: usize| {
            let wanted = self.appearance.ink().inverse(self.wanted.data()[k]);
            paint_sim::ciede2000(self.appearance.lab(painted.data()[k]), self.appearance.lab(wanted))
        };
        (0..painted.data().len()).map(|k| (self.coverage.data()[k] > 0.0).then(|| pixel(k))).collect()
    }

    /// Share of the decided paint that was not planned: no surface below the spray, or no pose of the robot.
    pub(super) fn share_out_of_reach(&self) -> f64 {
        let (mut planned, mut wanted) = (0.0, self.unreachable_paint);
        for f in &self.flights {
            wanted += f.route.lost + f.route.paint();
            planned += (0..f.route.targets.len()).map(|k| f.plan.volume(k)).sum::<f64>();
        }
        if wanted > 0.0 { (1.0 - planned / wanted).max(0.0) } else { 0.0 }
    }

    /// The arm's links at a sample: pan in the body's frame, tilt in pan's, the nozzle in tilt's (x along the spray).
    pub(super) fn arm(&self, sample: &FlightSample) -> [Isometry3<f64>; 3] {
        let [pan, tilt] = sample.pan_tilt;
        self.robot.chain.link_poses(Joints { pan, tilt })
    }
}

/// Refuses a surface whose flight would not fit: before anything is computed, since nothing could be said afterwards.
fn check_memory(mesh: &TriangleMesh, settings: &MissionSettings) -> Result<(), MissionError> {
    let area = mesh.area();
    // The way over the surface grows with the rows, its texels with their square.
    let finer = USUAL_TEXEL / settings.texel;
    let layers = if settings.layered { LAYERED } else { 1.0 };
    let need_gib = layers * area * BYTES_PER_SQUARE_METRE * finer.max(finer * finer) / f64::from(1 << 30);
    if need_gib > settings.memory_gib {
        return Err(MissionError::TooLarge { area, need_gib, limit_gib: settings.memory_gib });
    }
    Ok(())
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
