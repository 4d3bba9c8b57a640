//! What is known before anything is planned: the surface, the picture on it, what the robot reaches, and the sprays.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use paint_net::{Image, Painting};
use paint_sim::render::Coat;
use paint_sim::{Film, Substrate, Texel, TriangleSurface};
use ptu_kinematics::Ptu;

use super::decide::{Canvas, decide};
use super::error::MissionError;
use super::planned_robot::PlannedRobot;
use super::reach::{texels_in_reach, texels_lost_to_constraints};
use super::reach_needs::reach_needs;
use super::settings::{LocalisationChoice, MissionSettings};
use super::true_surface::moved_onto;
use crate::adapters::Robot;
use crate::appearance::{Appearance, UNIT_THICKNESS};
use crate::design::Design;
use crate::mesh_io::TriangleMesh;
use crate::paint_set::NamedPaint;
use crate::progress::Stage;
use crate::recording::{Origin, PaintStyle};
use crate::region::Scene;
use crate::report::ReachNeeds;
use crate::say;
use crate::surface::PaintSurface;
use crate::surroundings::Surroundings;

/// What the painter weighs and what is planned are most of what a mission keeps: 24 m² in six paints take 550 MB with texels of 1.25 cm, 1,000 m² with
/// texels of 2.5 cm a quarter of that for the same area.
const BYTES_PER_SQUARE_METRE: f64 = 2e7;
/// As many times as much with layers, on the same wall.
const LAYERED: f64 = 2.2;
/// Share of the surface out of reach from which on it is looked into what would reach it.
const MANY: f64 = 0.03;
/// The size of a texel for that, metres.
const USUAL_TEXEL: f64 = 0.0125;

/// A surface with the picture wanted on it and the sprays that shall make it.
#[derive(Clone)]
pub struct PaintingTask {
    pub(super) settings: MissionSettings,
    pub(super) name: String,
    /// What is in the tank.
    pub(super) paint: NamedPaint,
    pub(super) surface: Arc<PaintSurface>,
    /// What stands around it.
    pub(super) surroundings: Arc<Surroundings>,
    /// What lies over the paint when it is shown.
    pub(super) varnish: Option<Coat>,
    pub(super) appearance: Appearance,
    /// The robot that the simulation flies.
    pub(super) robot: Robot,
    /// The robot that plans are made for: the same unless it hovers pitched.
    pub(super) planned_robot: PlannedRobot,
    /// Ink wanted on every texel.
    pub(super) wanted: Image,
    /// 1 on texels of the surface, 0 beside it.
    pub(super) coverage: Image,
    /// Which texels the robot can serve.
    pub(super) in_reach: Vec<bool>,
    /// Which texels stay clean; not in reach either, as nothing is sprayed at them.
    pub(super) clean: Vec<bool>,
    /// Which texels it could serve but for keep-out volumes and tether.
    pub(super) lost_to_constraints: Vec<bool>,
    /// What the texels out of reach would need, where they are many.
    pub(super) reach_needs: Option<ReachNeeds>,
    pub(super) layers: Vec<Painting>,
    /// Whether it is one of the paints of a picture, whose doses depend on each other.
    pub(super) of_picture: bool,
    pub(super) started: Instant,
    /// What is really there, if `surface` is a map of it.
    truth: Option<Arc<TriangleSurface>>,
    /// File of the map and its keyframes that the robot may find itself in.
    map: Option<PathBuf>,
}

impl PaintingTask {
    /// Unwraps the surface, lays the design onto it and lets the painter decide. `name` is what the report calls the surface.
    pub fn new(name: &str, scene: &Scene, design: &Design, settings: MissionSettings) -> Result<Self, MissionError> {
        design.check_movable(&settings.placement, settings.viewpoint)?;
        Self::undecided(name, scene, settings)?.decided(design, &scene.canvas)
    }

