//! Flying it, and what the paint does meanwhile.

use paint_planner::Plan;
use paint_planner::mission::Route;
use paint_sim::flight::FlightLog;
use paint_sim::flight::{Faults, Interlock, Localisation, PoseSource, Valve};
use paint_sim::{Film, FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::flight_sensors::{camera_before, localised_flight};
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;
use super::plan::Planned;
use super::settings::{LocalisationChoice, MissionSettings};
use super::simulated_flight::{flight_settings, fly_plan};
use crate::adapters::Robot;
use crate::onboard::{LocalisationFigures, LocalisedFlight};
use crate::progress::Stage;
use crate::simulated_sensors::SHOT_STEP;

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
    /// Flown with a localisation that errs by 7 cm.
    pub slam: FlightLog,
    /// Flown with the pan-tilt unit locked forward.
    pub locked: FlightLog,
}

/// Flies every layer three times, after others whose paint is on the surface.
pub(super) fn fly(
    planned: Planned,
    task: &PaintingTask,
    before: &[LayerFlight],
) -> Result<Vec<LayerFlight>, MissionError> {
    let stage = Stage::start("fly");
    let count = planned.layers.len();
    let mut flights = Vec::with_capacity(count);
    let mut faulty = task.settings.clone();
    for (k, (route, plan, smoothing)) in planned.layers.into_iter().enumerate() {
        stage.share(k as f64 / count as f64);
        let mut onboard = onboard(task, before.iter().chain(&flights))?;
        let layer = before.len() + k;
        if layer > 0 {
            faulty.faults = Faults::default();
        }
        let [flight, slam, locked] =
            fly_three(&plan, task.met(), &task.robot, &faulty, layer as u64, onboard.as_mut())?;
        let localisation = onboard.map(|onboard| onboard.figures());
        flights.push(LayerFlight { route, plan, smoothing, flight, localisation, slam, locked });
    }
    let seconds: f64 = flights.iter().map(|f| f.plan.trajectory.duration()).sum();
    stage.done(&format!("{:.0} min in the air, three times", seconds / 60.0));
    Ok(flights)
}

/// The robot's own localisation, if it is to fly by that, before a surface with the paint of earlier flights. It finds itself anew before
/// every flight.
pub(super) fn onboard<'a, 'b>(
    task: &'a PaintingTask,
    before: impl Iterator<Item = &'b LayerFlight>,
) -> Result<Option<LocalisedFlight<'a>>, MissionError> {
    if task.settings.localisation != LocalisationChoice::Slam {
        return Ok(None);
    }
    let camera = camera_before(task, before.map(|layer| &layer.flight))?;
    localised_flight(task, camera, 0).map(Some)
}

/// Puts the paint of flights onto the texels; returns the film and the pixel of each of its texels.
pub(super) fn spray<'a>(
    flights: impl Iterator<Item = &'a FlightLog>,
    task: &PaintingTask,
) -> Result<(Film, Vec<usize>), MissionError> {
    let stage = Stage::start("spray");
    let (texels, pixels) = task.film_texels();
    let mut film = Film::new(texels)?;
    let shots: Vec<_> = flights.flat_map(|flight| flight.shots(SHOT_STEP)).collect();
    film.deposit(&shots, &spray_model(&task.settings), task.met(), task.settings.threads, &mut |done, total| {
        stage.share(done as f64 / total as f64);
    })?;
    let balance = film.mass_balance();
    let share = 100.0 * balance.deposited as f64 / balance.emitted.max(1) as f64;
    stage.done(&format!("{share:.1} % of the paint on the surface"));
    Ok((film, pixels))
}

/// The noise of the localisation that was chosen, where it is a model of noise.
pub(super) fn localisation_noise(settings: &MissionSettings, usual: Localisation) -> Localisation {
    match settings.localisation {
        LocalisationChoice::Noise => Localisation::slam_7cm(),
        LocalisationChoice::MotionCapture | LocalisationChoice::Slam => usual,
    }
}

/// The flight whose paint counts: with the localisation that was chosen, as far as that is a noise, with an interlock, and with faults.
pub(super) fn counted_flight(plan: &Plan, robot: &Robot, settings: &MissionSettings, layer: u64) -> FlightSettings {
    let usual = usual_flight(plan, robot, settings, layer);
    // Paint that misses by less than the spot is wide is better than none. The flights beside it are flown to see what they miss by, so
    // nothing shuts their valve.
    let interlock = Interlock { miss: settings.spot, ..Interlock::default() };
    FlightSettings {
        localisation: localisation_noise(settings, usual.localisation),
        valve: Valve { interlock: Some(interlock), ..usual.valve },
        faults: settings.faults,
        ..usual
    }
}

/// Wind, hose and vehicle of a flight.
pub(super) fn usual_flight(plan: &Plan, robot: &Robot, settings: &MissionSettings, layer: u64) -> FlightSettings {
    FlightSettings {
        airframe: settings.airframe,
        model: Some(settings.model),
        ..flight_settings(plan, robot.tether, settings.seed.wrapping_mul(0x9E37_79B9).wrapping_add(layer))
    }
}

/// The same plan with the localisation that was chosen, with a drifting localisation, and with the pan-tilt unit locked.
pub(super) fn fly_three(
    plan: &Plan,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    layer: u64,
    onboard: Option<&mut LocalisedFlight>,
) -> Result<[FlightLog; 3], MissionError> {
    let usual = usual_flight(plan, robot, settings, layer);
    let variants = [
        counted_flight(plan, robot, settings, layer),
        FlightSettings { localisation: Localisation::slam_7cm(), ..usual },
        FlightSettings { ptu_locked: true, ..usual },
    ];
    let source = onboard.map(|onboard| onboard as &mut dyn PoseSource);
    let [first, others @ ..] = &variants;
    let one = |flight: &FlightSettings| fly_plan(plan, world, robot, settings, flight, None);
    let counted = || fly_plan(plan, world, robot, settings, first, source);
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

#[cfg(test)]
mod tests {
    use super::super::test_panel;
    use super::*;
    use ptu_kinematics::Ptu;

    #[test]
    fn the_seed_and_the_layer_change_wind_and_localisation() {
        let settings = MissionSettings { seed: 1, threads: 1, ..MissionSettings::default() };
        let surface = test_panel::surface();
        let robot = Robot::new(Ptu::new(settings.ptu).unwrap());
        let plan = test_panel::plan(&surface, &robot, &settings);
        let fly = |seed, layer| {
            let settings = MissionSettings { seed, ..settings.clone() };
            fly_three(&plan, &surface.world, &robot, &settings, layer, None).unwrap()
        };
        let (usual, again, other, next) = (fly(1, 0), fly(1, 0), fly(2, 0), fly(1, 1));
        for k in 0..3 {
            assert_eq!(usual[k], again[k]);
            assert_ne!(usual[k], other[k], "flight {k} ignores the seed");
            assert_ne!(usual[k], next[k], "flight {k} is the same in every layer");
        }
    }
}
