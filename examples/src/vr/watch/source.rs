//! What is watched: an address or a file.

use std::path::PathBuf;
use std::str::FromStr;

/// A run that is served with Foxglove's protocol, or a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in super::super) enum WatchSource {
    /// Host and port of a WebSocket.
    Address(String),
    /// An MCAP file.
    Recording(PathBuf),
}

impl FromStr for WatchSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.starts_with("wss://") {
            return Err("wss:// is not spoken here: tunnel the port, for example with ssh -L, and give ws://".into());
        }
        let bare = text.strip_prefix("ws://").map(|rest| rest.trim_end_matches('/'));
        let named = bare.unwrap_or(text);
        let port =
            named.rsplit_once(':').filter(|(host, _)| !host.is_empty()).and_then(|(_, port)| port.parse::<u16>().ok());
        match (bare, port) {
            (_, Some(_)) => Ok(Self::Address(named.into())),
            (Some(_), None) => Err("give host and port: ws://127.0.0.1:8765".into()),
            (None, None) => Ok(Self::Recording(text.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_files() {
        let address = |text: &str| Ok(WatchSource::Address(text.into()));
        assert_eq!("ws://127.0.0.1:8765/".parse(), address("127.0.0.1:8765"));
        assert_eq!("localhost:8765".parse(), address("localhost:8765"));
        assert_eq!("[::1]:80".parse(), address("[::1]:80"));
        for file in ["out/mission/mission.mcap", "C:\\out\\mission.mcap", "scan.mcap"] {
            assert_eq!(file.parse(), Ok(WatchSource::Recording(file.into())));
        }
        for wrong in ["wss://host:1", "ws://host", "ws://host:99999"] {
            assert!(wrong.parse::<WatchSource>().is_err(), "{wrong}");
        }
    }
}
