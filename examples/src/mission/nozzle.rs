//! The nozzle, as the painter and as the simulation know it.

use nalgebra::UnitVector3;
use paint_net::SprayKernel;
use paint_planner::Target;
use paint_sim::{Shot, SprayModel};

use super::settings::MissionSettings;

/// Where the cone of the spray ends, in deviations: all but 0.2 % of the paint lies inside.
const SPRAY_CUT: f64 = 3.5;
/// Paint that has met nothing after this way is overspray, metres: what lies behind the edge of a surface stays clean.
const SPRAY_RANGE: f64 = 0.35;

/// The footprint of the nozzle in texels, with all of its tails.
pub(super) fn kernel(settings: &MissionSettings) -> Result<SprayKernel, paint_net::Error> {
    SprayKernel::new(settings.spot / settings.texel, SPRAY_CUT)
}

/// The same nozzle in the simulation.
pub(super) fn spray_model(settings: &MissionSettings) -> SprayModel {
    let sigma = (settings.spot / settings.planner.nozzle.stand_off).atan();
    SprayModel { sigma, cut: SPRAY_CUT, range: SPRAY_RANGE, ..SprayModel::default() }
}

/// A share of the way from a target to the next, with the nozzle upright at the stand-off, metres, and a volume in m³.
pub(super) fn upright_shot([from, to]: [&Target; 2], share: f64, stand_off: f64, volume: f64) -> Shot {
    let normal = UnitVector3::try_new(from.normal.lerp(&to.normal, share), 1e-9).unwrap_or(from.normal);
    let point = from.point + (to.point - from.point) * share;
    Shot { origin: point + normal.into_inner() * stand_off, axis: -normal, volume }
}
