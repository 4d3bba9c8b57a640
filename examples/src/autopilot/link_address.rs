//! Where a vehicle is heard: `udp:ADDRESS:PORT` or `serial:DEVICE,BAUD`.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

use crate::socket_address;

/// The slowest line, bit/s: the usual rate that 100 set-points of 65 bytes a second fit into.
const SLOWEST_BAUD: u32 = 115_200;

/// The line to a vehicle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinkAddress {
    /// An address of ours that it sends to.
    Udp(SocketAddr),
    /// A serial port and its rate.
    Serial {
        /// As the system names it.
        device: PathBuf,
        /// bit/s.
        baud: u32,
    },
}

impl FromStr for LinkAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("udp", address)) => socket_address::parse(address).map(Self::Udp),
            Some(("serial", line)) => serial(line),
            _ => Err("give udp:ADDRESS:PORT or serial:DEVICE,BAUD".into()),
        }
    }
}

fn serial(line: &str) -> Result<LinkAddress, String> {
    let example = "give serial:DEVICE,BAUD, as serial:/dev/ttyUSB0,921600";
    let (device, baud) = line.rsplit_once(',').filter(|(device, _)| !device.is_empty()).ok_or(example)?;
    let baud = baud.parse().map_err(|_| format!("{baud} is no rate: {example}"))?;
    if baud < SLOWEST_BAUD {
        return Err(format!("{baud} baud do not carry 100 set-points a second: at least {SLOWEST_BAUD}"));
    }
    Ok(LinkAddress::Serial { device: device.into(), baud })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_bad_ones_are_refused() {
        assert_eq!("udp:127.0.0.1:14540".parse(), Ok(LinkAddress::Udp(([127, 0, 0, 1], 14540).into())));
        let port = LinkAddress::Serial { device: "/dev/a,b".into(), baud: 115_200 };
        assert_eq!("serial:/dev/a,b,115200".parse(), Ok(port));
        for (bad, word) in [
            ("udp:", "give host and port"),
            ("udp:127.0.0.1", "give host and port"),
            ("tcp:127.0.0.1:1", "give udp:"),
            ("serial:,115200", "give serial:"),
            ("serial:COM3", "give serial:"),
            ("serial:COM3,fast", "fast is no rate"),
            ("serial:COM3,57600", "at least 115200"),
        ] {
            let why = bad.parse::<LinkAddress>().unwrap_err();
            assert!(why.contains(word), "{bad}: {why}");
        }
    }
}
