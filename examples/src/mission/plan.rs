//! How to fly it: strokes onto the surface, nozzle and vehicle along them.

use paint_net::Painting;
use paint_net::path::{StrokeSettings, boustrophedon};
use paint_planner::{Error, NotServed, Plan, Planner, Settings, SmoothingPlanner, Target, VehicleState};

use super::decision::Decision;
use super::dose_correction::correct_doses;
use super::error::MissionError;
use super::given_up::take_given_up;
use super::nozzle::kernel;
use super::rehearse::{Rehearsed, rehearsed_plan};
use super::service::Service;
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
    /// Which targets are served.
    pub(super) service: Service,
}

/// Flights of a layer: the first gives stretches up that a pose reaches, since all of a stroke is one program; those become strokes
/// of the next.
const FLIGHTS: usize = 3;
/// Weights between neighbours of what is flown once more, against those of the first flight: nozzles stay nearer to their normals.
const LOOSER: f64 = 0.1;

/// A flight of a layer, rehearsed.
struct Flight {
    route: Route,
    settings: Settings,
    rehearsed: Rehearsed,
}

/// Where a flight ends: the vehicle, and the last target.
type FlightEnd = (Option<VehicleState>, Option<Target>);

impl Flight {
    /// Plans and rehearses; `None` where nothing can be reached. What is flown once more (`again`) may also lie where no flight leads to.
    fn plan(
        again: bool,
        route: Route,
        clearance: Vec<f64>,
        settings: Settings,
        decision: &Decision,
        planned: &mut Planned,
    ) -> Result<Option<Self>, MissionError> {
        let Decision { surface, robot, settings: mission, .. } = decision;
        let rehearsed = if route.targets.len() < 2 {
            Err(NotServed::OutOfReach)
        } else {
            match rehearsed_plan(&route.targets, clearance, surface, robot, mission, &settings) {
                Err(MissionError::Planner(Error::NoTransit { .. })) if again => Err(NotServed::NoTransit),
                Err(MissionError::Planner(Error::Collision { .. })) if again => Err(NotServed::TooNear),
                rehearsed => rehearsed?.ok_or(NotServed::NoHeading),
            }
        };
        let rehearsed = match rehearsed {
            Ok(rehearsed) => rehearsed,
            Err(why) => {
                planned.unreachable_paint += route.paint() + route.lost;
                planned.service.add_refused(&route.targets, why);
                return Ok(None);
            }
        };
        planned.seconds += rehearsed.seconds;
        Ok(Some(Self { route, settings, rehearsed }))
    }

    fn end(&self) -> FlightEnd {
        (self.rehearsed.plan.waypoints.last().map(|w| w.state), self.route.targets.last().copied())
    }
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
        service: Service::default(),
    };
    let mut start: FlightEnd = (None, None);
    for (k, layer) in layers.iter().enumerate() {
        stage.share(k as f64 / layers.len() as f64);
        let route = layer_route(layer, surface, settings, start.1.as_ref())?;
        let mut flights = layer_flights(route, start, decision, &mut planned)?;
        if settings.painter == PainterChoice::Fill {
            flights = evened(flights, start, decision, &mut planned)?;
        }
        start = flights.last().map_or(start, Flight::end);
        for Flight { route, rehearsed, .. } in flights {
            planned.kept_off += rehearsed.kept_off;
            planned.left_bare += rehearsed.left_bare;
            planned.service.add_flight(&route.targets, &rehearsed.plan, &rehearsed.clearance);
            let smoothing = SmoothingPlanner.plan(&route.targets, &wall, robot, &settings.planner)?;
            planned.layers.push((route, rehearsed.plan, smoothing));
        }
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
    let again = match planned.layers.len().saturating_sub(layers.len()) {
        0 => String::new(),
        more => format!(", {more} of {} flights for what another gave up", planned.layers.len()),
    };
    stage.done(&format!("{metres:.0} m of path, {:.1} ms per metre{again}{rehearsed}", 1e3 * planned.seconds / metres));
    Ok(planned)
}

/// The flights of a layer: its route, and what is given up there once more by itself.
fn layer_flights(
    route: Route,
    mut start: FlightEnd,
    decision: &Decision,
    planned: &mut Planned,
) -> Result<Vec<Flight>, MissionError> {
    let Decision { surface, robot, settings, .. } = decision;
    let planner = &settings.planner;
    let mut flights: Vec<Flight> = Vec::new();
    let mut next = Some(route);
    while let Some(route) = next.take() {
        let mut here = Settings { start: start.0, ..planner.clone() };
        if !flights.is_empty() {
            (here.nozzle.ca, here.nozzle.cb) = (LOOSER * planner.nozzle.ca, LOOSER * planner.nozzle.cb);
        }
        let clearance = vec![planner.clearance; route.targets.len()];
        let Some(mut flight) = Flight::plan(!flights.is_empty(), route, clearance, here, decision, planned)? else {
            break;
        };
        start = flight.end();
        if flights.len() + 1 < FLIGHTS {
            let Flight { route, rehearsed, .. } = &mut flight;
            next = take_given_up(&mut route.targets, &rehearsed.plan, start.1.as_ref(), surface, robot, settings)?;
        }
        flights.push(flight);
    }
    Ok(flights)
}

/// The same flights with doses for an even coat. Doses change the speed of the spot at most, so they are corrected for nozzles and
/// clearances that have been rehearsed.
fn evened(
    mut flights: Vec<Flight>,
    start: FlightEnd,
    decision: &Decision,
    planned: &mut Planned,
) -> Result<Vec<Flight>, MissionError> {
    let mut parts: Vec<(&mut [Target], &Plan)> =
        flights.iter_mut().map(|f| (f.route.targets.as_mut_slice(), &f.rehearsed.plan)).collect();
    let expected = correct_doses(&mut parts, decision);
    eprintln!(
        "coat: doses corrected on the surface, expected to be even within {:.1} % (deviation over mean)",
        100.0 * expected
    );
    let mut even: Vec<Flight> = Vec::with_capacity(flights.len());
    for Flight { route, settings, rehearsed } in flights {
        let from = even.last().map_or(start, Flight::end);
        let here = Settings { start: from.0, ..settings };
        even.extend(Flight::plan(!even.is_empty(), route, rehearsed.clearance, here, decision, planned)?);
    }
    Ok(even)
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
