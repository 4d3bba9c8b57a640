//! Which targets can be served at all, each by itself: what a painter should know before it decides.

use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::error::Error;
use crate::not_served::NotServed;
use crate::nozzle::{InitialState, initial_states};
use crate::settings::Settings;
use crate::target::{NozzleState, Target, check_each};
use crate::visibility::drop_hidden;
use crate::world::{Surface, Tool};

/// Whether each target can be served from hover: the tilt joint reaches a permitted incidence, nothing stands in front of it, and
/// for one heading at least the vehicle keeps `settings.clearance`. Neighbours are left aside, so a path may serve fewer: the
/// change of heading between two targets, the flights between strokes and their smoothing may ask for more room.
///
/// Much cheaper than a plan: headings are tried from the spray's own azimuth outwards, and most targets are done with the first.
///
/// # Errors
/// [`Error::Setting`], [`Error::Target`]; [`Error::World`] if surface or tool answer what cannot be, or the targets do not lie on
/// the surface.
pub fn reachable_targets(
    targets: &[Target],
    surface: &dyn Surface,
    tool: &dyn Tool,
    settings: &Settings,
) -> Result<Vec<bool>, Error> {
    settings.check()?;
    check_each(targets, settings.nozzle.distances())?;
    let starts = initial_states(targets, &settings.nozzle);
    let nozzle = |start: Option<InitialState>| start.map(|start| start.state).ok_or(NotServed::OutOfReach);
    let mut nozzles: Vec<Result<NozzleState, NotServed>> = starts.into_iter().map(nozzle).collect();
    drop_hidden(targets, &mut nozzles, surface)?;
    let mut checker = ClearanceChecker::new(surface, tool);
    // Neighbouring targets lie near each other and see the same directions: each heading keeps what it knows of the distances.
    let mut caches = vec![DistanceCache::default(); settings.heading.bins];
    let mut admissible = |nozzle: &NozzleState| {
        let azimuth = nozzle.direction.y.atan2(nozzle.direction.x);
        outwards(settings.heading.bins).zip(&mut caches).any(|(turn, cache)| {
            let vehicle = checker.vehicle(nozzle, azimuth + turn);
            vehicle.is_some_and(|vehicle| checker.is_clear(&vehicle, settings.clearance, cache))
        })
    };
    let reachable = nozzles.iter().map(|nozzle| nozzle.as_ref().is_ok_and(&mut admissible)).collect();
    checker.check_answers()?;
    Ok(reachable)
}

/// The bins of a full circle: 0, then to either side by turns.
fn outwards(bins: usize) -> impl Iterator<Item = f64> {
    (0..bins).map(move |k| {
        let step = k.div_ceil(2) as f64 * std::f64::consts::TAU / bins as f64;
        if k % 2 == 0 { step } else { -step }
    })
}
