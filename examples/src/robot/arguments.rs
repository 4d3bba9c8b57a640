//! The command line of `robot`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Parser;

use super::fault::Fault;
use super::on_board::SetpointKind;
use crate::autopilot::LinkAddress;
use crate::mission_arguments::MissionArguments;

/// The robot's own program: it scans the built-in rock wall, or flies the mission that is named, in simulation or on an autopilot that speaks
/// MAVLink. Without a mission it finds itself in its map by its own senses, paints, looks, and paints again what is missing.
#[derive(Parser)]
#[command(
    name = "robot",
    version,
    after_help = "Example:\n  robot\n  robot --autopilot px4:px4 --seconds 60 --out out/px4\n  robot --autopilot udp:127.0.0.1:14540\n  robot --autopilot serial:/dev/ttyUSB0,921600"
)]
pub struct Arguments {
    #[command(flatten)]
    pub(super) mission: MissionArguments,
    /// Who flies: px4:FOLDER (px4, px4-alias.sh and etc/ of a PX4 built for simulation; in lockstep with the simulated vehicle), or a multirotor on
    /// PX4, which flies the first flight: udp:ADDRESS:PORT where it sends to, or serial:DEVICE,BAUD [default: the built-in simulation]
    #[arg(long, value_name = "px4:FOLDER|udp:ADDRESS:PORT|serial:DEVICE,BAUD")]
    pub(super) autopilot: Option<AutopilotChoice>,
    /// Paint no more than so much of the first flight's plan, seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds, requires = "autopilot")]
    pub(super) seconds: Option<f64>,
    /// Set-points for the autopilot
    #[arg(long, value_enum, default_value_t = SetpointKind::Trajectory, requires = "autopilot")]
    pub(super) setpoints: SetpointKind,
    /// Lets something fail after the paint of the first flight begins: link, pose, clock, estimate, mode or servo @SECONDS+DURATION; battery, restart or program @SECONDS; of a robot that flies by its own senses camera, depth, images, elsewhere, imu, late, clipped or swapped @SECONDS+DURATION
    #[arg(long, value_name = "KIND@SECONDS+DURATION", requires = "autopilot")]
    pub(super) fault: Vec<Fault>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/robot")]
    pub(super) out: PathBuf,
}

/// The autopilots to choose from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AutopilotChoice {
    /// PX4 as a program, in lockstep.
    Px4(PathBuf),
    /// A vehicle, on the wall clock.
    Vehicle(LinkAddress),
}

impl FromStr for AutopilotChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("px4", folder)) if !folder.is_empty() => Ok(Self::Px4(folder.into())),
            Some(("udp" | "serial", _)) => text.parse().map(Self::Vehicle),
            _ => Err("give px4:FOLDER, udp:ADDRESS:PORT or serial:DEVICE,BAUD".into()),
        }
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0 && *v <= 86_400.0);
    value.ok_or_else(|| "give seconds, at most a day of them".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn autopilots_are_read_and_bad_ones_are_refused() {
        assert_eq!("px4:a/b".parse(), Ok(AutopilotChoice::Px4("a/b".into())));
        let vehicle = LinkAddress::Serial { device: "COM3".into(), baud: 921_600 };
        assert_eq!("serial:COM3,921600".parse(), Ok(AutopilotChoice::Vehicle(vehicle)));
        for bad in ["px4:", "px4", "tcp:127.0.0.1:1"] {
            assert!(bad.parse::<AutopilotChoice>().unwrap_err().starts_with("give px4:"), "{bad}");
        }
        assert!("serial:COM3".parse::<AutopilotChoice>().unwrap_err().starts_with("give serial:"));
    }
}
