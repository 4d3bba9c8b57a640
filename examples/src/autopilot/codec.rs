//! Bytes of a link to messages and back.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{self, Read};
use std::rc::Rc;

use mavlink::dialects::common::MavMessage;
use mavlink::error::MessageReadError;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkReader};

/// Makes frames (MAVLink 2) of messages.
#[derive(Debug, Clone)]
pub struct Encoder {
    header: MavHeader,
}

impl Encoder {
    /// For the sender `system`, `component`.
    pub fn new(system: u8, component: u8) -> Self {
        Self { header: MavHeader { system_id: system.into(), component_id: component, sequence: 0 } }
    }

    /// The next frame.
    pub fn frame(&mut self, message: &MavMessage) -> Vec<u8> {
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message(self.header, message);
        self.header.sequence = self.header.sequence.wrapping_add(1);
        raw.raw_bytes().to_vec()
    }
}

/// Finds messages in bytes that arrive in any pieces; what is no message is passed over and counted.
pub struct Decoder {
    inbox: Inbox,
    reader: MavlinkReader<Inbox>,
    bytes: usize,
    messages: usize,
}

#[derive(Clone, Default)]
struct Inbox(Rc<RefCell<VecDeque<u8>>>);

impl Read for Inbox {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.0.borrow_mut().read(buffer)?;
        // The end of what is here is not the end of the stream.
        if count == 0 { Err(io::ErrorKind::WouldBlock.into()) } else { Ok(count) }
    }
}

impl Default for Decoder {
    fn default() -> Self {
        let inbox = Inbox::default();
        Self { reader: MavlinkReader::new(inbox.clone()), inbox, bytes: 0, messages: 0 }
    }
}

impl Decoder {
    /// Takes in bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes += bytes.len();
        self.inbox.0.borrow_mut().extend(bytes);
    }

    /// The next message, if it is complete: sender's system and component, and the message.
    pub fn next_message(&mut self) -> Option<(MavHeader, MavMessage)> {
        loop {
            match self.reader.read_any_message() {
                Ok(found) => {
                    self.messages += 1;
                    return Some(found);
                }
                // A frame whose content makes no sense; others may follow.
                Err(MessageReadError::Parse(_)) => {}
                Err(_) => return None,
            }
        }
    }

    /// Bytes taken in, and messages found in them.
    pub fn counts(&self) -> (usize, usize) {
        (self.bytes, self.messages)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mavlink::dialects::common::{ATTITUDE_QUATERNION_DATA, HEARTBEAT_DATA};

    #[test]
    fn frames_are_found_in_pieces_and_among_rubbish() {
        let mut encoder = Encoder::new(7, 191);
        let first = MavMessage::HEARTBEAT(HEARTBEAT_DATA { custom_mode: 6 << 16, ..HEARTBEAT_DATA::default() });
        let second = MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
            q1: 1.0,
            time_boot_ms: 42,
            ..Default::default()
        });
        let mut stream = vec![0xFD, 3, 0, 0xFD, 0xFE, 9];
        stream.extend(encoder.frame(&first));
        let mut broken = encoder.frame(&first);
        broken[12] ^= 0x40;
        stream.extend(broken);
        stream.extend(encoder.frame(&second));
        let mut decoder = Decoder::default();
        let mut found = Vec::new();
        for piece in stream.chunks(5) {
            decoder.push(piece);
            found.extend(std::iter::from_fn(|| decoder.next_message()));
        }
        // What follows rubbish that looks like the start of a frame is found when so many bytes have come.
        decoder.push(&[0; 300]);
        found.extend(std::iter::from_fn(|| decoder.next_message()));
        let messages: Vec<_> = found.iter().map(|(_, message)| message.clone()).collect();
        assert_eq!(messages, [first, second]);
        assert_eq!((found[1].0.sequence, found[1].0.component_id, decoder.counts().1), (2, 191, 2));
    }

    /// Frames that are cut, changed, repeated or swallowed by rubbish: none is taken for another, and whole ones are found again.
    #[test]
    fn damaged_frames_are_never_taken_for_messages() {
        let mut state = 1_u64;
        let mut random = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as usize) % below
        };
        let message = |stamp: u32| {
            let data = ATTITUDE_QUATERNION_DATA { q1: 0.6, q3: -0.8, time_boot_ms: stamp, ..Default::default() };
            MavMessage::ATTITUDE_QUATERNION(data)
        };
        let mut encoder = Encoder::new(1, 1);
        let mut decoder = Decoder::default();
        let (mut stamps, mut whole) = (Vec::new(), 0);
        for stamp in 0..20_000 {
            let mut frame = encoder.frame(&message(stamp));
            let damage = random(8);
            match damage {
                0 => frame.truncate(random(frame.len())),
                1 => {
                    let at = random(frame.len());
                    frame[at] ^= 1 << random(8);
                }
                2 => frame = (0..random(60)).map(|_| if random(4) == 0 { 0xFD } else { random(256) as u8 }).collect(),
                3 => drop(frame.drain(..random(10))),
                _ => {}
            }
            whole += u32::from(damage > 3);
            for piece in frame.chunks(1 + random(40)) {
                decoder.push(piece);
            }
            while let Some((_, found)) = decoder.next_message() {
                let MavMessage::ATTITUDE_QUATERNION(data) = &found else { panic!("{found:?} was never sent") };
                assert_eq!(found, message(data.time_boot_ms), "changed on its way");
                stamps.push(data.time_boot_ms);
            }
        }
        assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]), "in the order in which they were sent");
        assert!(stamps.len() as f64 > 0.99 * f64::from(whole), "{} of {whole}", stamps.len());
    }
}
