//! How to fly it: strokes onto the surface, nozzle and vehicle along them.

use paint_net::Painting;
use paint_net::path::{StrokeSettings, boustrophedon};
use paint_planner::mission::{
    LiftedStrokes, MissionFlight, MissionPlan, MissionPlanner, NoRehearsal, Rehearsal, Route, Spray, TargetOutcomes,
    Turn,
};
use paint_planner::{Error, Plan, Planner, Settings, Surface, Target, Tool};
use std::cell::Cell;
use std::time::Instant;

use super::dose_correction::{correct_doses, correct_ink};
use super::error::MissionError;
use super::nozzle::{kernel, sprays};
use super::painting_task::PaintingTask;
use super::rehearsal::WindRehearsal;
use super::settings::{MissionSettings, PainterChoice};
use super::wet_surface::coats;
use crate::adapters::MeshSurface;
use crate::progress::Stage;
use crate::say;
use crate::surface::PaintSurface;

/// Shortest stretch worth another flight, in deviations of a spot: one spot is wider.
const SHORTEST_RETRY: f64 = 2.0;

/// A flight that has not been flown.
#[derive(Clone)]
pub struct PlannedLayer {
    /// Its strokes on the surface.
    pub route: Route,
    /// The plan.
    pub plan: Plan,
    /// Who flies it.
    pub turn: Turn,
    /// When it begins, s after the first of its coat.
    pub(super) start: f64,
}

impl From<MissionFlight> for PlannedLayer {
    fn from(MissionFlight { route, plan, turn, start, .. }: MissionFlight) -> Self {
        Self { route, plan, turn, start }
    }
}

impl PlannedLayer {
    /// When it ends, s after the first of its coat begins.
    fn end(&self) -> f64 {
        self.start + self.plan.trajectory.duration()
    }
}

/// The layers as flights that have not been flown.
pub(super) struct Planned {
    /// Those of one coat.
    pub(super) layers: Vec<PlannedLayer>,
    /// Coats in which they are flown, each after the one before has dried; a flight carries its share of the paint.
    pub(super) coats: usize,
    /// Time the planner took, seconds on one core.
    pub(super) seconds: f64,
    /// Paint of layers that no pose of the robot can spray at all, m³.
    pub(super) unreachable_paint: f64,
    /// Targets that keep more clearance since the rehearsal in wind.
    pub(super) kept_off: usize,
    /// Targets given up in the rehearsal, with paint or without.
    pub(super) left_bare: usize,
    /// What becomes of the targets with paint.
    pub(super) outcomes: TargetOutcomes,
}

impl Planned {
    /// From the first take-off of a coat to its last landing, s.
    pub(super) fn coat_duration(&self) -> f64 {
        self.layers.iter().map(PlannedLayer::end).fold(0.0, f64::max)
    }
}

/// The planner that was chosen and the time it takes, seconds.
struct TimedPlanner {
    planner: Box<dyn Planner>,
    seconds: Cell<f64>,
}

impl TimedPlanner {
    fn new(settings: &MissionSettings) -> Self {
        Self { planner: settings.path_planner.planner(), seconds: Cell::new(0.0) }
    }
}

impl Planner for TimedPlanner {
    fn name(&self) -> &'static str {
        self.planner.name()
    }

    fn plan_with_clearance(
        &self,
        targets: &[Target],
        clearance: &[Option<f64>],
        surface: &dyn Surface,
        tool: &dyn Tool,
        settings: &Settings,
    ) -> Result<Plan, Error> {
        let clock = Instant::now();
        let plan = self.planner.plan_with_clearance(targets, clearance, surface, tool, settings);
        self.seconds.set(self.seconds.get() + clock.elapsed().as_secs_f64());
        plan
    }
}

/// The flights of all layers while their doses may still change.
pub(super) struct Draft {
    pub(super) mission: MissionPlan,
    /// Time the planner took, seconds on one core.
    seconds: f64,
}

