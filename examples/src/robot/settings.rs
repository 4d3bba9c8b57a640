//! What the on-board program is told of a flight.

use paint_planner::onboard::FailsafeSettings;
use paint_sim::FlightSettings;
use paint_sim::flight::Airframe;

use super::arguments::{Arguments, AutopilotChoice};
use super::on_board::OnBoardSettings;
use crate::autopilot::OffboardSettings;

/// Responses of the default vehicle under PX4's attitude control, s.
const PX4_RESPONSE: f64 = 0.18;

/// For a flight under some conditions, of a vehicle that this share of its full thrust carries.
pub(super) fn on_board_settings(
    arguments: &Arguments,
    conditions: &FlightSettings,
    hover_thrust: f64,
) -> OnBoardSettings {
    let airframe = Airframe {
        roll_gain: 1.0,
        roll_time_constant: PX4_RESPONSE,
        pitch_gain: 1.0,
        pitch_time_constant: PX4_RESPONSE,
        ..conditions.airframe
    };
    OnBoardSettings {
        setpoints: arguments.setpoints,
        arms: matches!(arguments.autopilot, Some(AutopilotChoice::Px4(_))),
        airframe,
        hover_thrust,
        sends_odometry: true,
        valve: conditions.valve,
        failsafe: FailsafeSettings::default(),
        offboard: OffboardSettings::default(),
        seconds: arguments.seconds.unwrap_or(f64::INFINITY),
    }
}
