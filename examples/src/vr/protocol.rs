//! What page and server say to each other: text is JSON, binary is geometry and pixels, little-endian.

use serde::{Deserialize, Serialize};

use super::canvas::Patch;
use super::event::Event;
use super::message::Notice;
use super::session::Session;
use super::world::VrWorld;

/// Version of everything below; the page reloads itself where it differs.
pub(super) const PROTOCOL: u32 = 3;

/// From the page.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClientMessage {
    /// Events in their order; those that were not acknowledged come again after a lost connection.
    pub(super) events: Vec<Event>,
}

/// To the page.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum ServerMessage {
    /// The first message.
    Welcome {
        protocol: u32,
        /// Who shows this key comes back to the session after a lost connection.
        key: String,
        next_sequence: u64,
        /// Time of the latest state, s: the clock of a page goes on from there.
        clock: f64,
        name: String,
        atlas: [usize; 2],
        palette: Vec<Paint>,
        live: bool,
        paused: bool,
        cradle: [f64; 3],
        heading: f64,
        /// Distance from which painting is refused, m.
        far: f64,
        /// Nearest and farthest stand-off that the brush size stands for, m.
        stand_off: [f64; 2],
    },
    /// The first message where nobody paints, but a run or a recording is watched.
    Watching { protocol: u32, key: String, next_sequence: u64, name: String, paused: bool },
    /// Where the watched scene lies on the page, and from where it is looked at.
    Place {
        position: [f64; 3],
        /// x y z w.
        rotation: [f64; 4],
        cradle: [f64; 3],
        heading: f64,
    },
    /// Where the frames of the watched scene are.
    Frames { frames: Vec<Frame> },
    /// How far a recording is played, s; none of a run.
    Playback { elapsed: Option<f64>, paused: bool },
    /// All events before this one are part of the session.
    Ack { next_sequence: u64 },
    /// The robot and the latencies.
    Robot {
        position: [f64; 3],
        /// x y z w.
        rotation: [f64; 4],
        pan_tilt: [f64; 2],
        nozzle: [f64; 3],
        aim: [f64; 3],
        spraying: bool,
        /// Latency in distance, m, and in time at the latest plan, s.
        lag: f64,
        latency: f64,
        waiting: bool,
        live: bool,
        paused: bool,
    },
    /// For the person.
    Notice { notice: Notice },
}

/// A frame in the watched scene.
#[derive(Debug, Serialize)]
pub(super) struct Frame {
    pub(super) name: String,
    pub(super) position: [f64; 3],
    /// x y z w.
    pub(super) rotation: [f64; 4],
}

/// A paint on the palette.
#[derive(Debug, Serialize)]
pub(super) struct Paint {
    name: &'static str,
    srgb: [u8; 3],
}

/// The first message of a session.
pub(super) fn welcome(session: &Session, key: &str) -> ServerMessage {
    let world = session.world();
    ServerMessage::Welcome {
        protocol: PROTOCOL,
        key: key.into(),
        next_sequence: session.next_sequence(),
        clock: session.clock(),
        name: world.name.clone(),
        atlas: [world.surface.width(), world.surface.height()],
        palette: world.palette.iter().map(|entry| Paint { name: entry.name.as_str(), srgb: entry.srgb }).collect(),
        live: session.is_live(),
        paused: session.is_paused(),
        cradle: world.stand.coords.into(),
        heading: world.home.heading,
        far: session.settings().session.far,
        stand_off: session.stand_off(),
    }
}

/// Where the robot is.
pub(super) fn robot(session: &Session) -> ServerMessage {
    let view = session.vehicle();
    let q = view.world_from_body.rotation.quaternion();
    ServerMessage::Robot {
        position: view.world_from_body.translation.vector.into(),
        rotation: [q.i, q.j, q.k, q.w],
        pan_tilt: view.pan_tilt,
        nozzle: view.nozzle.coords.into(),
        aim: view.aim.coords.into(),
        spraying: view.flow > 0.0,
        lag: session.lag(),
        latency: session.curves().time.last().map_or(0.0, |(_, latency)| *latency),
        waiting: session.is_waiting(),
        live: session.is_live(),
        paused: session.is_paused(),
    }
}

