//! Flying it, and what the paint does meanwhile.

use paint_planner::Plan;
use paint_planner::mission::Route;
use paint_sim::flight::FlightLog;
use paint_sim::flight::{Interlock, Localisation, Valve};
use paint_sim::{Film, FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;
use super::plan::Planned;
use super::settings::MissionSettings;
use super::simulated_flight::{flight_settings, fly_plan};
use crate::adapters::Robot;
use crate::progress::Stage;

/// Motion of the nozzle that one shot stands for, metres: widens the spot by less than a percent.
pub(super) const SHOT_STEP: f64 = 0.01;

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

/// Flies every layer three times.
pub(super) fn fly(planned: Planned, task: &PaintingTask) -> Result<Vec<LayerFlight>, MissionError> {
    let stage = Stage::start("fly");
    let count = planned.layers.len();
    let mut flights = Vec::with_capacity(count);
    for (k, (route, plan, smoothing)) in planned.layers.into_iter().enumerate() {
        stage.share(k as f64 / count as f64);
        let [flight, slam, locked] = fly_three(&plan, task.met(), &task.robot, &task.settings, k as u64)?;
        flights.push(LayerFlight { route, plan, smoothing, flight, slam, locked });
    }
    let seconds: f64 = flights.iter().map(|f| f.plan.trajectory.duration()).sum();
    stage.done(&format!("{:.0} min in the air, three times", seconds / 60.0));
    Ok(flights)
}

/// Puts the paint of the flights with motion capture onto the texels; returns the film and the pixel of each of its texels.
pub(super) fn spray(flights: &[LayerFlight], task: &PaintingTask) -> Result<(Film, Vec<usize>), MissionError> {
    let stage = Stage::start("spray");
    let (texels, pixels) = task.film_texels();
    let mut film = Film::new(texels)?;
    let shots: Vec<_> = flights.iter().flat_map(|f| f.flight.shots(SHOT_STEP)).collect();
    film.deposit(&shots, &spray_model(&task.settings), task.met(), task.settings.threads, &mut |done, total| {
        stage.share(done as f64 / total as f64);
    })?;
    let balance = film.mass_balance();
    let share = 100.0 * balance.deposited as f64 / balance.emitted.max(1) as f64;
    stage.done(&format!("{share:.1} % of the paint on the surface"));
    Ok((film, pixels))
}

/// The same plan with motion capture, with a drifting localisation, and with the pan-tilt unit locked.
pub(super) fn fly_three(
    plan: &Plan,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    layer: u64,
) -> Result<[FlightLog; 3], MissionError> {
    let usual = flight_settings(plan, robot.tether, settings.seed.wrapping_mul(0x9E37_79B9).wrapping_add(layer));
    // Paint that misses by less than the spot is wide is better than none. The flights beside it are flown to see what they miss by, so
    // nothing shuts their valve.
    let interlock = Interlock { miss: settings.spot, ..Interlock::default() };
    let valve = Valve { interlock: Some(interlock), ..usual.valve };
    let variants = [
        FlightSettings { valve, ..usual },
        FlightSettings { localisation: Localisation::slam_7cm(), ..usual },
        FlightSettings { ptu_locked: true, ..usual },
    ];
    let one = |flight: &FlightSettings| fly_plan(plan, world, robot, settings, flight);
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
            fly_three(&plan, &surface.world, &robot, &settings, layer).unwrap()
        };
        let (usual, again, other, next) = (fly(1, 0), fly(1, 0), fly(2, 0), fly(1, 1));
        for k in 0..3 {
            assert_eq!(usual[k], again[k]);
            assert_ne!(usual[k], other[k], "flight {k} ignores the seed");
            assert_ne!(usual[k], next[k], "flight {k} is the same in every layer");
        }
    }
}
