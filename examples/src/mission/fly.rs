//! Flying it.

use paint_planner::Plan;
use paint_planner::mission::{Route, Turn};
use paint_planner::onboard::sorties;
use paint_planner::plan::{Planner as _, SmoothingPlanner};
use paint_sim::flight::FlightLog;
use paint_sim::flight::{Faults, Reference};
use paint_sim::{FlightSettings, Shot};

use super::compared_flight::{COMPARED, ComparedFlight, fly_beside};
use super::error::MissionError;
use super::flight_conditions::counted_flight;
use super::flight_sensors::{Poses, camera_before};
use super::flyer::{Flight, Flyer, Purpose};
use super::grounded::Grounded;
use super::painting_task::PaintingTask;
use super::plan::{Planned, PlannedLayer};
use super::settings::{KEPT_STEP, MissionSettings};
use super::simulated_flight::reference;
use super::sorties::{FlownPiece, Sorties, in_pieces};
use super::spray_flights::FlownPaint;
use crate::adapters::MeshSurface;
use crate::onboard::{LocalisationFigures, Piece};
use crate::progress::Stage;
use crate::simulated_sensors::SHOT_STEP;

/// Flights of other sorties have seeds so far apart.
const SORTIE: u64 = 0x1_0000;

/// One layer of paint, decided, planned and flown.
pub struct LayerFlight {
    /// Its strokes on the surface.
    pub route: Route,
    /// The plan.
    pub plan: Plan,
    /// How far the nozzle is from the normal of each target that the baseline planner serves.
    pub(super) smoothing_deviations: Vec<Option<f64>>,
    /// Flown with the localisation that was chosen: the flight whose paint counts, twenty times a second.
    pub flight: FlightLog,
    /// What it sprayed, with times, s; nothing once that is on the surface.
    pub(super) shots: Vec<(f64, Shot)>,
    /// When its last sample was, s.
    pub(super) landed: f64,
    /// What its localisation was worth, if that was the robot's own.
    pub(super) localisation: Option<LocalisationFigures>,
    /// Pieces that tank, battery, or what ended one in the air have cut it into.
    pub(super) sorties: usize,
    /// Time of the plan that was not flown, s: a later sortie could not be.
    pub(super) left_s: f64,
    /// Who has flown it.
    pub turn: Turn,
    /// When it begins, s after the first flight of the mission, without the time on the ground between coats.
    pub(super) start: f64,
    /// Whether the paint before it is dry when it begins.
    pub(super) on_dry: bool,
    /// Flown with a localisation that errs by 7 cm.
    pub slam: ComparedFlight,
    /// The baseline's plan flown with pan and tilt at zero (Paper II, section 7.2).
    pub locked: ComparedFlight,
}

impl LayerFlight {
    /// Time of the plan that was flown, s.
    pub(super) fn duration(&self) -> f64 {
        self.plan.trajectory.duration() - self.left_s
    }

    /// When it ends, s after the first flight of the mission begins.
    pub(super) fn end(&self) -> f64 {
        self.start + self.duration()
    }

    /// What it sprays.
    pub(super) fn paint(&self) -> FlownPaint<'_> {
        FlownPaint { shots: &self.shots, duration: self.landed, start: self.start, on_dry: self.on_dry }
    }
}

/// What was flown of a plan.
#[derive(Default)]
pub(super) struct Flown {
    /// Its layers in their order.
    pub(super) layers: Vec<LayerFlight>,
    /// Why they are not all, or not whole.
    pub(super) grounded: Option<Grounded>,
}

