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

/// Room between a distance that is asked of the nozzle and its bounds, metres.
const MARGIN: f64 = 2e-3;
/// Spreads that differ by less are one.
const SAME_SPREAD: f64 = 1e-3;

/// The footprint of the nozzle in texels, with all of its tails.
pub(super) fn kernel(settings: &MissionSettings) -> Result<SprayKernel, paint_net::Error> {
    SprayKernel::new(settings.spot / settings.texel, SPRAY_CUT)
}

/// The same nozzle in the simulation.
pub(super) fn spray_model(settings: &MissionSettings) -> SprayModel {
    let sigma = (settings.spot / settings.planner.nozzle.stand_off).atan();
    SprayModel { sigma, cut: SPRAY_CUT, range: SPRAY_RANGE, ..SprayModel::default() }
}

/// Paint of a spray over the thickness at its centre, m²: `2 π σ²` but for the cut.
pub(super) fn spot_area(spray: &Spray, kernel: &SprayKernel, texel: f64) -> f64 {
    kernel.mass() * (spray.sigma / kernel.sigma() * texel).powi(2)
}

/// A stroke of sprays as the planner reads it, in texels: `v · area · unit` of paint each. One of another spread is sprayed from
/// where the cone is as wide, as far as the nozzle may go.
pub(super) fn sprays(
    stroke: &Stroke,
    kernel: &SprayKernel,
    settings: &MissionSettings,
) -> Vec<paint_planner::mission::Spray> {
    let nozzle = &settings.planner.nozzle;
    let of = |s: &Spray| {
        let spread = s.sigma / kernel.sigma();
        let farther = nozzle.stand_off * spread;
        let within = farther.clamp(nozzle.min + MARGIN, nozzle.max - MARGIN);
        let stand_off = ((spread - 1.0).abs() > SAME_SPREAD).then_some(within);
        let volume = s.volume * spot_area(s, kernel, settings.texel) * UNIT_THICKNESS;
        paint_planner::mission::Spray { place: [s.x, s.y], volume, stand_off }
    };
    stroke.sprays.iter().map(of).collect()
}

/// What a nozzle of the planner sprays in the simulation, m³.
pub(super) fn shot(nozzle: &NozzleState, volume: f64) -> Shot {
    Shot { origin: nozzle.position, axis: nozzle.direction, volume }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A depth of 1 over a spot of its own holds `2 π σ²` of it, whatever the spread; beyond what the nozzle may keep it stands at the bound.
    #[test]
    fn a_spread_of_its_own_is_a_distance_of_its_own() {
        let settings = MissionSettings::default();
        let kernel = kernel(&settings).unwrap();
        let spray = |spread: f64| Spray { x: 3.0, y: 4.0, volume: 0.5, sigma: spread * kernel.sigma() };
        let stroke = Stroke { sprays: [1.0, 0.7, 1.3, 0.1, 9.0].map(spray).to_vec() };
        let told = sprays(&stroke, &kernel, &settings);
        let distances: Vec<Option<f64>> = told.iter().map(|s| s.stand_off).collect();
        assert_eq!(distances[0], None);
        for (distance, expected) in distances[1..].iter().zip([0.07, 0.13, 0.05 + MARGIN, 0.15 - MARGIN]) {
            assert!((distance.unwrap() - expected).abs() < 1e-12, "{distance:?} {expected}");
        }
        for (one, spread) in told.iter().zip([1.0, 0.7, 1.3, 0.1, 9.0]) {
            let paint = 0.5 * UNIT_THICKNESS * std::f64::consts::TAU * (spread * settings.spot).powi(2);
            assert!((one.volume / paint - 1.0).abs() < 0.01, "{spread}: {} {paint}", one.volume);
        }
    }
}