    /// What was undecided, with a design on the mesh that its surface was made from.
    pub(super) fn decided(self, design: &Design, mesh: &TriangleMesh) -> Result<Self, MissionError> {
        let mut task = self;
        let settings = &task.settings;
        // Nothing is wanted beside the surface nor where it stays clean, and no more than the paint can show.
        let wanted = design.on_surface(&task.surface, mesh, &settings.placement, settings.viewpoint)?;
        let mut wanted = wanted.map(|ink| ink.min(task.appearance.ink().max_ink()));
        for (k, ink) in wanted.data_mut().iter_mut().enumerate() {
            *ink *= if task.clean[k] { 0.0 } else { task.coverage.data()[k] };
        }
        task.layers = decide(&wanted, &task.canvas())?;
        task.wanted = wanted;
        Ok(task)
    }

    /// The surface with what the robot reaches of it, before anything is wanted.
    ///
    /// # Errors
    /// A mesh that is no surface, settings out of range.
    pub fn undecided(name: &str, scene: &Scene, settings: MissionSettings) -> Result<Self, MissionError> {
        let started = Instant::now();
        settings.check()?;
        let robot = Robot { tether: settings.constraints.tether, ..Robot::new(Ptu::new(settings.ptu)?) };
        let planned_robot = PlannedRobot::new(&settings)?;
        let paint = NamedPaint::built_in(settings.paint)?;
        let appearance = Appearance::new(&paint.paint, &Substrate::sandstone())?;
        check_memory(&scene.canvas, &settings)?;
        let stage = Stage::start("unwrap");
        let surface = PaintSurface::of_scene(scene, settings.texel, &|s| stage.share(s))?;
        stage.done(&describe(&surface));

        let coverage = surface.coverage();
        let stage = Stage::start("reach");
        let mut in_reach = texels_in_reach(&surface, &settings)?;
        let lost = texels_lost_to_constraints(&in_reach, &surface, &settings)?;
        let percent = |texels: &[bool]| 100.0 * share(texels, &coverage);
        if !in_reach.contains(&true) {
            return Err(match percent(&lost) {
                0.0 => MissionError::OutOfReach { percent: 100.0 },
                percent => MissionError::Constrained { percent },
            });
        }
        let constrained = match percent(&lost) {
            _ if settings.constraints.is_empty() => String::new(),
            lost => format!(", {lost:.1} % lost to keep-out volumes and tether"),
        };
        stage.done(&format!("{:.1} % of the surface{constrained}", percent(&in_reach)));
        let bare = 1.0 - share(&in_reach, &coverage);
        let needs = (bare > MANY).then(|| reach_needs(&in_reach, &surface, &settings)).transpose()?;
        if let Some(needs) = &needs {
            say!("{}", needs.describe());
        }
        let clean = surface.clean(&scene.clean);
        in_reach.iter_mut().zip(&clean).for_each(|(reached, clean)| *reached &= !clean);
        if !in_reach.contains(&true) {
            return Err(MissionError::NothingToPaint("all that is in reach stays clean"));
        }
        let surroundings = Surroundings::new(surface.disk(), scene);
        let varnish = settings.show.gloss.map(Coat::new).transpose()?;
        Ok(Self {
            settings,
            name: name.to_string(),
            paint,
            surroundings: Arc::new(surroundings),
            varnish,
            surface: Arc::new(surface),
            appearance,
            robot,
            planned_robot,
            wanted: coverage.map(|_| 0.0),
            coverage,
            in_reach,
            clean,
            lost_to_constraints: lost,
            reach_needs: needs,
            layers: Vec::new(),
            of_picture: false,
            started,
            truth: None,
            map: None,
        })
    }

    /// The same with other settings, of which those of the surface and of the robot have to be the same.
    pub(super) fn with_settings(&self, settings: MissionSettings) -> Result<Self, MissionError> {
        settings.check()?;
        let paint = NamedPaint::built_in(settings.paint)?;
        let task = Self { settings, started: Instant::now(), ..self.clone() };
        task.with_paint(paint, &Substrate::sandstone())
    }

