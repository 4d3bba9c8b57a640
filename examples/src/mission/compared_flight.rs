//! Flights beside the one whose paint counts, to compare with.

use nalgebra::{Isometry3, Point3};
use paint_planner::Plan;
use paint_planner::onboard::Sortie;
use paint_sim::flight::{FlightLog, FlightSample, FlightStatistics, Localisation};
use paint_sim::{FlightSettings, TriangleSurface};

use super::error::MissionError;
use super::flight_conditions::usual_flight;
use super::settings::MissionSettings;
use super::simulated_flight::{fly_reference, noise, reference};
use crate::adapters::Robot;
use crate::onboard::Piece;

/// So much of a plan is flown to compare with, s: longer flights only tell the same again.
pub(super) const COMPARED: f64 = 1800.0;
/// Time between two poses that are kept, s.
const POSE_STEP: f64 = 0.1;

/// What is kept of the first half hour of a flight that is compared with another.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedFlight {
    /// Its errors.
    pub statistics: FlightStatistics,
    /// Every tenth of a second the time, s, the body as it was flown, and where it took itself to be, m.
    pub poses: Vec<(f64, Isometry3<f64>, Point3<f64>)>,
}

impl ComparedFlight {
    fn of(log: &FlightLog) -> Self {
        let pose = |sample: &FlightSample| (sample.time, sample.world_from_body, sample.estimated_position);
        Self { statistics: log.statistics(), poses: log.every(POSE_STEP).map(pose).collect() }
    }
}

/// RMS hit error over some flights, m.
pub(super) fn hit_error_rms<'a>(flights: impl Iterator<Item = &'a ComparedFlight>) -> f64 {
    let (squares, hits) = flights.fold((0.0, 0.0), |(squares, hits), ComparedFlight { statistics, .. }| {
        let own = (statistics.open_samples - statistics.missed_samples) as f64;
        (squares + own * statistics.hit_error_rms.powi(2), hits + own)
    });
    f64::sqrt(squares / f64::max(hits, 1.0))
}

/// The flight whose paint counts, as it is `counted`, the same plan with a drifting localisation, and the smoothing plan with the gun locked.
pub(super) fn fly_beside<T>(
    [plan, smoothing]: [&Plan; 2],
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    layer: u64,
    counted: impl FnOnce() -> Result<T, MissionError>,
) -> Result<(T, [ComparedFlight; 2]), MissionError> {
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
    let one = |(plan, flight): &(&Plan, FlightSettings)| -> Result<ComparedFlight, MissionError> {
        Ok(ComparedFlight::of(&first_part(plan, world, robot, settings, flight)?))
    };
    if settings.threads < 2 {
        let (a, [b, c]) = (counted(), others.each_ref().map(one));
        return Ok((a?, [b?, c?]));
    }
    std::thread::scope(|scope| {
        let handles = others.each_ref().map(|flight| scope.spawn(move || one(flight)));
        let a = counted();
        let [b, c] = handles.map(|h| h.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        Ok((a?, [b?, c?]))
    })
}

/// Flies a plan, or the part of it that is compared.
fn first_part(
    plan: &Plan,
    world: &TriangleSurface,
    robot: &Robot,
    settings: &MissionSettings,
    flight: &FlightSettings,
) -> Result<FlightLog, MissionError> {
    let whole = reference(plan, robot, settings);
    let part = Piece::of(&whole, Sortie { from: 0.0, until: COMPARED.min(plan.trajectory.duration()), paint: 0.0 });
    let (log, ended) = fly_reference(&part, world, robot, settings, flight, &mut noise(flight))?;
    ended.map_or(Ok(part.cut(log)), Err)
}