/// Flies every layer three times, after others whose paint is on the surface. The first flight of all that cannot be flown is an error, a later
/// one the end of it.
pub(super) fn fly(
    planned: Planned,
    task: &PaintingTask,
    before: &[LayerFlight],
    flyer: &mut dyn Flyer,
) -> Result<Flown, MissionError> {
    let stage = Stage::start("fly");
    let each = planned.layers.len();
    let count = each * planned.coats;
    let mut flights = Vec::with_capacity(count);
    let mut grounded: Option<Grounded> = None;
    let mut faulty = task.settings.clone();
    let (begun, coat) = (before.iter().map(LayerFlight::end).fold(0.0, f64::max), planned.coat_duration());
    let coats = std::iter::repeat_n(planned.layers, planned.coats).flatten();
    for (k, PlannedLayer { route, plan, turn, start }) in coats.enumerate() {
        if let Some(grounded) = &mut grounded {
            grounded.left_s += plan.trajectory.duration();
            continue;
        }
        let share = |part: f64| stage.share((k as f64 + part) / count as f64);
        let layer = before.len() + k;
        if layer > 0 {
            faulty.faults = Faults::default();
            faulty.sensor_faults.clear();
        }
        let mut told = Sorties::default();
        let sprayed: Vec<&LayerFlight> = before.iter().chain(&flights).collect();
        let counted = || {
            let (flight, sorties) = fly_sorties(&plan, task, &faulty, layer as u64, &sprayed, flyer, &share)?;
            told = sorties;
            let landed = flight.samples.last().map_or(0.0, |sample| sample.time);
            Ok((flight.timed_shots(SHOT_STEP), landed, flight.thinned(KEPT_STEP)))
        };
        let flown = smoothing(task, &route).and_then(|smoothing| {
            let flown = fly_beside([&plan, &smoothing], task.met(), &task.robot, &faulty, layer as u64, counted)?;
            Ok((deviations(&route, &smoothing), flown))
        });
        match flown {
            Ok((smoothing_deviations, ((shots, landed, flight), [slam, locked]))) => {
                let Sorties { localisation, count: sorties, ended } = told;
                let left_s = ended.as_ref().map_or(0.0, |ended| ended.left_s);
                grounded = ended;
                flights.push(LayerFlight {
                    plan,
                    smoothing_deviations,
                    flight,
                    shots,
                    landed,
                    localisation,
                    sorties,
                    left_s,
                    route,
                    turn,
                    start: begun + (k / each) as f64 * coat + start,
                    on_dry: layer > 0 && k % each == 0,
                    slam,
                    locked,
                });
            }
            Err(error) if layer > 0 => grounded = Some(Grounded::by(&error, plan.trajectory.duration())),
            Err(error) => return Err(error),
        }
    }
    let seconds: f64 = flights.iter().map(LayerFlight::duration).sum();
    let longest = flights.iter().map(LayerFlight::duration).fold(0.0, f64::max);
    let times = if longest > COMPARED { ", two more times for half an hour of each flight" } else { ", three times" };
    stage.done(&format!("{:.0} min in the air{times}", seconds / 60.0));
    Ok(Flown { layers: flights, grounded })
}

/// The plan of the baseline on the same targets.
fn smoothing(task: &PaintingTask, route: &Route) -> Result<Plan, MissionError> {
    let mesh = MeshSurface(&task.surface.world);
    Ok(SmoothingPlanner.plan(&route.targets, &mesh, task.planned_robot.tool(), &task.settings.planner)?)
}

/// How far the nozzle is from the normal of each target that is served.
fn deviations(route: &Route, plan: &Plan) -> Vec<Option<f64>> {
    let nozzles = route.targets.iter().zip(&plan.nozzle).zip(&plan.reachable);
    nozzles.map(|((target, nozzle), served)| served.then(|| target.normal_deviation(&nozzle.position))).collect()
}

/// The flight whose paint counts, in as many sorties as tank and battery ask for; each has wind of its own, and finds itself anew before the
/// paint that is there by then. `share` hears how much of the plan is flown.
fn fly_sorties(
    plan: &Plan,
    task: &PaintingTask,
    settings: &MissionSettings,
    layer: u64,
    before: &[&LayerFlight],
    flyer: &mut dyn Flyer,
    share: &dyn Fn(f64),
) -> Result<(FlightLog, Sorties), MissionError> {
    let flow = |time: f64| plan.setpoint(time).flow;
    let duration = plan.trajectory.duration();
    let pieces = if settings.endurance.is_endless() {
        vec![None]
    } else {
        sorties(duration, &flow, &settings.endurance)?.into_iter().map(Some).collect()
    };
    let usual = counted_flight(plan, &task.robot, settings, layer);
    let whole = reference(plan, &task.robot, settings);
    in_pieces(&pieces, duration, &mut |k, piece, flown| {
        let conditions = FlightSettings {
            seed: usual.seed.wrapping_add(SORTIE * k as u64),
            faults: if k == 0 { usual.faults } else { Faults::default() },
            ..usual
        };
        let from = piece.map_or(0.0, |piece| piece.from);
        let piece = piece.map(|sortie| Piece::of(&whole, sortie));
        let reference: &dyn Reference = piece.as_ref().map_or(&whole, |piece| piece);
        let camera = || {
            let before = before.iter().flat_map(|flight| flight.shots.iter().map(|(_, shot)| *shot));
            camera_before(task, before.chain(flown.map(|log| log.shots(SHOT_STEP)).into_iter().flatten()))
        };
        let faults = if k == 0 { &settings.sensor_faults[..] } else { &[] };
        let mut poses = Poses::of(task, camera, 0, &conditions)?.with_faults(faults);
        let flight = Flight { task, purpose: Purpose::Paint, reference, conditions };
        let (log, ended) = flyer.fly(&flight, poses.source(), &|time| share((from + time) / duration))?;
        let log = piece.iter().fold(log, |log, piece| piece.cut(log));
        Ok(FlownPiece { log, localisation: poses.figures(), ended })
    })
}

