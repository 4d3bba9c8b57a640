//! The off-board end of the link to an autopilot: MAVLink over UDP, or over a serial line.

use std::fmt;
use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::time::Duration;

use mavlink::MavHeader;
use mavlink::dialects::common::MavMessage;
use serial2::SerialPort;

use super::codec::{Decoder, Encoder};
use super::error::AutopilotError;
use super::link_address::LinkAddress;

/// Bytes that wait for a slow line; more frames are dropped, as what they say is old by then.
const LONGEST_QUEUE: usize = 512;

/// A MAVLink peer.
pub struct VehicleLink {
    line: Line,
    name: String,
    encoder: Encoder,
    decoder: Decoder,
}

enum Line {
    Udp { socket: UdpSocket, peer: Option<SocketAddr> },
    Serial { port: SerialPort, waiting: Vec<u8> },
}

impl VehicleLink {
    /// Opens the line at an address.
    ///
    /// # Errors
    /// Those of [`udp`](Self::udp) and [`serial`](Self::serial).
    pub fn open(address: &LinkAddress) -> Result<Self, AutopilotError> {
        match address {
            LinkAddress::Udp(local) => Self::udp(*local, None),
            LinkAddress::Serial { device, baud } => Self::serial(device, *baud),
        }
    }

    /// Listens at `local` and speaks to `peer`, or to whoever speaks first.
    ///
    /// # Errors
    /// [`AutopilotError::Socket`] where the address is not to be had.
    pub fn udp(local: SocketAddr, peer: Option<SocketAddr>) -> Result<Self, AutopilotError> {
        let failed = |source| AutopilotError::Socket { what: format!("UDP {local}"), source };
        let socket = UdpSocket::bind(local).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self::new(Line::Udp { socket, peer }, format!("UDP {local}")))
    }

    /// Opens a serial port with 8 data bits, no parity and one stop bit.
    ///
    /// # Errors
    /// [`AutopilotError::Serial`] where there is no such port, it is no serial port, or it has no such rate.
    pub fn serial(device: &Path, baud: u32) -> Result<Self, AutopilotError> {
        let failed = |source| AutopilotError::Serial { device: device.to_owned(), baud, source };
        let mut port = SerialPort::open(device, baud).map_err(failed)?;
        port.set_read_timeout(Duration::ZERO).map_err(failed)?;
        port.set_write_timeout(Duration::ZERO).map_err(failed)?;
        let name = format!("serial port {} at {baud} baud", device.display());
        Ok(Self::new(Line::Serial { port, waiting: Vec::new() }, name))
    }

    fn new(line: Line, name: String) -> Self {
        Self { line, name, encoder: Encoder::new(1, 191), decoder: Decoder::default() }
    }

    /// Sends a message; it is lost where nobody listens, as what is silent is noticed where it matters. Never waits.
    pub fn send(&mut self, message: &MavMessage) {
        let frame = self.encoder.frame(message);
        match &mut self.line {
            Line::Udp { socket, peer: Some(peer) } => {
                let _ = socket.send_to(&frame, *peer);
            }
            Line::Udp { peer: None, .. } => {}
            Line::Serial { port, waiting } => {
                if waiting.len() < LONGEST_QUEUE {
                    waiting.extend(frame);
                }
                let sent = port.write(waiting).unwrap_or(0);
                waiting.drain(..sent);
            }
        }
    }

    /// What has come; never waits.
    pub fn receive(&mut self) -> Vec<(MavHeader, MavMessage)> {
        let mut buffer = [0; 2048];
        match &mut self.line {
            Line::Udp { socket, peer } => loop {
                match socket.recv_from(&mut buffer) {
                    Ok((count, from)) if *peer.get_or_insert(from) == from => self.decoder.push(&buffer[..count]),
                    Ok(_) => {}
                    Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                    Err(_) => break,
                }
            },
            // A port that is unplugged reads nothing, or fails: it is silent.
            Line::Serial { port, .. } => {
                while let Ok(count @ 1..) = port.read(&mut buffer) {
                    self.decoder.push(&buffer[..count]);
                }
            }
        }
        std::iter::from_fn(|| self.decoder.next_message()).collect()
    }

    /// Bytes that have come, and messages in them.
    pub fn counts(&self) -> (usize, usize) {
        self.decoder.counts()
    }
}

