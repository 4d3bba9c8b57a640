//! What the robot carries, how well it is known, and how many there are.

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
    /// Robots that paint at the same time, each its own part of the surface [default: 1]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(1..=64))]
    robots: Option<u8>,
    /// Least distance between two of them, metres [default: 2]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    apart: Option<f64>,
}

impl Vehicle {
    pub(super) fn apply(&self, settings: &mut MissionSettings) {
        let endurance = &mut settings.endurance;
        endurance.tank = self.tank.map(|litres| 1e-3 * litres).or(endurance.tank);
        endurance.battery = self.battery.map(|minutes| 60.0 * minutes).or(endurance.battery);
        settings.identify |= self.identify;
        settings.team.robots = self.robots.map_or(settings.team.robots, usize::from);
        settings.team.apart = self.apart.unwrap_or(settings.team.apart);
    }
}