/// The flight whose paint counts in one sortie by motion capture or noise, with those beside it, for the tests of the mission's parts.
#[cfg(test)]
pub(super) fn fly_three(
    plan: &Plan,
    world: &paint_sim::TriangleSurface,
    robot: &crate::adapters::Robot,
    settings: &MissionSettings,
    layer: u64,
) -> Result<(FlightLog, [ComparedFlight; 2]), MissionError> {
    let first = counted_flight(plan, robot, settings, layer);
    let counted = || super::simulated_flight::fly_plan(plan, world, robot, settings, &first);
    fly_beside([plan, plan], world, robot, settings, layer, counted)
}

#[cfg(test)]
mod tests {
    use paint_planner::onboard::Endurance;
    use paint_planner::timing::TimingPolicy;
    use ptu_kinematics::Ptu;

    use super::super::simulated_flight::{fly_reference, noise};
    use super::super::test_panel;
    use super::*;
    use crate::adapters::Robot;

    #[test]
    fn the_seed_and_the_layer_change_wind_and_localisation() {
        let settings = MissionSettings { seed: 1, threads: 1, ..MissionSettings::default() };
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let plan = test_panel::plan(&surface, &robot, &settings);
        let fly = |seed, layer| {
            let settings = MissionSettings { seed, ..settings.clone() };
            fly_three(&plan, &surface.world, &robot, &settings, layer).unwrap()
        };
        let (usual, again, other, next) = (fly(1, 0), fly(1, 0), fly(2, 0), fly(1, 1));
        assert_eq!(usual, again);
        for (changed, why) in [(other, "ignores the seed"), (next, "is the same in every layer")] {
            assert_ne!(usual.0, changed.0, "the flight {why}");
            for k in 0..2 {
                assert_ne!(usual.1[k], changed.1[k], "flight {k} beside it {why}");
            }
        }
    }

    /// A wave of 20 s in pieces of a battery: every moment of the plan is sprayed once, as much as without pieces, and meets its aim.
    #[test]
    fn sorties_leave_nothing_out_and_nothing_twice() {
        let mut settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        settings.planner.timing.policy = TimingPolicy::Uniform { speed: 0.05 };
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let plan = test_panel::plan(&surface, &robot, &settings);
        let all = reference(&plan, &robot, &settings);
        let fly = |reference: &dyn Reference, seed| {
            let flight = FlightSettings { seed, ..counted_flight(&plan, &robot, &settings, 0) };
            fly_reference(reference, &surface.world, &robot, &settings, &flight, &mut noise(&flight)).unwrap().0
        };
        let part = |sortie, seed| {
            let piece = Piece::of(&all, sortie);
            piece.cut(fly(&piece, seed))
        };
        let endurance = Endurance { battery: Some(47.0), ..Endurance::default() };
        let pieces = sorties(plan.trajectory.duration(), &|t| plan.setpoint(t).flow, &endurance).unwrap();
        assert!(pieces.len() >= 3, "{pieces:?}");
        let logs: Vec<FlightLog> = pieces.iter().zip(1..).map(|(piece, seed)| part(*piece, seed)).collect();
        let whole = fly(&all, 1);
        let joined: Vec<_> = logs.iter().flat_map(|log| log.samples.iter().copied()).collect();
        assert_eq!(joined.len(), whole.samples.len());
        for (joined, whole) in joined.iter().zip(&whole.samples) {
            assert!((joined.time - whole.time).abs() < 1e-9);
            // Where paint begins or ends, rounding of the time may move it by a sample's share.
            assert!((joined.flow - whole.flow).abs() < 0.05 * whole.flow + 1e-12, "{} {}", joined.time, joined.flow);
            assert!(!joined.held);
        }
        let miss = |sample: &paint_sim::flight::FlightSample| (sample.hit.unwrap() - sample.aim.unwrap()).norm();
        let worst = joined.iter().filter(|sample| sample.flow > 0.0).map(miss).fold(0.0, f64::max);
        assert!(worst < settings.spot, "{worst} m");
    }
}
