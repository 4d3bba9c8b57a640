//! The simulator's end of the link to PX4: TCP.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use mavlink::dialects::common::MavMessage;

use super::codec::{Decoder, Encoder};
use super::error::AutopilotError;

/// The longest wait for an answer, wall clock: a loaded machine may take long, a dead autopilot takes for ever.
const ANSWER: Duration = Duration::from_secs(10);

/// The simulator's end of the link to PX4.
pub struct SimulatorSocket {
    stream: TcpStream,
    encoder: Encoder,
    decoder: Decoder,
}

impl SimulatorSocket {
    /// Waits for PX4 to connect, while `alive` finds nothing wrong with it.
    pub fn accept(
        listener: &TcpListener,
        mut alive: impl FnMut() -> Result<(), AutopilotError>,
    ) -> Result<Self, AutopilotError> {
        let failed = |source| AutopilotError::Socket { what: "simulator link of PX4".into(), source };
        listener.set_nonblocking(true).map_err(failed)?;
        let start = Instant::now();
        let stream = loop {
            match listener.accept() {
                Ok((stream, _)) => break stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(failed(error)),
            }
            alive()?;
            if start.elapsed() > ANSWER {
                return Err(AutopilotError::silent("PX4", ANSWER, "it does not connect to the simulator's port"));
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true)).map_err(failed)?;
        Ok(Self { stream, encoder: Encoder::new(1, 51), decoder: Decoder::default() })
    }

    /// Sends a message.
    pub fn send(&mut self, message: &MavMessage) -> Result<(), AutopilotError> {
        let frame = self.encoder.frame(message);
        self.stream.write_all(&frame).map_err(|source| AutopilotError::Socket { what: "simulator link".into(), source })
    }

    /// The next message, if one comes within a time; an error where the link is broken.
    pub fn receive(&mut self, wait: Duration) -> Result<Option<MavMessage>, AutopilotError> {
        let failed = |source| AutopilotError::Socket { what: "simulator link of PX4".into(), source };
        let until = Instant::now() + wait;
        loop {
            if let Some((_, message)) = self.decoder.next_message() {
                return Ok(Some(message));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.stream.set_read_timeout(Some(left)).map_err(failed)?;
            let mut buffer = [0; 2048];
            match self.stream.read(&mut buffer) {
                Ok(0) => return Err(failed(ErrorKind::UnexpectedEof.into())),
                Ok(count) => self.decoder.push(&buffer[..count]),
                Err(error) if would_block(&error) || error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(failed(error)),
            }
        }
    }
}

fn would_block(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
