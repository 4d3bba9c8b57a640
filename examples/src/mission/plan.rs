//! How to fly it: strokes onto the surface, nozzle and vehicle along them.

use std::time::Instant;

use paint_net::{Painting, StrokeSettings, boustrophedon};
use paint_planner::{Error, OptimalPlanner, Plan, Planner, Settings, SmoothingPlanner, Target};

use super::decide::kernel;
use super::decision::Decision;
use super::dose_correction::correct_doses;
use super::error::MissionError;
use super::rehearse::rehearsed_plan;
use super::settings::{MissionSettings, PainterChoice};
use crate::adapters::MeshSurface;
use crate::progress::Stage;
use crate::surface::PaintSurface;
use crate::targets::{Route, route};

/// The layers as flights that have not been flown.
pub(super) struct Planned {
    /// Targets, plan, and the baseline's plan on the same targets.
    pub(super) layers: Vec<(Route, Plan, Plan)>,
    /// Time the optimal planner took, seconds on one core.
    pub(super) seconds: f64,
    /// Paint of layers that no pose of the robot can spray at all, m³.
    pub(super) unreachable_paint: f64,
    /// Targets that keep more clearance since the rehearsal in wind.
    pub(super) kept_off: usize,
    /// Targets given up in the rehearsal.
    pub(super) left_bare: usize,
}

/// Plans every layer; each flight begins where the one before ends.
pub(super) fn plan(decision: &Decision) -> Result<Planned, MissionError> {
    let Decision { layers, surface, robot, settings, .. } = decision;
    let stage = Stage::start("plan");
    let wall = MeshSurface(&surface.world);
    let mut planned = Planned {
        layers: Vec::with_capacity(layers.len()),
        seconds: 0.0,
        unreachable_paint: 0.0,
        kept_off: 0,
        left_bare: 0,
    };
    for (k, layer) in layers.iter().enumerate() {
        stage.share(k as f64 / layers.len() as f64);
        let from = planned.layers.last().and_then(|(route, ..)| route.targets.last().copied());
        let mut route = layer_route(layer, surface, settings, from.as_ref())?;
        if route.targets.len() < 2 {
            planned.unreachable_paint += route.lost;
            continue;
        }
        let start = planned.layers.last().and_then(|(_, plan, _)| plan.waypoints.last()).map(|w| w.state);
        let here = Settings { start, ..settings.planner.clone() };
        if settings.painter == PainterChoice::Fill {
            // Doses change the speed of the spot at most: nozzles and headings of the first plan are those of the last.
            let clock = Instant::now();
            match OptimalPlanner::default().plan(&route.targets, &wall, robot, &here) {
                Err(Error::NothingReachable { .. }) => {}
                first => correct_doses(&mut route.targets, &first?, decision),
            }
            planned.seconds += clock.elapsed().as_secs_f64();
        }
        let rehearsed = match rehearsed_plan(&route.targets, surface, robot, settings, &here) {
            Err(MissionError::Planner(Error::NothingReachable { .. })) => {
                planned.unreachable_paint += route.paint() + route.lost;
                continue;
            }
            rehearsed => rehearsed?,
        };
        planned.seconds += rehearsed.seconds;
        planned.kept_off += rehearsed.kept_off;
        planned.left_bare += rehearsed.left_bare;
        let plan = rehearsed.plan;
        let smoothing = SmoothingPlanner.plan(&route.targets, &wall, robot, &settings.planner)?;
        planned.layers.push((route, plan, smoothing));
    }
    if planned.layers.is_empty() {
        return Err(MissionError::OutOfReach { percent: 100.0 });
    }
    let metres: f64 = planned.layers.iter().map(|(_, plan, _)| path_length(plan)).sum();
    let rehearsed = match (planned.kept_off, planned.left_bare) {
        (0, 0) => String::new(),
        (kept, 0) => format!(", {kept} targets kept farther off after a rehearsal in wind"),
        (kept, bare) => format!(", {kept} targets kept farther off after a rehearsal in wind, {bare} left bare"),
    };
    stage.done(&format!("{metres:.0} m of path, {:.1} ms per metre{rehearsed}", 1e3 * planned.seconds / metres));
    Ok(planned)
}

/// The strokes of a layer on the surface, in the order in which they are flown after `from`.
pub(super) fn layer_route(
    layer: &Painting,
    surface: &PaintSurface,
    settings: &MissionSettings,
    from: Option<&Target>,
) -> Result<Route, MissionError> {
    let rows;
    let strokes = if layer.strokes.is_empty() {
        rows = boustrophedon(&layer.sprays, &StrokeSettings::default())?;
        &rows
    } else {
        &layer.strokes
    };
    Ok(route(surface, strokes, &kernel(settings)?, settings.limits.spray_spacing, from, &settings.planner)?)
}

/// Length of the vehicle's trajectory, metres.
pub(super) fn path_length(plan: &Plan) -> f64 {
    let steps = (plan.trajectory.duration() / 0.05).ceil().max(1.0);
    let at = |k: f64| plan.trajectory.sample(plan.trajectory.duration() * k / steps).position;
    (0..steps as usize).map(|k| (at(k as f64 + 1.0) - at(k as f64)).norm()).sum()
}
