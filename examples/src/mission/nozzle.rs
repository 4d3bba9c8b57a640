//! The nozzle, as the painter and as the simulation know it.

use paint_net::path::Stroke;
use paint_net::{Spray, SprayKernel};
use paint_planner::NozzleState;
use paint_sim::{Shot, SprayModel};

use super::settings::MissionSettings;
use crate::appearance::UNIT_THICKNESS;

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

/// A stroke of sprays as the planner reads it, in texels of `texel` metres: `v · mass · texel² · unit` of paint each.
pub(super) fn sprays(stroke: &Stroke, kernel: &SprayKernel, texel: f64) -> Vec<paint_planner::mission::Spray> {
    let volume = |s: &Spray| s.volume * kernel.mass() * texel * texel * UNIT_THICKNESS;
    stroke.sprays.iter().map(|s| paint_planner::mission::Spray { place: [s.x, s.y], volume: volume(s) }).collect()
}

/// What a nozzle of the planner sprays in the simulation, m³.
pub(super) fn shot(nozzle: &NozzleState, volume: f64) -> Shot {
    Shot { origin: nozzle.position, axis: nozzle.direction, volume }
}