    /// What the painter decides about.
    pub(super) fn canvas(&self) -> Canvas<'_> {
        let Self { surface, coverage, in_reach, clean, appearance, settings, .. } = self;
        Canvas { surface, coverage, in_reach, clean, appearance, settings }
    }

    /// The same with another paint in the tank, on another wall.
    ///
    /// # Errors
    /// A paint or wall without a colour.
    pub fn with_paint(self, paint: NamedPaint, wall: &Substrate) -> Result<Self, MissionError> {
        Ok(Self { appearance: Appearance::new(&paint.paint, wall)?, paint, ..self })
    }

    /// One paint of a picture on the same surface, to lie as deep as a painting says.
    pub(super) fn of_paint(
        &self,
        paint: NamedPaint,
        wall: &Substrate,
        painting: Painting,
    ) -> Result<Self, MissionError> {
        let wanted = painting.ink.clone();
        let task = self.clone().with_paint(paint, wall)?;
        Ok(Self { wanted, layers: vec![painting], of_picture: true, ..task })
    }

    /// What was decided about a map, flown and sprayed before the surface that was mapped, of which planning knows nothing.
    ///
    /// # Errors
    /// A mesh without faces.
    pub fn on_true_surface(self, truth: &TriangleMesh) -> Result<Self, MissionError> {
        let truth = TriangleSurface::new(&truth.positions, &truth.faces)?;
        Ok(Self { truth: Some(Arc::new(truth)), ..self })
    }

    /// With the file of a map and its keyframes, in which the robot finds itself if nothing else is chosen.
    #[must_use]
    pub fn in_map(mut self, map: PathBuf) -> Self {
        self.settings.localisation.get_or_insert(LocalisationChoice::Slam);
        Self { map: Some(map), ..self }
    }

    /// The file of the map.
    pub(super) fn map(&self) -> Option<&Path> {
        self.map.as_deref()
    }

    /// What the robot and its paint meet.
    pub(super) fn met(&self) -> &TriangleSurface {
        self.truth.as_deref().unwrap_or(&self.surface.world)
    }

    /// Paint depth per pixel of a film whose texels lie on `pixels`, 0 beside the surface.
    pub(super) fn depth_of(&self, film: &Film, pixels: &[usize]) -> Image {
        let mut depth = self.wanted.map(|_| 0.0);
        for (k, &pixel) in pixels.iter().enumerate() {
            depth.data_mut()[pixel] = film.thickness(k) / UNIT_THICKNESS;
        }
        depth
    }

    /// Paint depth per pixel as it is wanted.
    pub(super) fn wanted_depth(&self) -> Image {
        self.wanted.map(|ink| self.appearance.ink().inverse(ink))
    }

    /// The texels that paint falls on, with the pixel of each.
    pub(super) fn film_texels(&self) -> (Vec<Texel>, Vec<usize>) {
        let (texels, pixels) = self.surface.film_texels();
        match &self.truth {
            Some(truth) => (moved_onto(truth, texels), pixels),
            None => (texels, pixels),
        }
    }

    /// Share of the surface's texels that the robot can serve.
    pub(super) fn share_in_reach(&self) -> f64 {
        share(&self.in_reach, &self.coverage)
    }

    /// Share of the texels that are not to stay clean which it cannot serve.
    pub(super) fn out_of_reach_share(&self) -> f64 {
        let open = self.coverage.data().iter().zip(&self.clean).filter(|(covered, clean)| **covered > 0.0 && !**clean);
        let reached = self.in_reach.iter().filter(|&&reached| reached).count();
        1.0 - reached as f64 / open.count().max(1) as f64
    }

    /// Share of the surface's texels that it could serve but for keep-out volumes and tether; `None` where there are none.
    pub(super) fn share_lost_to_constraints(&self) -> Option<f64> {
        (!self.settings.constraints.is_empty()).then(|| share(&self.lost_to_constraints, &self.coverage))
    }

    /// Paint that is wanted where the robot cannot paint, m³.
    pub(super) fn wanted_out_of_reach(&self) -> f64 {
        let wanted = self.wanted.data().iter().zip(&self.in_reach).zip(&self.surface.texels.area_m2);
        let depth = |ink: f64| self.appearance.ink().inverse(ink) * UNIT_THICKNESS;
        wanted.filter(|((_, reached), _)| !**reached).map(|((ink, _), area)| depth(*ink) * area).sum()
    }

    /// How the paint is drawn in a recording.
    pub(super) fn paint_style(&self) -> PaintStyle {
        PaintStyle {
            width: 2.0 * self.settings.spot,
            max_flow: self.settings.planner.timing.max_flow,
            colour: self.appearance.srgb(1.0),
        }
    }

    /// The robot as URDF.
    pub(super) fn urdf(&self) -> String {
        self.robot.chain.to_urdf("paintcopter", self.settings.planner.timing.max_joint_rate)
    }

    /// What makes a recording of it again; the mission's results lie in `folder`.
    pub(super) fn origin(&self, folder: &Path) -> Origin {
        Origin::mission(self.settings.seed, self.urdf(), folder)
    }

    /// 1 on texels that the robot can serve, 0 elsewhere.
    pub(super) fn coverage_in_reach(&self) -> Image {
        let mut weight = self.coverage.clone();
        for (weight, &reached) in weight.data_mut().iter_mut().zip(&self.in_reach) {
            *weight *= f64::from(u8::from(reached));
        }
        weight
    }
}