/// The surface: `1 0 0 0`, vertices and faces as counts (u32), then positions, texture coordinates (f32) and corners (u32).
pub(super) fn surface(world: &VrWorld) -> Vec<u8> {
    let surface = &world.surface;
    let (positions, faces) = (surface.vertices(), surface.disk().faces());
    let extent = [surface.width(), surface.height()].map(|side| side as f64 * surface.texels.texel_m);
    let mut bytes = vec![1, 0, 0, 0];
    let mut word = |word: [u8; 4]| bytes.extend_from_slice(&word);
    word((positions.len() as u32).to_le_bytes());
    word((faces.len() as u32).to_le_bytes());
    positions.iter().flatten().for_each(|c| word(c.to_le_bytes()));
    for [u, v] in surface.chart.uv() {
        word(((u / extent[0]) as f32).to_le_bytes());
        // Row 0 of the atlas is its upper one.
        word(((1.0 - v / extent[1]) as f32).to_le_bytes());
    }
    faces.iter().flatten().for_each(|corner| word(corner.to_le_bytes()));
    bytes
}

/// A rectangle of a picture: `2`, its number (0 what the person sees, 1 what the robot has sprayed), `0 0`, left, top, width, height
/// (u16), then three bytes per pixel.
pub(super) fn patch(picture: u8, patch: &Patch) -> Vec<u8> {
    let mut bytes = vec![2, picture, 0, 0];
    for side in [patch.left, patch.top, patch.width, patch.height] {
        bytes.extend_from_slice(&side.to_le_bytes());
    }
    bytes.extend_from_slice(&patch.rgb);
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::world::tests::wall;
    use super::*;

    #[test]
    fn a_surface_is_as_it_is_described() {
        let world = wall(0.02);
        let bytes = surface(&world);
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let float = |at: usize| f32::from_bits(word(at));
        let (vertices, faces) = (word(4) as usize, word(8) as usize);
        assert_eq!((bytes[..4].to_vec(), vertices, faces), (vec![1, 0, 0, 0], 4, 2));
        assert_eq!(bytes.len(), 12 + 12 * vertices + 8 * vertices + 12 * faces);
        let corner = |k: usize| [0, 1, 2].map(|c| float(12 + 12 * k + 4 * c));
        let texture = |k: usize| [0, 1].map(|c| float(12 + 12 * vertices + 8 * k + 4 * c));
        for k in 0..4 {
            assert!(texture(k).iter().all(|c| (-1e-3..=1.001).contains(c)), "{:?}", texture(k));
            for l in 0..4 {
                let [a, b] = [corner(k), corner(l)];
                let ([u, v], [s, t]) = (texture(k), texture(l));
                // Seen from the robot, which looks along x: +y is left, and row 0 of the picture is above.
                if a[1] > b[1] + 1.0 {
                    assert!(u < s, "left of it");
                }
                if a[2] > b[2] + 0.5 {
                    assert!(v < t, "above it");
                }
            }
        }
        let corners: Vec<u32> = (0..6).map(|k| word(12 + 20 * vertices + 4 * k)).collect();
        assert!(corners.iter().all(|c| (*c as usize) < vertices));
    }

    #[test]
    fn a_patch_is_as_it_is_described() {
        let change = Patch { left: 3, top: 258, width: 2, height: 1, rgb: vec![9, 8, 7, 6, 5, 4] };
        assert_eq!(patch(1, &change), [2, 1, 0, 0, 3, 0, 2, 1, 2, 0, 1, 0, 9, 8, 7, 6, 5, 4]);
    }
}
