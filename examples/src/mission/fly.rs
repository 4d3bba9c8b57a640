//! Flying it, and what the paint does meanwhile.

use paint_net::Image;
use paint_planner::Plan;
use paint_planner::mission::Route;
use paint_planner::onboard::sorties;
use paint_sim::flight::FlightLog;
use paint_sim::flight::{Faults, Localisation, Reference};
use paint_sim::{FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::flight_conditions::{counted_flight, usual_flight};
use super::flight_sensors::{Poses, camera_before};
use super::flyer::{Flight, Flyer, Purpose};
use super::grounded::Grounded;
use super::painting_task::PaintingTask;
use super::plan::Planned;
use super::settings::MissionSettings;
use super::simulated_flight::{fly_plan, reference};
use super::sorties::{FlownPiece, Sorties, in_pieces};
use super::wet_surface::{DriedSurface, WetSurface};
use crate::adapters::Robot;
use crate::onboard::{LocalisationFigures, Piece};
use crate::progress::Stage;
use crate::simulated_sensors::SHOT_STEP;

/// Parts of the spraying after which the surface is shown.
const PARTS: usize = 3;
/// Flights of other sorties have seeds so far apart.
const SORTIE: u64 = 0x1_0000;

/// One layer of paint, decided, planned and flown.
pub struct LayerFlight {
    /// Its strokes on the surface.
    pub route: Route,
    /// The plan.
    pub plan: Plan,
    /// The baseline planner on the same targets.
    pub smoothing: Plan,
    /// Flown with the localisation that was chosen: the flight whose paint counts.
    pub flight: FlightLog,
    /// What its localisation was worth, if that was the robot's own.
    pub(super) localisation: Option<LocalisationFigures>,
    /// Pieces that tank, battery, or what ended one in the air have cut it into.
    pub(super) sorties: usize,
    /// Time of the plan that was not flown, s: a later sortie could not be.
    pub(super) left_s: f64,
    /// Whether the paint before it is dry when it begins.
    pub(super) on_dry: bool,
    /// Flown with a localisation that errs by 7 cm.
    pub slam: FlightLog,
    /// The baseline's plan flown with pan and tilt at zero (Paper II, section 7.2).
    pub locked: FlightLog,
}

impl LayerFlight {
    /// Time of the plan that was flown, s.
    pub(super) fn duration(&self) -> f64 {
        self.plan.trajectory.duration() - self.left_s
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
    let coats = std::iter::repeat_n(planned.layers, planned.coats).flatten();
    for (k, (route, plan, smoothing)) in coats.enumerate() {
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
        let logs: Vec<&FlightLog> = before.iter().chain(&flights).map(|layer| &layer.flight).collect();
        let counted = || {
            let (flight, sorties) = fly_sorties(&plan, task, &faulty, layer as u64, &logs, flyer, &share)?;
            told = sorties;
            Ok(flight)
        };
        match fly_beside([&plan, &smoothing], task.met(), &task.robot, &faulty, layer as u64, counted) {
            Ok([flight, slam, locked]) => {
                let Sorties { localisation, count: sorties, ended } = told;
                let left_s = ended.as_ref().map_or(0.0, |ended| ended.left_s);
                grounded = ended;
                flights.push(LayerFlight {
                    route,
                    plan,
                    smoothing,
                    flight,
                    localisation,
                    sorties,
                    left_s,
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
    stage.done(&format!("{:.0} min in the air, three times", seconds / 60.0));
    Ok(Flown { layers: flights, grounded })
}

/// The flight whose paint counts, in as many sorties as tank and battery ask for; each has wind of its own, and finds itself anew before the
/// paint that is there by then. `share` hears how much of the plan is flown.
fn fly_sorties(
    plan: &Plan,
    task: &PaintingTask,
    settings: &MissionSettings,
    layer: u64,
    before: &[&FlightLog],
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
        let camera = || camera_before(task, before.iter().copied().chain(flown));
        let faults = if k == 0 { &settings.sensor_faults[..] } else { &[] };
        let mut poses = Poses::of(task, camera, 0, &conditions)?.with_faults(faults);
        let flight = Flight { task, purpose: Purpose::Paint, reference, conditions };
        let (log, ended) = flyer.fly(&flight, poses.source(), &|time| share((from + time) / duration))?;
        let log = piece.iter().fold(log, |log, piece| piece.cut(log));
        Ok(FlownPiece { log, localisation: poses.figures(), ended })
    })
}

/// Flights' paint on a surface.
pub(super) struct Sprayed {
    /// The paint.
    pub(super) surface: DriedSurface,
    /// Depth per pixel after each of equal parts of the spraying but the last; none of a picture's paint.
    pub(super) before: Vec<Image>,
}

/// Puts the paint of flights onto the texels; before those marked so what is there dries.
pub(super) fn spray<'a>(
    flights: impl Iterator<Item = (&'a FlightLog, bool)>,
    task: &PaintingTask,
) -> Result<Sprayed, MissionError> {
    let stage = Stage::start("spray");
    let mut surface = WetSurface::new(task)?;
    let flights: Vec<_> = flights.map(|(log, dry)| (log, log.timed_shots(SHOT_STEP), dry)).collect();
    let total: usize = flights.iter().map(|(_, shots, _)| shots.len()).sum();
    let part = total.div_ceil(PARTS).max(1);
    let (mut before, mut sprayed) = (Vec::new(), 0);
    for (k, (log, shots, _)) in flights.iter().enumerate() {
        let mut rest = &shots[..];
        while !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min(part - sprayed % part));
            surface.spray(now, task, &|done| stage.share((sprayed + done) as f64 / total as f64))?;
            (sprayed, rest) = (sprayed + now.len(), later);
            // A picture's paints are shown together.
            if sprayed % part == 0 && sprayed < total && !task.of_picture {
                before.push(surface.depth(task));
            }
        }
        let duration = log.samples.last().map_or(0.0, |sample| sample.time);
        surface.land(duration, flights.get(k + 1).is_some_and(|next| next.2))?;
    }
    let surface = surface.dry()?;
    let balance = surface.film.mass_balance();
    let share = 100.0 * balance.deposited as f64 / balance.emitted.max(1) as f64;
    let ran = if surface.ran.contains(&true) { ", some of which ran: see sagging.png" } else { "" };
    stage.done(&format!("{share:.1} % of the paint on the surface{ran}"));
    Ok(Sprayed { surface, before })
}

/// The flight whose paint counts, as it is `counted`, the same plan with a drifting localisation, and the smoothing plan with the gun locked.
fn fly_beside(
    [plan, smoothing]: [&Plan; 2],
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    layer: u64,
    counted: impl FnOnce() -> Result<FlightLog, MissionError>,
) -> Result<[FlightLog; 3], MissionError> {
    let ptu_locked = settings.path_planner.locks_gun();
    let others = [
        (
            plan,
            FlightSettings {
                localisation: Localisation::slam_7cm(),
                ptu_locked,
                ..usual_flight(plan, robot, settings, layer)
            },
        ),
        (smoothing, FlightSettings { ptu_locked: true, ..usual_flight(smoothing, robot, settings, layer) }),
    ];
    let one = |(plan, flight): &(&Plan, FlightSettings)| fly_plan(plan, world, robot, settings, flight);
    if settings.threads < 2 {
        let (a, [b, c]) = (counted(), others.each_ref().map(one));
        return Ok([a?, b?, c?]);
    }
    std::thread::scope(|scope| {
        let handles = others.each_ref().map(|flight| scope.spawn(move || one(flight)));
        let a = counted();
        let [b, c] = handles.map(|h| h.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        Ok([a?, b?, c?])
    })
}

/// The same in one sortie by motion capture or noise, for the tests of the mission's parts.
#[cfg(test)]
pub(super) fn fly_three(
    plan: &Plan,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    layer: u64,
) -> Result<[FlightLog; 3], MissionError> {
    let first = counted_flight(plan, robot, settings, layer);
    let counted = || fly_plan(plan, world, robot, settings, &first);
    fly_beside([plan, plan], world, robot, settings, layer, counted)
}

#[cfg(test)]
mod tests {
    use paint_planner::onboard::Endurance;
    use paint_planner::timing::TimingPolicy;
    use paint_sim::{Film, Shot};
    use ptu_kinematics::Ptu;

    use super::super::nozzle::spray_model;
    use super::super::simulated_flight::{fly_reference, noise};
    use super::super::test_panel;
    use super::*;
    use crate::region::Scene;

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
        for k in 0..3 {
            assert_eq!(usual[k], again[k]);
            assert_ne!(usual[k], other[k], "flight {k} ignores the seed");
            assert_ne!(usual[k], next[k], "flight {k} is the same in every layer");
        }
    }

    /// After each third of the shots their paint lies there, and in the end what one call would have sprayed.
    #[test]
    fn the_paint_grows_by_thirds() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let log = test_panel::flown(&settings).1;
        let task = PaintingTask::undecided("wall", &Scene::whole(test_panel::mesh()), settings.clone()).unwrap();
        let Sprayed { surface: DriedSurface { film, pixels, .. }, before } =
            spray(std::iter::once((&log, false)), &task).unwrap();
        let mut at_once = Film::new(task.film_texels().0).unwrap();
        let shots = log.shots(SHOT_STEP);
        at_once.deposit(&shots, &spray_model(&settings), task.met(), 1, &mut |_, _| ()).unwrap();
        assert_eq!(film.mass_balance(), at_once.mass_balance());
        let painted = task.depth_of(&film, &pixels);
        assert_eq!(painted, task.depth_of(&at_once, &pixels));
        let sum = |depth: &Image| depth.data().iter().sum::<f64>();
        assert_eq!(before.len(), 2);
        for (part, depth) in before.iter().enumerate() {
            let sprayed = |shots: &[Shot]| shots.iter().map(|shot| shot.volume).sum::<f64>();
            let share = sprayed(&shots[..(part + 1) * shots.len().div_ceil(3)]) / sprayed(&shots);
            assert!((sum(depth) / sum(&painted) - share).abs() < 0.01, "{share} after part {part}");
            assert!(depth.data().iter().zip(painted.data()).all(|(then, end)| then <= end));
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