fn share(in_reach: &[bool], coverage: &Image) -> f64 {
    let reached = in_reach.iter().filter(|&&reached| reached).count();
    reached as f64 / coverage.data().iter().sum::<f64>().max(1.0)
}

/// Refuses a surface whose flight would not fit: before anything is computed, since nothing could be said afterwards.
fn check_memory(mesh: &TriangleMesh, settings: &MissionSettings) -> Result<(), MissionError> {
    let area = mesh.area();
    let finer = USUAL_TEXEL / settings.texel;
    let layers = if settings.layered.is_some() { LAYERED } else { 1.0 };
    let need_gib = layers * area * BYTES_PER_SQUARE_METRE * finer * finer / f64::from(1 << 30);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_grows_with_the_square_of_finer_texels() {
        let wall = TriangleMesh {
            positions: vec![[0.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 10.0, 10.0], [0.0, 0.0, 10.0]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        };
        let usual_gib = 100.0 * BYTES_PER_SQUARE_METRE / f64::from(1 << 30);
        let fits = |texel: f64, share: f64| {
            let settings = MissionSettings { texel, memory_gib: share * usual_gib, ..MissionSettings::default() };
            check_memory(&wall, &settings).is_ok()
        };
        for (coarser, share) in [(1.0, 1.0), (0.5, 4.0), (0.25, 16.0), (2.0, 0.25)] {
            let texel = coarser * USUAL_TEXEL;
            assert!(fits(texel, 1.01 * share) && !fits(texel, 0.99 * share), "{coarser}");
        }
    }
    #[test]
    fn in_a_map_of_its_own_the_robot_finds_itself_if_nothing_else_is_chosen() {
        let wall = TriangleMesh {
            positions: vec![[0.0, 0.5, 1.0], [0.0, -0.5, 1.0], [0.0, -0.5, 2.0], [0.0, 0.5, 2.0]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        };
        let localised = |localisation| {
            let settings = MissionSettings { localisation, texel: 0.05, threads: 1, ..MissionSettings::default() };
            let task = PaintingTask::new("wall", &Scene::whole(wall.clone()), &Design::Stripes, settings).unwrap();
            [task.settings.localisation, task.in_map("map".into()).settings.localisation]
        };
        assert_eq!(localised(None), [None, Some(LocalisationChoice::Slam)]);
        let chosen = Some(LocalisationChoice::MotionCapture);
        assert_eq!(localised(chosen), [chosen, chosen]);
    }
}
