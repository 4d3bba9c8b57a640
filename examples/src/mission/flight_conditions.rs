//! The conditions of a flight: wind, hose, vehicle, noise of the localisation, valve.

use paint_planner::Plan;
use paint_sim::FlightSettings;
use paint_sim::flight::{Interlock, Localisation, Valve};

use super::settings::{LocalisationChoice, MissionSettings};
use super::simulated_flight::flight_settings;
use crate::adapters::Robot;

/// Without a pose for longer than this, s, the robot lands, and flies the rest as another sortie.
const LONGEST_WITHOUT_POSE: f64 = 5.0;

/// The noise of the localisation that was chosen, where it is a model of noise.
pub(super) fn localisation_noise(settings: &MissionSettings, usual: Localisation) -> Localisation {
    match settings.localisation.unwrap_or_default() {
        LocalisationChoice::Noise => Localisation::slam_7cm(),
        LocalisationChoice::MotionCapture | LocalisationChoice::Slam => usual,
    }
}

/// The flight whose paint counts: with the localisation that was chosen, as far as that is a noise, with an interlock, and with faults.
pub(super) fn counted_flight(plan: &Plan, robot: &Robot, settings: &MissionSettings, layer: u64) -> FlightSettings {
    let usual = usual_flight(plan, robot, settings, layer);
    // Paint that misses by less than the spot is wide is better than none. The flights beside it are flown to see what they miss by, so
    // nothing shuts their valve.
    FlightSettings {
        localisation: localisation_noise(settings, usual.localisation),
        valve: Valve { interlock: Some(Interlock::within(settings.spot)), ..usual.valve },
        faults: settings.faults,
        ptu_locked: settings.path_planner.locks_gun(),
        longest_without_pose: Some(LONGEST_WITHOUT_POSE),
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
