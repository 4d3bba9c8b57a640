//! The command line of `robot`.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Parser;

use super::fault::Fault;
use super::on_board::SetpointKind;
use crate::mission_arguments::MissionArguments;
use crate::socket_address;

/// Flies the first minutes of a painting mission on an autopilot that speaks MAVLink: PX4 as a program in lockstep with the simulated
/// vehicle, or a multirotor with PX4 over UDP. Without other arguments it paints the built-in rock wall.
#[derive(Parser)]
#[command(
    name = "robot",
    version,
    after_help = "Example:\n  robot --autopilot px4:px4 --seconds 60 --out out/px4\n  robot --autopilot udp:127.0.0.1:14540"
)]
pub struct Arguments {
    #[command(flatten)]
    pub(super) mission: MissionArguments,
    /// Who flies: px4:FOLDER (px4, px4-alias.sh and etc/ of a PX4 built for simulation), or udp:ADDRESS:PORT where a vehicle sends to
    #[arg(long, value_name = "px4:FOLDER|udp:ADDRESS:PORT")]
    pub(super) autopilot: AutopilotChoice,
    /// How much of the plan is painted, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, value_parser = seconds)]
    pub(super) seconds: f64,
    /// Set-points for the autopilot
    #[arg(long, value_enum, default_value_t = SetpointKind::Trajectory)]
    pub(super) setpoints: SetpointKind,
    /// Lets something fail after the paint begins: link, pose, clock, estimate or mode @SECONDS+DURATION; battery, restart or program @SECONDS
    #[arg(long, value_name = "KIND@SECONDS+DURATION")]
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
    /// A vehicle that sends to this address of ours, on the wall clock.
    Udp(SocketAddr),
}

impl FromStr for AutopilotChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("px4", folder)) if !folder.is_empty() => Ok(Self::Px4(folder.into())),
            Some(("udp", address)) => socket_address::parse(address).map(Self::Udp),
            Some(("serial", _)) => {
                Err("serial lines are not built in: let a router such as mavlink-router carry them to UDP".into())
            }
            _ => Err("give px4:FOLDER or udp:ADDRESS:PORT".into()),
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
        assert_eq!("udp:127.0.0.1:14540".parse(), Ok(AutopilotChoice::Udp(([127, 0, 0, 1], 14540).into())));
        for bad in ["px4:", "px4", "udp:", "udp:127.0.0.1", "tcp:127.0.0.1:1", "serial:/dev/ttyUSB0,57600"] {
            assert!(bad.parse::<AutopilotChoice>().is_err(), "{bad}");
        }
    }
}