/// Plans every layer; each flight begins where the one before ends.
pub(super) fn plan(task: &PaintingTask) -> Result<Planned, MissionError> {
    finish(task, draft(task)?)
}

/// The flights of all layers, with doses corrected unless they depend on those of other paints.
pub(super) fn draft(task: &PaintingTask) -> Result<Draft, MissionError> {
    let PaintingTask { layers, surface, robot, settings, .. } = task;
    let stage = Stage::start("plan");
    let mesh = MeshSurface(&surface.world);
    let timed = TimedPlanner::new(settings);
    let obstacles = settings.constraints.around(&mesh);
    let rehearsal = WindRehearsal { surface, robot, settings };
    let planner = mission_planner(task, &timed, &obstacles, &rehearsal);
    let mut mission = MissionPlan::default();
    for (k, layer) in layers.iter().enumerate() {
        stage.share(k as f64 / layers.len() as f64);
        let first = mission.flights.len();
        planner.add_strokes(&layer_strokes(layer, surface, settings)?, &mut mission)?;
        if settings.painter == PainterChoice::Fill {
            let flights = &mut mission.flights[first..];
            let mut parts: Vec<(&mut [Target], &Plan)> =
                flights.iter_mut().map(|f| (f.route.targets.as_mut_slice(), &f.plan)).collect();
            let expected = correct_doses(&mut parts, task)?;
            say!(
                "coat: doses corrected on the surface, expected to be even within {:.1} % (deviation over mean)",
                100.0 * expected
            );
            planner.replan(first, &mut mission)?;
        } else if layers.len() == 1 && !task.of_picture {
            let flights = &mut mission.flights[first..];
            let mut parts: Vec<(&mut [Target], &Plan)> =
                flights.iter_mut().map(|f| (f.route.targets.as_mut_slice(), &f.plan)).collect();
            correct_ink(&mut parts, task)?;
            planner.replan(first, &mut mission)?;
        }
    }
    if mission.flights.is_empty() {
        return Err(MissionError::OutOfReach { percent: 100.0 });
    }
    let metres: f64 = mission.flights.iter().map(|flight| flight.plan.path_length()).sum();
    stage.done(&format!("{metres:.0} m of path"));
    Ok(Draft { mission, seconds: timed.seconds.get() })
}

/// Plans all flights again for doses that were changed.
pub(super) fn replan(task: &PaintingTask, draft: &mut Draft) -> Result<(), MissionError> {
    let PaintingTask { surface, robot, settings, .. } = task;
    let mesh = MeshSurface(&surface.world);
    let timed = TimedPlanner::new(settings);
    let obstacles = settings.constraints.around(&mesh);
    let rehearsal = WindRehearsal { surface, robot, settings };
    mission_planner(task, &timed, &obstacles, &rehearsal).replan(0, &mut draft.mission)?;
    draft.seconds += timed.seconds.get();
    Ok(())
}

