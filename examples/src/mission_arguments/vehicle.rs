//! What the robot carries, and how well it is known.

use clap::Args;

use super::positive::positive;
use crate::mission::MissionSettings;

/// What the robot carries, and how well it is known.
#[derive(Args)]
pub(super) struct Vehicle {
    /// Paint in the robot's tank, litres: it lands to be filled and goes on where the paint ended [default: paint comes through the hose]
    #[arg(long, value_name = "LITRES", value_parser = positive)]
    tank: Option<f64>,
    /// Time in the air on a battery, minutes: it lands to have it changed [default: power comes through the tether]
    #[arg(long, value_name = "MINUTES", value_parser = positive)]
    battery: Option<f64>,
    /// Excite roll and pitch in a flight of a minute before the first that paints, and let controller and observer use the response
    /// that it tells
    #[arg(long)]
    identify: bool,
}

impl Vehicle {
    pub(super) fn apply(&self, settings: &mut MissionSettings) {
        let endurance = &mut settings.endurance;
        endurance.tank = self.tank.map(|litres| 1e-3 * litres).or(endurance.tank);
        endurance.battery = self.battery.map(|minutes| 60.0 * minutes).or(endurance.battery);
        settings.identify |= self.identify;
    }
}