impl fmt::Display for VehicleLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mavlink::dialects::common::ATTITUDE_QUATERNION_DATA;
    use std::os::fd::AsRawFd;

    fn message(stamp: u32) -> MavMessage {
        MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA { q1: 1.0, time_boot_ms: stamp, ..Default::default() })
    }

    fn stamps(received: &[(MavHeader, MavMessage)]) -> Vec<u32> {
        let stamp = |(_, message): &(MavHeader, MavMessage)| match message {
            MavMessage::ATTITUDE_QUATERNION(data) => data.time_boot_ms,
            other => panic!("{other:?} was never sent"),
        };
        received.iter().map(stamp).collect()
    }

    /// A link, and the far end of its line.
    fn line() -> (VehicleLink, SerialPort) {
        let (mut far, near) = SerialPort::pair().unwrap();
        far.set_read_timeout(Duration::ZERO).unwrap();
        let device = std::fs::read_link(format!("/proc/self/fd/{}", near.as_raw_fd())).unwrap();
        (VehicleLink::serial(&device, 921_600).unwrap(), far)
    }

    fn read(far: &SerialPort, decoder: &mut Decoder) -> Vec<(MavHeader, MavMessage)> {
        let mut buffer = [0; 4096];
        while let Ok(count @ 1..) = far.read(&mut buffer) {
            decoder.push(&buffer[..count]);
        }
        std::iter::from_fn(|| decoder.next_message()).collect()
    }

    #[test]
    fn messages_cross_a_serial_line_both_ways_with_every_byte_as_it_is() {
        let (mut link, far) = line();
        let (mut encoder, mut decoder) = (Encoder::new(1, 1), Decoder::default());
        // Stamps with the bytes that a terminal would change: newline, return, interrupt, stop.
        let sent = [0x0A0D_1311, 0x0304_1A1C, 7];
        for stamp in sent {
            link.send(&message(stamp));
            assert_eq!(stamps(&read(&far, &mut decoder)), [stamp]);
            far.write_all(&encoder.frame(&message(stamp))).unwrap();
            assert_eq!(stamps(&link.receive()), [stamp]);
        }
        assert_eq!(link.counts().1, 3);
    }

    /// A line that nobody reads holds nobody up; once it is read, what comes is whole and new.
    #[test]
    fn a_line_that_stands_still_is_not_waited_for() {
        let (mut link, far) = line();
        let begun = std::time::Instant::now();
        for stamp in 0..3_000 {
            link.send(&message(stamp));
        }
        assert!(begun.elapsed() < Duration::from_mins(1));
        let mut decoder = Decoder::default();
        let late = stamps(&read(&far, &mut decoder));
        assert!(late.len() < 1_000 && late.windows(2).all(|pair| pair[0] < pair[1]), "{}", late.len());
        for stamp in 3_000..3_020 {
            link.send(&message(stamp));
        }
        assert_eq!(stamps(&read(&far, &mut decoder)).last(), Some(&3_019));
    }

    #[test]
    fn an_unplugged_port_is_silent_and_a_file_is_none() {
        let (mut link, far) = line();
        drop(far);
        link.send(&message(1));
        assert!(link.receive().is_empty());
        for (none, why) in [("/no/such/port", "No such file"), ("/dev/null", "serial port /dev/null at 115200 baud")] {
            let error = VehicleLink::serial(Path::new(none), 115_200).err().unwrap().to_string();
            assert!(error.contains(why) && error.contains("dialout"), "{error}");
        }
    }
}