/// The flights as they are flown: in coats that do not run, each when no other is in its way.
pub(super) fn finish(task: &PaintingTask, mut draft: Draft) -> Result<Planned, MissionError> {
    let (coats, _) = coats(task);
    if coats > 1 {
        say!("{}: in {coats} coats, as it would run in one", task.paint.name);
        let targets = draft.mission.flights.iter_mut().flat_map(|flight| &mut flight.route.targets);
        targets.for_each(|target| target.dose /= coats as f64);
        replan(task, &mut draft)?;
    }
    let Draft { mut mission, seconds } = draft;
    mission.schedule(&task.settings.team)?;
    say_of_robots_without_room(task, &mission);
    let PaintingTask { layers, settings, .. } = task;
    let planned = Planned {
        coats,
        seconds,
        unreachable_paint: mission.refused_volume,
        kept_off: mission.flights.iter().map(MissionFlight::kept_off).sum(),
        left_bare: mission.flights.iter().map(MissionFlight::excluded).sum(),
        outcomes: mission.outcomes(),
        layers: mission.flights.into_iter().map(PlannedLayer::from).collect(),
    };
    let metres: f64 = planned.layers.iter().map(|layer| layer.plan.path_length()).sum();
    let rehearsed = match (planned.kept_off, planned.left_bare) {
        _ if settings.check_simulated().is_err() => {
            ", not rehearsed in wind: nothing simulates a pitched hover".to_owned()
        }
        _ if !settings.path_planner.is_rehearsed() => {
            ", not rehearsed in wind: this planner ignores collisions".to_owned()
        }
        (0, 0) => String::new(),
        (kept, 0) => format!(", {kept} targets kept farther off after a rehearsal in wind"),
        (kept, bare) => format!(", {kept} targets kept farther off after a rehearsal in wind, {bare} left bare"),
    };
    let cells = layers.len() * if settings.team.robots > 1 { 2 * settings.team.robots } else { 1 };
    let again = match planned.layers.len().saturating_sub(cells) {
        0 => String::new(),
        more => format!(", {more} of {} flights for what another gave up", planned.layers.len()),
    };
    say!(
        "{}: {metres:.0} m of path, {:.1} ms per metre{again}{rehearsed}",
        task.paint.name,
        1e3 * planned.seconds / metres
    );
    Ok(planned)
}

/// Layers in which not all robots of the team find room.
fn say_of_robots_without_room(task: &PaintingTask, mission: &MissionPlan) {
    let asked = task.settings.team.robots;
    for layer in 0..task.layers.len() {
        let robots = mission.robots(layer);
        if (1..asked).contains(&robots) {
            let paint = &task.paint.name;
            say!(
                "{paint}, layer {}: wanted where there is room for {robots} of {asked} robots side by side",
                layer + 1
            );
        }
    }
}

/// Who plans the flights of a mission.
fn mission_planner<'a, R: Rehearsal>(
    task: &'a PaintingTask,
    planner: &'a dyn Planner,
    surface: &'a dyn Surface,
    rehearsal: &'a R,
) -> MissionPlanner<'a, R> {
    let settings = paint_planner::mission::MissionSettings {
        planner: task.settings.planner.clone(),
        team: task.settings.team,
        shortest_retry: SHORTEST_RETRY * task.settings.spot,
        ..paint_planner::mission::MissionSettings::default()
    };
    MissionPlanner { planner, surface, tool: task.planned_robot.tool(), rehearsal, settings }
}

/// The flights of all layers as they are before any rehearsal.
pub(super) fn unrehearsed(task: &PaintingTask) -> Result<MissionPlan, MissionError> {
    let mesh = MeshSurface(&task.surface.world);
    let obstacles = task.settings.constraints.around(&mesh);
    let chosen = task.settings.path_planner.planner();
    let planner = mission_planner(task, chosen.as_ref(), &obstacles, &NoRehearsal);
    let mut mission = MissionPlan::default();
    for layer in &task.layers {
        planner.add_strokes(&layer_strokes(layer, &task.surface, &task.settings)?, &mut mission)?;
    }
    mission.schedule(&task.settings.team)?;
    Ok(mission)
}

/// The strokes of a layer on the surface.
pub(super) fn layer_strokes(
    layer: &Painting,
    surface: &PaintSurface,
    settings: &MissionSettings,
) -> Result<LiftedStrokes, MissionError> {
    let rows;
    let strokes = if layer.strokes.is_empty() {
        rows = boustrophedon(&layer.sprays, &StrokeSettings::default())?;
        &rows
    } else {
        &layer.strokes
    };
    let kernel = kernel(settings)?;
    let strokes: Vec<Vec<Spray>> = strokes.iter().map(|stroke| sprays(stroke, &kernel, settings)).collect();
    Ok(LiftedStrokes::lift(surface, &strokes, settings.limits.spray_spacing as f64))
}
